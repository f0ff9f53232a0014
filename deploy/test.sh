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
# What depends on time mostly waits; the rest keeps every processor busy, and so does the browser.
timed='^integration\.(access|change|ingest|interruption|progress|push|radio_link|refusals|resume|tls)$'
ctest --preset ci -j "$(nproc)" -E "$timed" || status=1
(cd web && npm run --silent e2e) || status=1
(cd web && npm test --silent) || status=1
ctest --preset ci -j 4 -R "$timed" || status=1
exit $status
