#!/bin/bash
# Builds web/dist when a source is newer than the last build.
set -euo pipefail
cd "$(dirname "$0")/../web"

../deploy/npm_packages.sh .
../deploy/build_module.sh
module=../build/wasm/bin/fusion.wasm
has_module=$([ -e $module ] && echo yes || echo no)
if [ ! -e dist/index.html ] || [ $module -nt dist/index.html ] || [ "$(cat dist/.has_module 2>/dev/null)" != "$has_module" ] ||
  [ -n "$(find . -path ./node_modules -prune -o -path ./dist -prune -o -path ./e2e -prune -o -type f -newer dist/index.html -print -quit)" ]; then
  npm run --silent build
  echo "$has_module" > dist/.has_module
  touch dist/index.html
fi
