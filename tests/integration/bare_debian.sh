#!/bin/bash
# Runs deploy/run.sh or deploy/test.sh in a Debian 12 root made by debootstrap with nothing else in it, from a clone of HEAD.
#   bare_debian.sh run|test|workstation [FOLDER]   needs root, debootstrap and git; FOLDER (default: a new one) is kept for
#                                                  a second start
# `workstation` puts libpcl-dev into the root first, as robotics people have it, runs deploy/run.sh, and then expects that no
# package is gone or older and that a program that uses PCL still compiles and runs.
# Host certificates and apt sources are handed in, so that a machine behind its own package mirror can run it.
set -euo pipefail
what=${1:?run, test or workstation}
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
if [ ! -e "$root/spectra" ]; then git clone -q "$source_root" "$root/spectra"; else git -C "$root/spectra" fetch -q "$source_root" HEAD && git -C "$root/spectra" reset -q --hard FETCH_HEAD; fi
for mount in proc sys dev dev/pts; do
  mountpoint -q "$root/$mount" || mount --rbind "/$mount" "$root/$mount"
  mount --make-rslave "$root/$mount"
done
mkdir -p "$root/dev/shm"
server=
finish() {
  # All that run.sh started: a group of its own, of which it is the leader.
  if [ -n "$server" ]; then kill -TERM -- "-$server" 2>/dev/null || true; fi
  for mount in dev/pts dev sys proc; do umount -lR "$root/$mount" 2>/dev/null || true; done
}
trap finish EXIT
trap 'exit 130' INT TERM
bare() { env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 chroot "$root" "$@"; }

if [ "$what" = test ]; then
  bare /spectra/deploy/test.sh
  exit
fi
packages() { bare dpkg-query -W -f '${db:Status-Status} ${Package}:${Architecture} ${Version}\n' | grep '^installed' | sort; }
if [ "$what" = workstation ] && [ ! -e "$folder/packages_before.txt" ]; then
  bare apt-get update -qq
  bare env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends libpcl-dev g++ > "$folder/apt.txt"
  packages > "$folder/packages_before.txt"
fi

# run.sh ends in the server itself, so this id is the server's.
set -m
(exec env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 \
  chroot "$root" /spectra/deploy/run.sh --listen 127.0.0.1:0) > "$folder/out.txt" &
server=$!
set +m
for _ in $(seq 1 5400); do
  url=$(grep -om1 'http://127[^ ]*' "$folder/out.txt" 2>/dev/null || true)
  [ -n "$url" ] && break
  kill -0 $server 2>/dev/null || { echo "run.sh ended without serving" >&2; exit 1; }
  sleep 1
done
for _ in $(seq 1 60); do curl -fsS "$url/readyz" > /dev/null 2>&1 && break; sleep 0.5; done
curl -fsS "$url/api/v1/scene"
curl -fsS "$url/" | grep -qi '<!doctype html>'
echo "served at $url"
kill -TERM "$server"
wait "$server" || true
server=

[ "$what" = workstation ] || exit 0
packages > "$folder/packages_after.txt"
harmed=0
while read -r _ name version; do
  now=$(awk -v name="$name" '$2 == name { print $3 }' "$folder/packages_after.txt")
  if [ -z "$now" ] || dpkg --compare-versions "$now" lt "$version"; then
    echo "$name $version is now ${now:-gone}" >&2
    harmed=1
  fi
done < "$folder/packages_before.txt"
mkdir -p "$root/pcl"
cat > "$root/pcl/cloud.cpp" <<'EOF'
#include <pcl/common/centroid.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include <boost/version.hpp>
#include <iostream>

int main() {
  pcl::PointCloud<pcl::PointXYZ> cloud;
  cloud.emplace_back(1.0F, 2.0F, 3.0F);
  cloud.emplace_back(3.0F, 2.0F, 1.0F);
  Eigen::Vector4f centre;
  pcl::compute3DCentroid(cloud, centre);
  std::cout << "PCL's centre " << centre.head<3>().transpose() << " with Boost " << BOOST_LIB_VERSION << '\n';
}
EOF
bare g++ -std=c++17 -I/usr/include/pcl-1.13 -I/usr/include/eigen3 -o /pcl/cloud /pcl/cloud.cpp -lpcl_common
bare /pcl/cloud
echo "$(wc -l < "$folder/packages_before.txt") packages before, $(wc -l < "$folder/packages_after.txt") after"
exit $harmed
