#!/bin/bash
# Runs deploy/run.sh or deploy/test.sh in a Debian 12 root made by debootstrap with nothing else in it, from a clone of HEAD.
#   bare_debian.sh run|test [FOLDER]       needs root, debootstrap and git; FOLDER (default: a new one) is kept for a second start
# Host certificates and apt sources are handed in, so that a machine behind its own package mirror can run it.
set -euo pipefail
what=${1:?run or test}
source_root=$(cd "$(dirname "$0")/../.." && pwd)
folder=${2:-$(mktemp -d /var/tmp/spectra-bare-XXXX)}
root=$folder/root

if [ ! -e "$root/etc/debian_version" ]; then
  debootstrap --variant=minbase bookworm "$root"
fi
mkdir -p "$root/etc/ssl/certs" "$root/usr/local/share/ca-certificates"
cp /etc/resolv.conf "$root/etc/resolv.conf"
if [ -e /etc/ssl/certs/ca-certificates.crt ]; then
  install -D /etc/ssl/certs/ca-certificates.crt "$root/etc/host-certificates.crt"
  printf 'cafile=/etc/host-certificates.crt\n' > "$root/root/.npmrc"
fi
if [ ! -e "$root/spectra" ]; then git clone -q "$source_root" "$root/spectra"; else git -C "$root/spectra" pull -q; fi
for mount in proc sys dev dev/pts; do
  mountpoint -q "$root/$mount" || mount --rbind "/$mount" "$root/$mount"
  mount --make-rslave "$root/$mount"
done
mkdir -p "$root/dev/shm"
trap 'for mount in dev/pts dev sys proc; do umount -lR "$root/$mount" 2>/dev/null || true; done' EXIT
bare() { env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 chroot "$root" "$@"; }

if [ "$what" = test ]; then
  bare /spectra/deploy/test.sh
  exit
fi
bare /spectra/deploy/run.sh --listen 127.0.0.1:0 > "$folder/out.txt" &
server=$!
for _ in $(seq 1 1500); do
  url=$(grep -om1 'http://127[^ ]*' "$folder/out.txt" 2>/dev/null || true)
  [ -n "$url" ] && break
  kill -0 $server || { echo "run.sh ended without serving" >&2; exit 1; }
  sleep 1
done
for _ in $(seq 1 60); do curl -fsS "$url/readyz" > /dev/null 2>&1 && break; sleep 0.5; done
curl -fsS "$url/api/v1/scene"
curl -fsS "$url/" | grep -qi '<!doctype html>'
echo "served at $url"
pkill -TERM -f 'build/release/bin/spectra serve --web /spectra' || true
wait $server || true
