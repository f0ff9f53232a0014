#!/bin/bash
# The program for 64-bit ARM, the other processor that robots have, compiled here and tried under user-mode emulation. Needs root on Debian 12
# and the better part of an hour; not a part of deploy/test.sh.
#   deploy/arm64.sh [TARGET...]     default: spectra, and the tests that are run; with TARGETs only those are built, and tests among them run
set -euo pipefail
cd "$(dirname "$0")/.."
export DEBIAN_FRONTEND=noninteractive
apt-get install -y -qq --no-install-recommends g++-aarch64-linux-gnu qemu-user mmdebstrap >&2

# A folder with Debian's libraries for it, unpacked and not installed.
root=$PWD/build/arm64_root
if [ ! -e "$root/complete" ]; then
  rm -rf "$root"
  packages=$(sed -n '/^build_packages=(/,/^)/p;/^test_packages=(/,/^)/p' deploy/dependencies.sh | grep -oE '[a-z0-9.+-]+-dev\b' | paste -sd,)
  mmdebstrap --quiet --architectures=arm64 --variant=extract --include="libc6-dev,libstdc++-12-dev,$packages" bookworm "$root"
  # Of these packages CMake's files have absolute names.
  grep -rlE '"/usr/(lib|include)' "$root/usr/lib/aarch64-linux-gnu/cmake" "$root/usr/share" --include='*.cmake' 2>/dev/null |
    xargs -r sed -i "s|\"/usr/|\"$root/usr/|g"
  sed -i "s|\${PACKAGE_PREFIX_DIR}|$root/usr|g" "$root"/usr/lib/aarch64-linux-gnu/cmake/tomlplusplus/*.cmake
  touch "$root/complete"
fi
cmake -G Ninja -S . -B build/arm64 -DCMAKE_TOOLCHAIN_FILE=cmake/arm64.cmake -DCMAKE_BUILD_TYPE=Release \
  -DSPECTRA_BUILD_TESTS=ON -DSPECTRA_BUILD_BENCHMARKS=OFF >&2
targets=("$@")
[ $# -gt 0 ] || targets=(spectra protocol_tests codec_tests fusion_unit_test files_tests mesh_tests map_tests store_tests access_tests net_tests)
cmake --build build/arm64 --target "${targets[@]}" >&2
for target in "${targets[@]}"; do
  echo "== $target"
  case $target in
    spectra) qemu-aarch64 -L "$root" build/arm64/bin/spectra --version ;;
    *) qemu-aarch64 -L "$root" build/arm64/bin/"$target" --gtest_brief=1 ;;
  esac
done
