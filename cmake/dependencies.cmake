# Every third-party library, with the oldest version that is tried; all come from Debian 12.

# What deploy/dependencies.sh could not install without taking something away from the machine is unpacked here.
list(PREPEND CMAKE_PREFIX_PATH "${PROJECT_SOURCE_DIR}/build/packages/usr")

find_package(Boost 1.81 REQUIRED)
find_package(Threads REQUIRED)
find_package(nlohmann_json 3.11 REQUIRED)
find_package(spdlog 1.10 REQUIRED)
find_package(draco 1.5 REQUIRED)
find_package(OpenMesh REQUIRED)  # Debian 12 ships 9.0; its package config states no version
find_package(meshoptimizer 0.18 REQUIRED)
find_package(hwy 1.0 REQUIRED)
find_package(CLI11 2.1 REQUIRED)
find_package(tomlplusplus 3.3 REQUIRED)
find_package(prometheus-cpp REQUIRED)  # 1.0; likewise
find_package(fmt 9.1 REQUIRED)
find_package(zstd 1.5 REQUIRED)
find_package(TinyGLTF 2.7 REQUIRED)
find_package(ZLIB 1.2 REQUIRED)
find_package(SQLite3 3.40 REQUIRED)
find_package(OpenSSL 3.0 REQUIRED)
find_package(Eigen3 3.4 REQUIRED)
find_package(PNG 1.6 REQUIRED)
find_library(TURBOJPEG_LIBRARY turbojpeg REQUIRED)  # 2.1; its CMake package is not in every Debian package of it
find_library(QRENCODE_LIBRARY qrencode REQUIRED)  # 4.1; has no CMake package
if(SPECTRA_BUILD_TESTS)
  find_package(GTest 1.12 REQUIRED)
  find_package(rapidcheck REQUIRED)
endif()
