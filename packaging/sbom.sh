#!/usr/bin/env bash
# The parts that the program is made of, as CycloneDX 1.4 JSON on stdout: libraries that it loads, libraries that are
# compiled in, and what the page bundles. Versions are those of this machine's packages; without a time, so
# that the same build gives the same file.
#   sbom.sh SOURCE_FOLDER VERSION PROGRAM PART...
set -euo pipefail
source_folder=$1 version=$2
shift 2

# Short names of the package's copyright file, where it has the form that machines read.
licences_of() {
  sed -n 's/^License: *\([^ ].*\)$/\1/p' "/usr/share/doc/$1/copyright" 2>/dev/null | sort -u | head -n 12
}
component() {  # component NAME VERSION PURL USE LICENCE...
  local name=$1 of=$2 purl=$3 use=$4 licence list=''
  shift 4
  for licence in "$@"; do
    list+="${list:+, }{\"license\": {\"name\": \"${licence//[\"\\]/}\"}}"
  done
  printf '%s    {"type": "library", "name": "%s", "version": "%s", "purl": "%s",\n     "licenses": [%s],\n     "properties": [{"name": "sixpoint:use", "value": "%s"}]}' \
    "$separator" "$name" "$of" "$purl" "$list" "$use"
  separator=$',\n'
}
package() {  # package NAME USE
  local of licences
  of=$(dpkg-query -W -f='${Version}' "$1") || { echo "sbom.sh: no package $1" >&2; exit 1; }
  mapfile -t licences < <(licences_of "$1")
  component "$1" "$of" "pkg:deb/debian/$1@${of//+/%2B}" "$2" "${licences[@]}"
}

printf '{"bomFormat": "CycloneDX", "specVersion": "1.4", "version": 1,\n'
printf '  "metadata": {"component": {"type": "application", "name": "sixpoint", "version": "%s"}},\n  "components": [\n' "$version"
separator=''
# A library stands in its package under /lib or under /usr/lib.
loaded=$(ldd "$@" | awk '$3 ~ /^\// { print $3 }' | xargs -n 1 readlink -f | sort -u)
owners=$(sed 's#^/usr/#/#; s#^.*#/usr&\n&#' <<<"$loaded" | xargs dpkg -S 2>/dev/null || true)
for library in $loaded; do
  grep -q -- "/${library##*/}\$" <<<"$owners" || { echo "sbom.sh: $library is in no package" >&2; exit 1; }
done
packages=$(sed 's/:.*//' <<<"$owners" | sort -u)
for name in $packages; do
  package "$name" "loaded"
done
for name in libboost-dev libcli11-dev libeigen3-dev libexpected-dev libsqlitecpp-dev libtomlplusplus-dev nlohmann-json3-dev; do
  if dpkg-query -W "$name" >/dev/null 2>&1; then
    package "$name" "compiled in"
  fi
done
for name in preact uplot; do
  of=$(grep -A1 "\"node_modules/$name\"" "$source_folder/station/web/package-lock.json" | sed -n 's/.*"version": "\(.*\)".*/\1/p')
  [ -n "$of" ] || { echo "sbom.sh: package-lock.json has no $name" >&2; exit 1; }
  component "$name" "$of" "pkg:npm/$name@$of" "bundled" MIT
done
printf '\n  ]\n}\n'
