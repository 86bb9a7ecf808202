#!/usr/bin/env bash
# The Debian packages (make.sh) as their users get them: unpacked into a scratch root, and looked at.
#   deb.sh PACKAGES_FOLDER BUILD_FOLDER SOURCE_FOLDER
set -euo pipefail
packages=$1 build_folder=$2 source_folder=$3
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
failures=0
failed() { echo "FAILED: $*"; failures=1; }
# A tool that CI has; elsewhere its part of the test says that it says nothing.
have() {
  command -v "$1" >/dev/null && return
  [ -z "${SIXPOINT_MUST_NOT_SKIP:-}" ] || { failed "$1 is missing"; return 1; }
  echo "SKIPPED, NOT PASSED: $2 needs $1"
  return 1
}
compgen -G "$packages/*.deb" >/dev/null || { "$source_folder/tests/skip.sh" "there are no packages (make.sh)"; exit $?; }
root=$scratch/root
for name in sixpoint sixpoint-station libsixpoint-dev libsixpoint-mocks-dev; do
  made=$(echo "$packages/${name}"_*.deb)
  [ -f "$made" ] || { echo "FAILED: cpack made no $name"; exit 1; }
  [ "$(stat -c %s "$made")" -lt 12000000 ] || failed "$name is larger than 12 MB"
  dpkg-deb -x "$made" "$root"
  dpkg-deb -e "$made" "$root/DEBIAN.$name"
  if (cd "$root" && md5sum --quiet -c "DEBIAN.$name/md5sums"); then :; else failed "md5sums of $name do not fit"; fi
  [ -f "$root/usr/share/doc/$name/copyright" ] || failed "$name has no copyright"
done
package=$(echo "$packages"/sixpoint_*.deb)

# What it needs: every library that the program or a part of it loads belongs to a package that it names.
parts=("$root"/usr/lib/sixpoint/libsixpoint-*.so)
[ ${#parts[@]} -eq 3 ] || failed "not three parts: ${parts[*]}"
depends=$(dpkg-deb -f "$package" Depends)
known=$(ldconfig -p)
for library in $(objdump -p "$root/usr/bin/sixpoint" "${parts[@]}" | awk '/NEEDED/ { print $2 }' | sort -u); do
  case $library in ld-linux* | libm.so* | libc.so*) continue ;; esac
  path=$(awk -v name="$library" '$1 == name && !seen { print $NF; seen = 1 }' <<<"$known")
  owner=$(dpkg -S "$(readlink -f "$path")" "$path" 2>/dev/null | sed -n '1s/:.*//p' || true)
  grep -qw -- "$owner" <<<"$depends" || failed "$library is in $owner, which Depends does not name: $depends"
done
# The list of what it is made of names each of these libraries' packages, and no package twice.
pieces=$(python3 -c 'import json, sys; [print(c["name"]) for c in json.load(open(sys.argv[1]))["components"]]' \
  "$root/usr/share/doc/sixpoint/sbom.cdx.json") || failed "sbom.cdx.json is no list of parts"
[ -z "$(sort <<<"$pieces" | uniq -d)" ] || failed "sbom.cdx.json names a part twice"
for owner in $(tr ',' '\n' <<<"$depends" | sed 's/ *\([a-z0-9.+-]*\).*/\1/'); do
  # A name that a package provides stands for that package.
  provider=$(dpkg-query -W -f='${Package} ${Provides}\n' | awk -v name="$owner" '{ for (i = 2; i <= NF; ++i) if ($i == name || $i == name ",") print $1 }')
  owner=${provider:-$owner}
  [ "$owner" = fonts-dejavu-core ] || grep -qx -- "$owner" <<<"$pieces" || failed "sbom.cdx.json lacks $owner"
done
for piece in nlohmann-json3-dev libeigen3-dev preact uplot; do
  grep -qx "$piece" <<<"$pieces" || failed "sbom.cdx.json lacks $piece"
done

for file in usr/bin/sixpoint lib/udev/rules.d/60-sixpoint-detect.rules \
  lib/udev/rules.d/70-sixpoint-access.rules lib/systemd/system/sixpoint-station.service \
  etc/default/sixpoint-station usr/share/man/man1/sixpoint.1.gz \
  usr/share/bash-completion/completions/sixpoint usr/include/sixpoint/gt3x/recording.h \
  usr/include/sixpoint/mocks/in_process/in_process.h; do
  [ -f "$root/$file" ] || failed "no $file in the package"
done
grep -qx /etc/default/sixpoint-station "$root/DEBIAN.sixpoint-station/conffiles" || failed "no conffile"
if grep -rIlF -e "$build_folder" -e "$source_folder" "$root" || grep -qF "$source_folder" "$root/usr/bin/sixpoint"; then
  failed "the package names the folders it was built in"
fi
# Libraries for work that few commands do are loaded by the parts alone: they were most of the program's start.
needed=$(LD_LIBRARY_PATH='' ldd "$root/usr/bin/sixpoint")
for library in libpq libpqxx libcairo libpango librsvg; do
  grep -q "$library" <<<"$needed" && failed "$library is loaded with every command"
done

# The program from there.
program=$root/usr/bin/sixpoint
version=$(dpkg-deb -f "$package" Version)
[ "$("$program" --version)" = "sixpoint $version" ] || failed "another version than the package's"
export HOME=$scratch/home
mkdir -p "$HOME" "$scratch/archive"
"$program" simulate --scenario "$source_folder/tests/docs/scenario.json" \
  -o "$scratch/archive/day.gt3x" >/dev/null 2>&1 || failed "simulate ended with $?"
status=0
"$program" scan "$scratch/archive" >/dev/null 2>&1 || status=$?
[ "$status" -eq 1 ] || failed "scan ended with $status, not with 1"
"$program" repair "$scratch/archive" -o "$scratch/repaired" --scan >/dev/null 2>&1 ||
  failed "repair ended with $?"
# Its parts: found beside it; and without one, the message names it and says what to do.
nobody=postgresql://nobody@127.0.0.1:1/none
said() { "$program" history MOS2A00000001 --store "$nobody" 2>&1 || echo "ended with $?"; }
words=$(said)
grep -q 'ended with 69' <<<"$words" || failed "no server is there: $words"
mkdir "$scratch/elsewhere"
mv "$root"/usr/lib/sixpoint/libsixpoint-postgres-* "$scratch/elsewhere"
words=$(said)
grep -q 'ended with 73' <<<"$words" && grep -q 'libsixpoint-postgres.*install the whole package again' <<<"$words" ||
  failed "the part is not there: $words"
mv "$scratch"/elsewhere/* "$root/usr/lib/sixpoint"

# Every command has its section of the manual page, and its options; and the shell offers it.
page=$(gunzip -c "$root/usr/share/man/man1/sixpoint.1.gz" | sed 's/\\-/-/g; s/\\f[BIR]//g')
# shellcheck source=/dev/null
source "$root/usr/share/bash-completion/completions/sixpoint"
offered() { # offered WORD...: COMPREPLY is what Tab gives after these words, the last one half-typed
  COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
  _sixpoint
}
# The shell compares by itself: there are two thousand words to try.
offers() { # offers WORD WORD...: the first word is among what Tab gives after the others
  local wanted=$1
  shift
  offered "$@"
  [[ " ${COMPREPLY[*]} " == *" $wanted "* ]] || failed "the shell does not offer $wanted after ${*:1:$#-1}"
}
commands_of() { "$program" "$@" --help | awk '/^Subcommands:/ { inside = 1; next } /^$/ { inside = 0 } inside && /^  [a-z]/ { print $1 }'; }
options_of() { "$program" "$@" --help | grep -oE '^  (-[a-z],)?--[a-z0-9-]+' | grep -oE -- '--[a-z0-9-]+$'; }
checked=0
check_command() {
  local section sub option
  section=$(awk -v head=".SS sixpoint $*" '$0 == head { inside = 1; next } /^\.S[SH]/ { inside = 0 } inside' <<<"$page")
  [ -n "$section" ] || failed "the manual page has no section 'sixpoint $*'"
  for option in $(options_of "$@"); do
    offers "$option" sixpoint "$@" "$option"
    [ "$option" = --help ] || [[ $section == *"$option"* ]] || failed "the manual page's section $* lacks $option"
  done
  checked=$((checked + 1))
  for sub in $(commands_of "$@"); do
    offers "$sub" sixpoint "$@" "${sub:0:2}"
    check_command "$@" "$sub"
  done
}
for command in $(commands_of); do
  offers "$command" sixpoint "${command:0:1}"
  check_command "$command"
done
[ "$checked" -gt 40 ] || failed "only $checked commands were looked at"
offered sixpoint repair archive
[ ${#COMPREPLY[@]} -eq 0 ] || failed "a folder's name was taken for a command"
if have groff "the manual page's form"; then
  words=$(gunzip -c "$root/usr/share/man/man1/sixpoint.1.gz" | groff -man -Tascii -ww -z 2>&1) || failed "groff: $words"
  [ -z "$words" ] || failed "groff: $words"
fi

# The service: its unit is well formed and shut in (install.sh runs it).
unit=$root/lib/systemd/system/sixpoint-station.service
if have systemd-analyze "the unit's form"; then
  sed "s#/usr/bin/sixpoint#$program#" "$unit" >"$scratch/sixpoint-station.service"
  words=$(systemd-analyze verify --man=no "$scratch/sixpoint-station.service" 2>&1) || failed "systemd-analyze: $words"
  [ -z "$words" ] || failed "systemd-analyze: $words"
  # 2.0 of 10; OK begins below 5.
  words=$(systemd-analyze security --offline=true --threshold=20 "$scratch/sixpoint-station.service" 2>&1) ||
    failed "the unit is exposed more than 2.0: $(tail -n 1 <<<"$words")"
fi
if have lintian "the package's form"; then
  errors=$(lintian --allow-root --fail-on error "$packages"/*.deb 2>&1) || failed "lintian: $errors"
fi
[ "$failures" -eq 0 ] && echo "the packages of $version are sound; $checked commands"
exit "$failures"
