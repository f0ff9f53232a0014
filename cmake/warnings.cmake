# The warnings every target of ours is built with; linked PRIVATE so that they never reach a consumer.
add_library(spectra_warnings INTERFACE)
target_compile_options(spectra_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wnon-virtual-dtor -Wold-style-cast
  -Woverloaded-virtual -Wnull-dereference -Wdouble-promotion -Wimplicit-fallthrough)
if(SPECTRA_WARNINGS_AS_ERRORS)
  target_compile_options(spectra_warnings INTERFACE -Werror)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # g++ 12 reports these two inside libstdc++ and Boost where nothing is wrong.
  target_compile_options(spectra_warnings INTERFACE -Wno-null-dereference -Wno-restrict)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
  # It counts double{value}, which says what it does, too.
  target_compile_options(spectra_warnings INTERFACE -Wno-double-promotion)
endif()
