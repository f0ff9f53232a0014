#!/bin/bash
# Builds the fusion library for the browser, build/wasm/bin/fusion.wasm, where there is a compiler for it (the module packages of
# dependencies.sh). Where there is none the browser leaves fusing to the robot, and that is said.
set -euo pipefail
cd "$(dirname "$0")/.."

for needed in clang++-14 wasm-ld-14; do
  command -v $needed >/dev/null || lacking=$needed
done
for needed in /usr/include/wasm32-wasi/stdio.h /usr/include/wasm32-wasi/c++/v1/vector /usr/lib/wasm32-wasi/libc++.a; do
  [ -e $needed ] || lacking=$needed
done
if [ -n "${lacking:-}" ]; then
  echo "build_module: $lacking is not here, so the fusion library is not built for the browser; it leaves fusing to the robot" >&2
  rm -f build/wasm/bin/fusion.wasm
  exit 0
fi
if [ ! -e build/wasm/CMakeCache.txt ]; then
  cmake --preset wasm >&2
fi
cmake --build --preset wasm >&2
