#!/bin/bash
# Builds web/dist when a source is newer than the last build; installs the npm packages when the lock file changed.
set -euo pipefail
cd "$(dirname "$0")/../web"

if [ ! -e node_modules/.installed ] || [ package-lock.json -nt node_modules/.installed ]; then
  npm ci --no-audit --no-fund --loglevel=error
  touch node_modules/.installed
fi
if [ ! -e dist/index.html ] || [ -n "$(find . -path ./node_modules -prune -o -path ./dist -prune -o -type f -newer dist/index.html -print -quit)" ]; then
  npm run --silent build
  touch dist/index.html
fi
