#!/usr/bin/env bash
# The Debian packages installed by dpkg: used by an ordinary user and as the service, upgraded over an older
# version, removed without trace. The machine is not touched: all of it happens in a copy of its root that is
# made by overlayfs and seen by this test alone.
#   install.sh PACKAGES_FOLDER BUILD_FOLDER SOURCE_FOLDER
# A machine that lets nobody mount (a container without rights) skips it, also in CI: no package helps there.
set -euo pipefail
cannot_mount() { echo "SKIPPED, NOT PASSED: $1; dpkg was not tried"; exit 77; }
if [ "${1:-}" != --inside ]; then
  scratch=$(mktemp -d)
  trap 'rm -rf "$scratch"' EXIT
  compgen -G "$1/*.deb" >/dev/null || { "$3/tests/skip.sh" "there are no packages (make.sh)"; exit $?; }
  mkdir "$scratch/made"
  cp "$1"/*.deb "$scratch/made"
  unshare --mount --propagation private true 2>/dev/null || cannot_mount "no namespace of mounts for this user"
  unshare --mount --propagation private "$0" --inside "$scratch" "$3"
  exit
fi

scratch=$2 source_folder=$3
failures=0
failed() { echo "FAILED: $*"; failures=1; }
mkdir "$scratch/up" "$scratch/work" "$scratch/root"
mount -t overlay overlay -o "lowerdir=/,upperdir=$scratch/up,workdir=$scratch/work" "$scratch/root" 2>/dev/null ||
  cannot_mount "no overlayfs here"
root=$scratch/root
for folder in proc dev; do mount --rbind "/$folder" "$root/$folder"; done
for folder in run tmp; do mount -t tmpfs tmpfs "$root/$folder"; done
inside=(chroot "$root" /usr/bin/env -i PATH=/run/tools:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8)
# What the packages tell systemd, which does not run in there.
mkdir -p "$root/run/systemd/system" "$root/run/tools"
printf '#!/bin/sh\necho "$*" >>/run/told\n' >"$root/run/tools/systemctl"
chmod 755 "$root/run/tools/systemctl"
rm -f "$root/usr/sbin/policy-rc.d" # a container's: no service may be started
told() { # told STEP LINE...: these lines, in their order, and no others
  local step=$1
  shift
  printf '%s\n' "$@" | diff - "$root/run/told" || failed "$step told systemd something else"
  rm -f "$root/run/told"
}
reload="--system daemon-reload" service=sixpoint-station.service
# What is installed anywhere but in the state of dpkg itself, its log and the caches that it rebuilds.
files() {
  (cd "$scratch/up" && find . ! -type d ! -path './var/lib/dpkg/*' ! -path './var/log/*' ! -path './var/cache/*' \
    ! -path './home/*' ! -path './etc/ld.so.cache' ! -path './srv/*' | sort)
}

# The version before: the same packages under an older number.
mkdir "$root/srv/new" "$root/srv/old"
cp "$scratch"/made/*.deb "$root/srv/new/"
version=$(dpkg-deb -f "$scratch"/made/sixpoint_*.deb Version)
for package in "$scratch"/made/*.deb; do
  dpkg-deb -R "$package" "$scratch/unpacked"
  sed -i "s/^Version: .*/Version: 0.0.1/; s/(= $version)/(= 0.0.1)/" "$scratch/unpacked/DEBIAN/control"
  dpkg-deb --root-owner-group -b "$scratch/unpacked" "$root/srv/old/$(basename "$package")" >/dev/null
  rm -rf "$scratch/unpacked"
done
install() {
  local log
  log=$("${inside[@]}" dpkg --force-confold -i "$@" 2>&1) || { failed "dpkg -i: $log"; return 1; }
}
"${inside[@]}" useradd --create-home person
files >"$scratch/before"
install $(find "$root/srv/old" -name '*.deb' -printf '/srv/old/%f\n') || exit 1
told "the installation" "$reload"
mkdir -p "$root/etc/systemd/system/multi-user.target.wants"
ln -s "/lib/systemd/system/$service" "$root/etc/systemd/system/multi-user.target.wants/$service" # 'systemctl enable'

# An ordinary user's main job, from there.
as_person() { "${inside[@]}" setpriv --reuid=person --regid=person --clear-groups env HOME=/home/person sixpoint "$@"; }
cp "$source_folder/tests/docs/scenario.json" "$root/home/person/"
chown -R --reference="$root/home/person" "$root/home/person"
as_person simulate --scenario /home/person/scenario.json -o /home/person/day.gt3x >/dev/null || failed "simulate"
as_person solve /home/person/day.gt3x --save >/dev/null 2>&1 || failed "solve --save"
as_person repair /home/person/day.gt3x -o /home/person/repaired --store /home/person/.local/share/sixpoint/store.db \
  >/dev/null 2>&1 || failed "repair"
[ -f "$root/home/person/repaired/day.gt3x" ] || failed "no repaired file"
repairs() { as_person history MOS2A45130007 --json | python3 -c 'import json, sys; print(len(json.load(sys.stdin)["repairs"]))'; }
[ "$(repairs)" = 1 ] || failed "the person's store has no repair"

# The service's command line, as a user that owns nothing but its state.
unit=$root/lib/systemd/system/sixpoint-station.service
serve() {
  # shellcheck source=/dev/null
  source "$root/etc/default/sixpoint-station"
  local command station port
  : >"$scratch/station"  # here, not by the service as it starts: the loop below could read what the last one wrote
  command=$(sed -n 's/^ExecStart=//p' "$unit" | sed 's#%S#/var/lib#g')
  command=${command/\$SIXPOINT_STATION_OPTIONS/${SIXPOINT_STATION_OPTIONS/--port 6020/--port 0}}
  mkdir -p "$root/var/lib/sixpoint"
  chown 64000:64000 "$root/var/lib/sixpoint"
  # shellcheck disable=SC2086  # word splitting as systemd does it
  "${inside[@]}" setpriv --reuid=64000 --regid=64000 --clear-groups --no-new-privs --inh-caps=-all env XDG_DATA_HOME=/var/lib \
    XDG_CACHE_HOME=/var/cache HOME=/ $command >>"$scratch/station" 2>&1 &
  station=$!
  for _ in $(seq 100); do
    grep -q 'http://127.0.0.1:' "$scratch/station" && break
    sleep 0.1
  done
  port=$(grep -oE 'http://127.0.0.1:[0-9]+' "$scratch/station" | sed -n '1s/.*://p' || true)
  if [ -n "$port" ] && exec 3<>"/dev/tcp/127.0.0.1/$port"; then
    printf 'GET / HTTP/1.1\r\nHost: 127.0.0.1:%s\r\nConnection: close\r\n\r\n' "$port" >&3
    head -n 1 <&3 | grep '200 OK' >/dev/null || failed "the page is not served"
    exec 3>&-
  else
    failed "the service does not start: $(cat "$scratch/station")"
  fi
  kill -TERM "$station"
  wait "$station" || failed "the service ended with $?"
}
# All that a station has recorded.
recorded() { (cd "$root/var/lib/sixpoint" && find . -type f -exec sha256sum {} + | sort); }
serve
[ "$(stat -c %u "$root/var/lib/sixpoint/store.db" 2>/dev/null)" = 64000 ] || failed "the service made no store of its own"

# The new version: what the user changed stays, and so do the stores.
recorded >"$scratch/recorded"
sed -i 's/seed=7/seed=8/' "$root/etc/default/sixpoint-station"
install $(find "$root/srv/new" -name '*.deb' -printf '/srv/new/%f\n') || exit 1
told "the upgrade" "$reload" "try-restart $service"
[ "$(as_person --version)" = "sixpoint $version" ] || failed "the new version does not run"
grep -q seed=8 "$root/etc/default/sixpoint-station" || failed "the upgrade took the user's configuration away"
[ "$(repairs)" = 1 ] || failed "the upgrade lost the person's store"
recorded | diff "$scratch/recorded" - || failed "the upgrade changed the station's records"
serve
recorded >"$scratch/recorded"

# Removed: nothing is left but what people and stations recorded.
log=$("${inside[@]}" dpkg --purge libsixpoint-mocks-dev libsixpoint-dev sixpoint-station sixpoint 2>&1) || failed "purge: $log"
told "the removal" "stop $service" "$reload"
files | comm -13 "$scratch/before" - | grep -v '^./var/lib/sixpoint/' >"$scratch/left" || true
[ ! -s "$scratch/left" ] || failed "left behind: $(cat "$scratch/left")"
[ -f "$root/var/lib/sixpoint/store.db" ] && recorded | diff "$scratch/recorded" - ||
  failed "the station's records went with the package"
[ "$failures" -eq 0 ] && echo "$version installed, used, upgraded over 0.0.1, and removed"
exit "$failures"
