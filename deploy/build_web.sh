#!/bin/bash
# Builds web/dist when a source is newer than the last build.
set -euo pipefail
cd "$(dirname "$0")/../web"

../deploy/npm_packages.sh .
if [ ! -e dist/index.html ] || [ -n "$(find . -path ./node_modules -prune -o -path ./dist -prune -o -path ./e2e -prune -o -type f -newer dist/index.html -print -quit)" ]; then
  npm run --silent build
  touch dist/index.html
fi
