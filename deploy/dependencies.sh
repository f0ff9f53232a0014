#!/bin/bash
# Installs from Debian what is missing: `dependencies.sh run` for building and serving, `dependencies.sh test` for the
# tests as well. Repeatable; asks apt only when something is absent.
#
# Packages are added, never removed or downgraded: apt is asked first what it would do. A package that it could only install
# by taking another one away (libboost1.81-dev on a machine with libpcl-dev, which needs Debian's Boost 1.74) is unpacked
# into build/packages instead, where only this build looks (cmake/dependencies.cmake). Where that does not go either, nothing
# is changed and the reason is said.
set -euo pipefail
beside=$(cd "$(dirname "$0")/.." && pwd)/build/packages

build_packages=(
  g++ cmake ninja-build ccache ca-certificates
  libboost1.81-dev nlohmann-json3-dev libspdlog-dev libcli11-dev libtomlplusplus-dev
  libdraco-dev libopenmesh-dev libmeshoptimizer-dev libhwy-dev
  prometheus-cpp-dev libtinygltf-dev libfmt-dev libzstd-dev zlib1g-dev
  libsqlite3-dev libssl-dev libqrencode-dev
  libeigen3-dev libpng-dev libturbojpeg0-dev
)
# The compiler of the fusion library for the browser. Without it the browser leaves fusing to the robot, so that these are
# installed where they can simply be added, and else are left out.
module_packages=(
  clang-14 lld-14 wasi-libc libc++-14-dev-wasm32 libc++abi-14-dev-wasm32 libclang-rt-14-dev-wasm32
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

say() { echo "dependencies: $*" >&2; }
stop() { say "$*"; say "nothing was changed"; exit 1; }
leave_out_module() {
  say "${module_missing[*]} cannot be installed here ($*): the browser leaves fusing to the robot"
  module_missing=()
}

# A Node.js that is already there is kept when it is new enough; otherwise Debian's (18.19) is installed.
node_is_usable() {
  command -v node >/dev/null && command -v npm >/dev/null &&
    [ "$(node -p 'Number(process.versions.node.split(".")[0]) >= 18')" = true ]
}
node_is_usable || packages+=(nodejs npm)

installed=" $(dpkg-query -W -f '${db:Status-Status}:${Package} ' "${packages[@]}" "${module_packages[@]}" 2>/dev/null || true) "
is_installed() { [[ $installed == *" installed:$1 "* ]]; }
missing=()
for package in "${packages[@]}"; do
  is_installed "$package" || [ -e "$beside/.complete/$package" ] || missing+=("$package")
done
# Asked for once: a machine that cannot have them is not asked again at every start.
module_refused=$beside/.module_refused
module_missing=()
if [ ! -e "$module_refused" ]; then
  for package in "${module_packages[@]}"; do is_installed "$package" || module_missing+=("$package"); done
fi
[ ${#missing[@]} -eq 0 ] && [ ${#module_missing[@]} -eq 0 ] && exit 0

install_options=(-y --no-install-recommends -o APT::Get::AutomaticRemove=false -o DPkg::Lock::Timeout=120)

# Prints why these packages cannot simply be added: what apt would remove or downgrade, or apt's own reason. Nothing when they can.
harm_of() {
  local plan harm verb name old new
  if ! plan=$(LC_ALL=C apt-get -s install "${install_options[@]}" "$@" 2>&1); then
    # apt refuses a downgrade, and a change of what is on hold, by itself.
    grep -E '^(E:| [a-z0-9])' <<<"$plan" | sed 's/^E: //' | tr -s ' \n' ' ' | cut -c1-400
    return
  fi
  harm=$(while read -r verb name old new _; do
    case $verb in
      Remv) echo "remove $name" ;;
      Inst)
        [[ $old == \[* ]] || continue
        old=${old#[} old=${old%]} new=${new#(}
        ! dpkg --compare-versions "$new" lt "$old" || echo "downgrade $name from $old to $new" ;;
    esac
  done <<<"$plan")
  [ -n "$harm" ] || return 0
  awk 'NR == 1 { text = "it would " $0 } NR > 1 && NR <= 6 { text = text ", " $0 }
       END { print text (NR > 6 ? " and " (NR - 6) " more" : "") }' <<<"$harm"
}

# Puts a package into a folder. Only one that needs no shared library of a package that is not here.
unpack() {
  local package=$1 folder=$2 download dangling
  download=$(mktemp -d "$folder/.download-XXXX")
  (cd "$download" && apt-get -qq download "$package" >/dev/null 2>log) ||
    { grep -m 1 '^E:' "$download/log" | sed 's/^E: //'; return 1; }
  dpkg-deb -x "$download"/*.deb "$folder" || return 1
  rm -r "$download"
  dangling=$(find "$folder" -xtype l -name '*.so*' -print -quit)
  [ -z "$dangling" ] || { echo "its $(basename "$dangling") needs a library of another package"; return 1; }
  mkdir -p "$folder/.complete"
  : > "$folder/.complete/$package"
}

as_root=()
if [ ${#missing[@]} -eq 0 ] && [ "$(id -u)" -ne 0 ] && ! sudo -n true 2>/dev/null; then
  leave_out_module "an administrator can run: apt-get install --no-remove ${module_missing[*]}"
  exit 0
fi
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || stop "run as root or install sudo; missing: ${missing[*]}"
  as_root=(sudo)
  # Without a terminal nobody can type a password.
  [ -t 0 ] || as_root=(sudo -n)
  "${as_root[@]}" true || stop "sudo did not let us; an administrator can run: apt-get install --no-remove ${missing[*]}"
fi
"${as_root[@]}" test -w /var/lib/dpkg || stop "/var/lib/dpkg cannot be written (a read-only system?); missing: ${missing[*]}"
"${as_root[@]}" apt-get update -qq >&2 || say "the package lists could not be brought up to date; going on with those that are here"

# Sorts packages into those that can be added and those that conflict, halving a group that does harm: apt takes a second or
# more for each question.
plain=()
conflicting=()
declare -A harm_by
is_split=false
sort_out() {
  local harm half=$(($# / 2))
  harm=$(harm_of "$@")
  if [ -z "$harm" ]; then plain+=("$@");
  elif [ $# -eq 1 ]; then conflicting+=("$1") harm_by[$1]=$harm;
  else
    is_split=true
    sort_out "${@:1:half}"
    sort_out "${@:half + 1}"
  fi
}
[ ${#missing[@]} -eq 0 ] || sort_out "${missing[@]}"
# What goes piece by piece need not go together.
if $is_split && [ ${#plain[@]} -gt 0 ]; then
  harm=$(harm_of "${plain[@]}")
  [ -z "$harm" ] || stop "${plain[*]} cannot be added to this machine: $harm"
fi

if [ ${#module_missing[@]} -gt 0 ]; then
  harm=$(harm_of "${plain[@]}" "${module_missing[@]}")
  if [ -z "$harm" ]; then
    plain+=("${module_missing[@]}")
  else
    leave_out_module "$harm"
    mkdir -p "$beside"
    : > "$module_refused"
  fi
fi

if [ ${#conflicting[@]} -gt 0 ]; then
  for package in "${conflicting[@]}"; do
    case $package in
      nodejs|npm)
        # Programs beside the build are on nobody's PATH.
        stop "$package cannot be installed here (${harm_by[$package]}), and the Node.js that is here ($(node --version 2>/dev/null || echo "does not run")) lacks npm or is older than 18; put a newer one on the PATH" ;;
    esac
  done
  mkdir -p "$beside"
  new=$(mktemp -d "$beside.new-XXXX")
  trap 'rm -rf "$new"' EXIT
  cp -a "$beside/." "$new"
  for package in "${conflicting[@]}"; do
    say "$package cannot be installed here (${harm_by[$package]}); unpacking it for this build alone into $beside"
    reason=$(unpack "$package" "$new") || stop "$package cannot be unpacked beside the build either: $reason"
  done
fi
if [ ${#plain[@]} -gt 0 ]; then
  say "installing ${plain[*]}"
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -qq --no-remove "${install_options[@]}" "${plain[@]}" >&2
fi
if [ ${#conflicting[@]} -gt 0 ]; then
  rm -r "$beside"
  mv "$new" "$beside"
fi
node_is_usable || { say "node on the PATH ($(command -v node || echo none)) lacks npm or is older than 18, and comes before what is installed; put a newer one before it"; exit 1; }
