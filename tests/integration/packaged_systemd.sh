#!/bin/bash
# Starts the package's service under a real systemd: a Debian 12 made by debootstrap in an emulated machine without a network. Serving as its own user,
# tokens and certificate handed over, a reload that takes a token back, kill -9, a wrong config, stop, purge. Prints what it saw.
#   packaged_systemd.sh PACKAGE.deb [FOLDER]   needs root, debootstrap, qemu-system-x86 and mke2fs; FOLDER (default: a new one) is kept
set -euo pipefail
[ $# -ge 1 ] || { echo "usage: $0 PACKAGE.deb [FOLDER]" >&2; exit 2; }
package=$(realpath "$1")
folder=${2:-$(mktemp -d /var/tmp/spectra-systemd-XXXX)}
root=$folder/root
mkdir -p "$folder"
bare() { env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive chroot "$root" "$@"; }

[ -e "$root/etc/debian_version" ] || debootstrap --variant=minbase bookworm "$root" > "$folder/debootstrap.txt"
cp /etc/resolv.conf "$root/etc/resolv.conf"
[ ! -e /etc/ssl/certs/ca-certificates.crt ] || install -D /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/ca-certificates.crt"
{
  bare apt-get update -qq
  bare apt-get purge -y -qq spectra || true
  rm -rf "$root/var/lib/spectra" "$root/var/lib/private/spectra" "$root/etc/spectra"
  bare apt-get install -y -qq --no-install-recommends systemd systemd-sysv dbus iproute2 libnss-systemd curl linux-image-cloud-amd64 initramfs-tools
  cp "$package" "$root/root/spectra.deb"
  bare apt-get install -y -qq --no-install-recommends /root/spectra.deb
} > "$folder/apt.txt" 2>&1 || { tail -5 "$folder/apt.txt"; exit 1; }

cat > "$root/root/check.sh" <<'GUEST'
#!/bin/bash
say() { echo "CHECK $*"; }
expect() { local what=$1; shift; if "$@"; then say "ok: $what"; else say "WRONG: $what"; fi; }
ready() { for _ in $(seq 1 300); do curl -fsSk "$url/readyz" > /dev/null 2>&1 && return; sleep 0.2; done; return 1; }
shows() { systemctl show -p "$1" --value spectra; }
status() { curl -sk -o /dev/null -w '%{http_code}' "${@:2}" "$url$1"; }
ip link set lo up
url=http://127.0.0.1:8080
expect "it serves after booting" ready
expect "at the first try" test "$(shows NRestarts)" = 0
owner=$(stat -c %u "/proc/$(shows MainPID)")
say "user $owner, which /etc/passwd does not have: $(grep -c "$owner" /etc/passwd)"
printf 'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float temperature\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 20\n1 0 0 21\n0 1 0 22\n3 0 1 2\n' > /root/block.ply
expect "a block is put" test "$(status /api/v1/blocks/first -T /root/block.ply)" = 200
expect "the map is its user's" test "$(stat -c %u /var/lib/private/spectra/map.store)" = "$owner"
expect "doctor: all is well" spectra doctor --config /etc/spectra/spectra.toml

cd /etc/spectra/private || exit
spectra token --file tokens --role operator --name a > /root/token 2> /dev/null
spectra token --file tokens --role viewer --name b > /dev/null 2>&1
spectra certificate certificate.pem certificate.key --name 127.0.0.1 > /dev/null 2>&1
sed -i -E 's/^#(tokens|certificate|key) =/\1 =/; s/^listen = .*/listen = "0.0.0.0:8080"/' /etc/spectra/spectra.toml
expect "the config for others is good" spectra check-config /etc/spectra/spectra.toml
systemctl restart spectra
url=https://127.0.0.1:8080
expect "it serves encrypted" ready
token="Authorization: Bearer $(grep -om1 'spectra_[A-Za-z0-9_-]*' /root/token)"
expect "without a token 401, with it 200" test "$(status /api/v1/scene) $(status /api/v1/scene -H "$token")" = "401 200"
expect "the map of before" bash -c "curl -sk -H '$token' $url/api/v1/scene | grep -q '\"vertex_count\":3'"
expect "the secrets are still root's, the copies its user's" test "$(stat -c %u tokens) $(stat -c '%u %a' /run/spectra/tokens)" = "0 $owner 400"
spectra token --file tokens --remove a > /dev/null 2>&1
expect "reload" systemctl reload spectra
sleep 1
expect "a token that was taken back is worth nothing" test "$(status /api/v1/scene -H "$token")" = 401

kill -9 "$(shows MainPID)"
sleep 4
expect "it comes back after kill -9" ready
sed -i 's/^live = /lve = /' /etc/spectra/spectra.toml
systemctl restart spectra
sleep 5
expect "a wrong config is not tried again" test "$(systemctl is-active spectra) $(shows NRestarts)" = "failed 0"
expect "the journal says the line" bash -c "journalctl -u spectra -o cat | grep -q 'spectra.toml, line .*lve'"
sed -i 's/^lve = /live = /' /etc/spectra/spectra.toml
systemctl restart spectra
expect "it serves again" ready
begin=$(date +%s%N)
systemctl stop spectra
say "stopped in $((($(date +%s%N) - begin) / 1000000)) ms: $(shows Result)"
expect "the copies of secrets are gone" test ! -e /run/spectra
say "$(systemd-analyze security --no-pager spectra | tail -1)"
DEBIAN_FRONTEND=noninteractive apt-get purge -y -qq spectra > /dev/null 2>&1
expect "purged: the map stays, the secrets go" test -e /var/lib/private/spectra/map.store -a ! -e /etc/spectra
say end
poweroff -f
GUEST
chmod +x "$root/root/check.sh"
cat > "$root/etc/systemd/system/check.service" <<'EOS'
[Unit]
After=spectra.service
[Service]
Type=oneshot
ExecStart=/root/check.sh
StandardOutput=journal+console
StandardError=journal+console
EOS
ln -sf ../check.service "$root/etc/systemd/system/multi-user.target.wants/check.service"
ln -sf /dev/null "$root/etc/systemd/system/serial-getty@ttyS0.service"
: > "$root/etc/fstab"

rm -f "$folder/disk.img"
mke2fs -q -t ext4 -d "$root" "$folder/disk.img" 2G > /dev/null
timeout 600 qemu-system-x86_64 -M q35 -m 1024 -cpu max -nographic -no-reboot -net none \
  -kernel "$root"/boot/vmlinuz-* -initrd "$root"/boot/initrd.img-* \
  -append "console=ttyS0 root=/dev/vda rw quiet systemd.show_status=0" \
  -drive "file=$folder/disk.img,format=raw,if=virtio,cache=unsafe" < /dev/null > "$folder/console.txt" 2>&1 || true
rm -f "$folder/disk.img"
sed -n 's/.*CHECK //p' "$folder/console.txt" | tr -d '\r'
grep -q 'CHECK end' "$folder/console.txt" && ! grep -q 'CHECK WRONG' "$folder/console.txt" || { echo "not as it should be: $folder/console.txt" >&2; exit 1; }
