#!/bin/bash
# The fusion library on the other processor that robots have: its kernels (NEON), the golden answers and the histogram and statistics
# tests, compiled for 64-bit ARM and run under user-mode emulation. Takes some minutes.
#   tests/integration/arm64.sh       needs root on Debian 12; installs a cross compiler, qemu-user and googletest
set -euo pipefail
cd "$(dirname "$0")/../.."

dpkg --add-architecture arm64
apt-get update -qq
DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
  g++-aarch64-linux-gnu qemu-user googletest nlohmann-json3-dev libboost1.81-dev libhwy-dev
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
# Of the foreign packages only the library itself, unpacked beside.
(cd "$folder" && apt-get download -qq -o APT::Sandbox::User=root libhwy1:arm64 libhwy-dev:arm64 &&
  for package in *.deb; do dpkg -x "$package" .; done)

googletest=/usr/src/googletest/googletest
export folder
compile() {
  aarch64-linux-gnu-g++ -std=c++20 -O2 -ffp-contract=off -I. -isystem /usr/include -isystem "$googletest/include" \
    -I"$googletest" -DSPECTRA_GOLDEN_DIR="\"$PWD/tests/golden\"" \
    "-DHWY_DISABLED_TARGETS=(HWY_SVE|HWY_SVE2|HWY_SVE_256|HWY_SVE2_128)" -c "$1" -o "$folder/$(tr / _ <<< "$1").o"
}
export -f compile
export googletest
printf '%s\n' fusion/*.cpp fusion/colour/*.cpp fusion/colour/data/*.cpp fusion/methods/*.cpp fusion/statistics/*.cpp \
  tests/golden/fusion_vectors_test.cpp tests/unit/fusion/{histogram,statistics}_test.cpp \
  "$googletest"/src/gtest-all.cc "$googletest"/src/gtest_main.cc |
  xargs -P "$(nproc)" -I{} bash -c 'compile {}'
libraries=$folder/usr/lib/aarch64-linux-gnu
aarch64-linux-gnu-g++ "$folder"/*.o -L"$libraries" -lhwy -pthread -o "$folder/fusion_test"
qemu-aarch64 -L /usr/aarch64-linux-gnu -E LD_LIBRARY_PATH="$libraries" "$folder/fusion_test"
