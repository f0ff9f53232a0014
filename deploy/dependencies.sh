#!/bin/bash
# Installs from Debian what is missing: `dependencies.sh run` for building and serving, `dependencies.sh test` for the
# tests as well. Repeatable; asks apt only when something is absent.
set -euo pipefail

build_packages=(
  g++ cmake ninja-build ccache ca-certificates
  libboost1.81-dev nlohmann-json3-dev libspdlog-dev libcli11-dev
  libdraco-dev libopenmesh-dev libmeshoptimizer-dev libhwy-dev
  prometheus-cpp-dev libtinygltf-dev libfmt-dev libzstd-dev zlib1g-dev
)
test_packages=(
  libgtest-dev libgmock-dev librapidcheck-dev
  clang-format-14 chromium fonts-dejavu-core python3 git
  assimp-utils draco
)

packages=("${build_packages[@]}")
case "${1:-run}" in
  run) ;;
  test) packages+=("${test_packages[@]}") ;;
  *) echo "usage: $0 [run|test]" >&2; exit 2 ;;
esac

# A Node.js that is already there is kept when it is new enough; otherwise Debian's (18.19) is installed.
node_is_usable() {
  command -v node >/dev/null && command -v npm >/dev/null &&
    [ "$(node -p 'Number(process.versions.node.split(".")[0]) >= 18')" = true ]
}
node_is_usable || packages+=(nodejs npm)

missing=()
for package in "${packages[@]}"; do
  [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "dependencies: run as root or install sudo; missing: ${missing[*]}" >&2; exit 1; }
  as_root=(sudo)
fi
echo "dependencies: installing ${missing[*]}" >&2
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >&2
