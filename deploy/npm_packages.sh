#!/bin/bash
# Installs the npm packages of a folder when its lock file changed since the last time.
set -euo pipefail
cd "$1"
if [ ! -e node_modules/.installed ] || ! cmp -s package-lock.json node_modules/.installed; then
  npm ci --no-audit --no-fund --loglevel=error
  cp package-lock.json node_modules/.installed
fi
