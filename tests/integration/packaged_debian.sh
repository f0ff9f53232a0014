#!/bin/bash
# Installs the Debian package into a Debian 12 root made by debootstrap, without compiler or Node.js, and walks through its life: serve as a
# user of its own, upgrade, rollback, remove, purge. Prints what it saw.
#   packaged_debian.sh PACKAGE.deb NEWER.deb [FOLDER]   needs root and debootstrap; FOLDER (default: a new one) is kept
# deploy/package.sh makes both: `deploy/package.sh OUT` and `deploy/package.sh OUT 0.1.1`.
# Host certificates and apt sources are handed in, so that a machine behind its own package mirror can run it.
set -euo pipefail
[ $# -ge 2 ] || { echo "usage: $0 PACKAGE.deb NEWER.deb [FOLDER]" >&2; exit 2; }
package=$(realpath "$1") newer=$(realpath "$2")
folder=${3:-$(mktemp -d /var/tmp/spectra-packaged-XXXX)}
root=$folder/root
mkdir -p "$folder"
user=61184  # one that systemd would make up (DynamicUser)
say() { printf '%s\n' "$*"; }
expect() { local what=$1; shift; "$@" && say "ok: $what" || { say "WRONG: $what"; exit 1; }; }

[ -e "$root/etc/debian_version" ] || debootstrap --variant=minbase bookworm "$root" > "$folder/debootstrap.txt"
cp /etc/resolv.conf "$root/etc/resolv.conf"
if [ -e /etc/ssl/certs/ca-certificates.crt ]; then
  install -D /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/ca-certificates.crt"
fi
for mount in proc sys dev; do
  mountpoint -q "$root/$mount" || mount --rbind "/$mount" "$root/$mount"
  mount --make-rslave "$root/$mount"
done
server=
finish() {
  [ -z "$server" ] || kill -TERM "$server" 2>/dev/null || true
  for mount in dev sys proc; do umount -lR "$root/$mount" 2>/dev/null || true; done
}
trap finish EXIT
trap 'exit 130' INT TERM
bare() { env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive chroot "$root" "$@"; }
version() { bare dpkg-query -W -f '${Version}' spectra; }
has() { bare sh -c "command -v $1" > /dev/null; }

# The command line of the unit, as a user of its own. Sets `server` and `url`; prints how long it took.
serve() {
  bare install -d -m 0700 -o $user -g $user /var/lib/spectra
  bare /usr/lib/spectra/hand-over
  local begin=$(date +%s.%N)
  # As BindReadOnlyPaths= of the unit does it.
  env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 unshare -m sh -c \
    'root=$1; shift; mount --bind "$root/run/spectra" "$root/etc/spectra/private" && exec chroot "$root" "$@"' sh "$root" setpriv --reuid=$user --regid=$user --clear-groups --no-new-privs \
    /usr/bin/spectra serve --config /etc/spectra/spectra.toml "$@" > "$folder/out.txt" 2> "$folder/err.txt" &
  server=$!
  url=
  for _ in $(seq 1 200); do
    url=$(grep -om1 'http[s]*://127[^ ]*' "$folder/out.txt" || true)
    [ -z "$url" ] || ! curl -fsSk "$url/readyz" > /dev/null 2>&1 || break
    kill -0 $server 2>/dev/null || { cat "$folder/err.txt"; say "WRONG: it ended"; exit 1; }
    sleep 0.05
  done
  say "serving $url after $(echo "$(date +%s.%N) - $begin" | bc -l | cut -c1-5 | sed 's/^\./0./') s as user $(ps -o uid= -p $server | tr -d ' ')"
}
stop() { kill -TERM $server; wait $server && say "ok: it ended with 0"; server=; }

bare apt-get update -qq
# What an earlier run left in a folder that is used again.
bare apt-get purge -y -qq spectra > /dev/null 2>&1 || true
rm -rf "$root/var/lib/spectra" "$root/run/spectra" "$root/etc/spectra"
begin=$(date +%s)
cp "$package" "$root/root/old.deb"
cp "$newer" "$root/root/new.deb"
bare apt-get install -y -qq --no-install-recommends /root/old.deb > "$folder/install.txt" 2>&1 || { tail -5 "$folder/install.txt"; exit 1; }
say "installed $(version) and what it needs in $(($(date +%s) - begin)) s: $(du -sh "$root/usr" | cut -f1) in /usr"
for tool in g++ cc node npm cmake; do has $tool && { say "WRONG: there is $tool"; exit 1; }; done
say "ok: no compiler, CMake or Node.js there"
expect "the configuration listens on loopback" grep -q '^listen = "127.0.0.1:' "$root/etc/spectra/spectra.toml"
expect "the folder of secrets is root's alone" test "$(stat -c '%a %u' "$root/etc/spectra/private")" = "700 0"
expect "the unit is enabled" test -L "$root/etc/systemd/system/multi-user.target.wants/spectra.service"
expect "the program is not linked with what is not there" bash -c "! chroot '$root' ldd /usr/bin/spectra | grep -q 'not found'"

serve --listen 127.0.0.1:0
expect "the page comes" bash -c "curl -fsS '$url/' | grep -qi '<!doctype html>'"
expect "notices of third parties come" bash -c "curl -fsS '$url/licences.txt' | grep -q 'In the client: three'"
printf 'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float temperature\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 20\n1 0 0 21\n0 1 0 22\n3 0 1 2\n' > "$folder/block.ply"
expect "a block is put" curl -fsS -o /dev/null -T "$folder/block.ply" "$url/api/v1/blocks/first"
expect "the map is the service's" test "$(stat -c '%u' "$root/var/lib/spectra/map.store")" = $user
stop

bare spectra token --file /etc/spectra/private/tokens --role operator > "$folder/token.txt" 2> /dev/null
bare spectra certificate /etc/spectra/private/certificate.pem /etc/spectra/private/certificate.key --name 127.0.0.1 > /dev/null 2>&1
sed -i -E 's/^#(tokens|certificate|key) =/\1 =/; s/^(# a change of the owner)$/\1/' "$root/etc/spectra/spectra.toml"
serve --listen 0.0.0.0:0
expect "it is encrypted" test "${url%%:*}" = https
expect "without a token nothing" test "$(curl -sk -o /dev/null -w '%{http_code}' "$url/api/v1/scene")" = 401
token=$(grep -om1 'spectra_[A-Za-z0-9_-]*' "$folder/token.txt")
expect "with the token the map that was kept" bash -c "curl -fsSk -H 'Authorization: Bearer $token' '$url/api/v1/scene' | grep -q '\"vertex_count\":3'"
stop

bare apt-get install -y -qq /root/new.deb > "$folder/upgrade.txt" 2>&1
say "upgraded to $(version)"
expect "the changed configuration stayed" grep -q '^tokens = ' "$root/etc/spectra/spectra.toml"
serve --listen 127.0.0.1:0
expect "the map stayed" bash -c "curl -fsSk -H 'Authorization: Bearer $token' '$url/api/v1/scene' | grep -q '\"vertex_count\":3'"
stop

bare apt-get install -y -qq --allow-downgrades /root/old.deb > "$folder/rollback.txt" 2>&1
say "rolled back to $(version)"
serve --listen 127.0.0.1:0
expect "the map stayed" bash -c "curl -fsSk -H 'Authorization: Bearer $token' '$url/api/v1/scene' | grep -q '\"vertex_count\":3'"
stop

bare apt-get remove -y -qq spectra > "$folder/remove.txt" 2>&1
expect "removed: the program is gone" test ! -e "$root/usr/bin/spectra"
expect "removed: configuration, secrets and map stayed" test -e "$root/etc/spectra/spectra.toml" -a -e "$root/etc/spectra/private/tokens" -a -e "$root/var/lib/spectra/map.store"
bare apt-get purge -y -qq spectra > "$folder/purge.txt" 2>&1
expect "purged: configuration and secrets are gone" test ! -e "$root/etc/spectra"
expect "purged: the map stayed, and that is said" bash -c "test -e '$root/var/lib/spectra/map.store' && grep -q 'keeps the map' '$folder/purge.txt'"
expect "purged: nothing of the unit is left" test -z "$(find "$root/etc/systemd" "$root/var/lib/systemd" -name '*spectra*')"
say "all as it should be"
