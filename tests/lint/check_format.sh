#!/bin/bash
# Every C++ file is formatted as .clang-format says.
set -euo pipefail
cd "$1"
mapfile -t files < <(find fusion protocol server tests -name '*.cpp' -o -name '*.hpp' | sort)
[ ${#files[@]} -gt 0 ]
clang-format-14 --dry-run --Werror "${files[@]}"
echo "${#files[@]} files are formatted"
