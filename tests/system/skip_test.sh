#!/usr/bin/env bash
# What the USB, system, page and package suites do where their carrier is missing: 77 and a line that names the
# package; 1 where SIXPOINT_MUST_NOT_SKIP is set. Each missing piece is played: by a PATH without it,
# by an apt that finds no kernel, by a preload library that is none.
#   skip_test.sh SOURCE_FOLDER [USB_TESTS]
set -euo pipefail
system=$1/tests/system
usb_tests=${2:-}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
failures=0

# expect NAME WORDS COMMAND...: skips with these words, and fails where it must not skip.
expect() {
  local name=$1 words=$2 status
  shift 2
  status=0
  env -u SIXPOINT_MUST_NOT_SKIP "$@" >"$scratch/out" 2>&1 || status=$?
  if [ $status -ne 77 ] || ! grep -q "^SKIPPED: .*$words" "$scratch/out"; then
    echo "FAILED: without $name: ended with $status, not with 77 and '$words':"
    cat "$scratch/out"
    failures=1
  fi
  status=0
  env SIXPOINT_MUST_NOT_SKIP=1 "$@" >"$scratch/out" 2>&1 || status=$?
  if [ $status -ne 1 ]; then
    echo "FAILED: without $name and where it must not skip: ended with $status, not with 1"
    failures=1
  fi
}

# A PATH of links to everything that is in /usr/bin, but one.
mkdir "$scratch/bin"
cp -rs /usr/bin/. "$scratch/bin"
hidden_path() {
  rm -rf "$scratch/without"
  cp -rP "$scratch/bin" "$scratch/without"
  rm -f "$scratch/without/$1"
  echo "$scratch/without"
}
make_image() { echo "$system/make_image.sh" "$scratch/image" "$1" /bin/true /bin/true; }
for missing in qemu-system-x86_64:qemu-system-x86 busybox:busybox-static cpio:cpio xz:xz-utils udevadm:udev; do
  # shellcheck disable=SC2046
  expect "${missing%%:*}" "install the Debian package ${missing#*:}" \
    env PATH="$(hidden_path "${missing%%:*}")" $(make_image "$1")
done

# No kernel to be had: apt that knows of none.
if command -v qemu-system-x86_64 busybox cpio udevadm xz >/dev/null; then
  path=$(hidden_path apt-get)
  rm -f "$path/apt-cache"
  for tool in apt-get apt-cache; do
    printf '#!/bin/sh\necho "E: no network" >&2\nexit 100\n' >"$path/$tool"
    chmod +x "$path/$tool"
  done
  # shellcheck disable=SC2046
  expect "a kernel package" "the kernel package cannot be downloaded" env PATH="$path" $(make_image "$1")
fi
expect "an image" "system.Image says why" "$system/run_in_qemu.sh" "$scratch/nothing" "$system/kernel.sh"

if [ -n "$usb_tests" ]; then
  mkdir "$scratch/library"
  : >"$scratch/library/libumockdev-preload.so.0"
  expect "umockdev's preload library" "install the Debian package umockdev" \
    env -u LD_PRELOAD LD_LIBRARY_PATH="$scratch/library" "$usb_tests" --gtest_filter='*OpensBySerial'
  env LD_LIBRARY_PATH="$scratch/library" "$usb_tests" --gtest_list_tests >"$scratch/out" ||
    { echo "FAILED: without it ctest cannot list the tests"; failures=1; }
fi
expect "tmux" "tmux is not installed" env PATH="$(hidden_path tmux)" "$1/tests/page/terminal.sh" /bin/true
expect "node" "node and npm are not installed" env PATH="$(hidden_path node)" "$1/tests/page/run.sh" whole /bin/true "$scratch"
expect "dpkg-shlibdeps" "the package needs dpkg-shlibdeps" env PATH="$(hidden_path dpkg-shlibdeps)" \
  "$1/tests/package/make.sh" /bin/true "$scratch" "$1" "$scratch/packages"
for test in deb install; do
  expect "packages" "there are no packages" "$1/tests/package/$test.sh" "$scratch/none" "$scratch" "$1"
done
expect "anything" "no carrier; install one" "$1/tests/skip.sh" "no carrier; install one"
exit $failures
