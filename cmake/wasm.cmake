# Toolchain of the WebAssembly module: Debian's clang 14 with wasi-libc and libc++; why these: docs/decisions/0011.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR wasm32)
set(CMAKE_CXX_COMPILER clang++-14)
set(CMAKE_CXX_COMPILER_TARGET wasm32-wasi)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(SPECTRA_MODULE ON)

# Of /usr/include only these: the rest belongs to the C library of this machine.
set(headers ${CMAKE_BINARY_DIR}/include)
file(MAKE_DIRECTORY ${headers})
foreach(library boost hwy)
  foreach(root ${CMAKE_CURRENT_LIST_DIR}/../build/packages/usr/include /usr/include)
    if(EXISTS ${root}/${library})
      file(CREATE_LINK ${root}/${library} ${headers}/${library} SYMBOLIC)
      break()
    endif()
  endforeach()
endforeach()

set(CMAKE_CXX_FLAGS_INIT
  "-isystem ${headers} -msimd128 -fno-exceptions -fno-rtti -fvisibility=hidden -ffunction-sections -fdata-sections")
set(CMAKE_EXE_LINKER_FLAGS_INIT
  "-mexec-model=reactor -Wl,--gc-sections -Wl,--strip-all -Wl,-z,stack-size=262144")
