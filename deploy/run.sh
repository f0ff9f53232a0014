#!/bin/bash
# From a fresh clone to a picture in the browser: installs what is missing, builds, serves the demo scene.
#   deploy/run.sh                      the embedded demo scene on http://127.0.0.1:8080
#   deploy/run.sh SCENE.ply [OPTION]   a scene of yours; every option of `spectra serve` may follow
set -euo pipefail
calling_directory=$PWD
root=$(cd "$(dirname "$0")/.." && pwd)

"$root/deploy/dependencies.sh" run
cd "$root"
"$root/deploy/build_web.sh" >&2
if [ ! -e build/release/CMakeCache.txt ]; then
  cmake --preset release -DSPECTRA_BUILD_TESTS=OFF -DSPECTRA_BUILD_BENCHMARKS=OFF >&2
fi
cmake --build build/release --target spectra >&2

cd "$calling_directory"
exec "$root/build/release/bin/spectra" serve --web "$root/web/dist" "$@"
