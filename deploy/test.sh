#!/bin/bash
# The set-up of run.sh and then every test: layer and format checks, C++ tests, Node client against the real server, web
# unit tests and the browser. Real scenes are used when SPECTRA_TEST_DATA names their folder; otherwise their tests skip.
set -euo pipefail
cd "$(dirname "$0")/.."

deploy/dependencies.sh test
deploy/build_web.sh
deploy/npm_packages.sh tests/integration/node
cmake --preset ci -DSPECTRA_BUILD_TESTS=ON -DSPECTRA_BUILD_BENCHMARKS=ON
cmake --build --preset ci

status=0
(cd web && npm run --silent lint) || status=1
# The browser's tests wait for much: the others run beside them, at the lowest priority, and are shown when they are done.
log=build/release/ctest.log
nice -n 19 ctest --preset ci -j "$(nproc)" >"$log" 2>&1 &
others=$!
trap 'kill $others 2>/dev/null || true' EXIT
(cd web && npm run --silent e2e) || status=1
(cd web && npm test --silent) || status=1
wait $others || status=1
cat "$log"
exit $status
