#!/bin/bash
# Builds the Debian package: package.sh [FOLDER [VERSION]] puts it into FOLDER (default build/packages_made) and prints its path.
# VERSION in place of the project's own is for trying an upgrade.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(realpath -m "${1:-build/packages_made}")
deploy/dependencies.sh run
for tool in python3 dpkg-shlibdeps file gzip; do
  command -v $tool >/dev/null || { echo "package: $tool is missing (packages python3 dpkg-dev file gzip)" >&2; exit 1; }
done
deploy/build_web.sh >&2
[ -e build/release/CMakeCache.txt ] || cmake --preset release -DSPECTRA_BUILD_TESTS=OFF -DSPECTRA_BUILD_BENCHMARKS=OFF >&2
cmake --build build/release --target package_files >&2
mkdir -p "$folder"
(cd build/release && cpack -G DEB -B "$folder" ${2:+-R "$2"} >&2)
rm -rf "$folder/_CPack_Packages"
ls -t "$folder"/spectra_*.deb | head -1
