#!/usr/bin/env bash
# Boots the image of make_image.sh under TCG and runs one script as root inside, with guest.sh
# beside it; its exit code is this one's.
#   run_in_qemu.sh FOLDER SCRIPT
set -euo pipefail
folder=$1
script=$2

if [ ! -e "$folder/root.cpio" ]; then
  exec "$(dirname "$0")/../skip.sh" "there is no image in $folder; system.Image says why"
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/root"
cp "$script" "$work/root/run.sh"
cp "$(dirname "$0")/guest.sh" "$work/root/guest.sh"
# A second archive behind the first: the kernel unpacks both.
(cat "$folder/root.cpio" && cd "$work/root" && find . -mindepth 1 | cpio --quiet -o -H newc) >"$work/initrd"

# Always TCG: /dev/kvm may exist and hang. The guest's time is its own: 2 ns for each instruction, and no waiting where
# nothing is to be done. So a busy machine makes the test longer and no reply inside late.
timeout 1140 qemu-system-x86_64 -machine q35,usb=off -accel tcg -cpu max -m 512 -nodefaults -nographic \
  -icount shift=1,sleep=off -rtc clock=vm \
  -no-reboot -serial stdio -kernel "$folder/vmlinux" -initrd "$work/initrd" \
  -append "console=ttyS0 quiet panic=-1 rdinit=/init" </dev/null | tr -d '\r' | tee "$work/log"
status=$(sed -n 's/^SIXPOINT-GUEST-EXIT \([0-9]*\)$/\1/p' "$work/log")
if [ -z "$status" ]; then
  echo "the virtual machine did not come to its end" >&2
  exit 70
fi
exit "$status"
