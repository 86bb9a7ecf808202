#!/usr/bin/env bash
# Makes what run_in_qemu.sh boots: Debian's kernel, unpacked and never installed, and a root file
# system in memory with busybox, udev, usbip, the program and the guest's tests.
#   make_image.sh FOLDER SOURCE_FOLDER SIXPOINT GUEST_TESTS
# Exit code 77, and a line that says what is missing, where it cannot be made (tests/skip.sh).
set -euo pipefail
folder=$1
source_folder=$2
sixpoint=$3
guest_tests=$4
PATH=$PATH:/usr/sbin:/sbin

# skip.sh's exit code is this one's.
skip() {
  exec "$source_folder/tests/skip.sh" "$@"
}
need() {
  command -v "$1" >/dev/null || skip "$1 is missing; install the Debian package $2"
}
need qemu-system-x86_64 qemu-system-x86
need busybox busybox-static
need cpio cpio
need depmod kmod
need udevadm udev
need usbip usbip
need xz xz-utils
ldd "$(command -v busybox)" >/dev/null 2>&1 && skip "busybox needs libraries; install busybox-static"

mkdir -p "$folder"
cd "$folder"

# The kernel: what linux-image-amd64 depends on today.
kernel_package() {
  apt-cache depends linux-image-amd64 2>/dev/null | awk '/Depends: linux-image-[0-9]/ && !seen { print $2; seen = 1 }'
}
if [ ! -e kernel/complete ]; then
  rm -rf kernel
  mkdir kernel
  download() {
    local package
    package=$(kernel_package)
    [ -n "$package" ] && (cd kernel && apt-get -qq download "$package")
  }
  if ! download 2>kernel/log; then
    [ "$(id -u)" -eq 0 ] && apt-get -qq -o DPkg::Lock::Timeout=300 update >>kernel/log 2>&1 || true
    download 2>>kernel/log ||
      skip "the kernel package cannot be downloaded: $(tail -n 1 kernel/log)"
  fi
  dpkg-deb --fsys-tarfile kernel/*.deb | tar -x -C kernel --wildcards \
    './boot/vmlinuz-*' './lib/modules/*/modules.*' './lib/modules/*/kernel/drivers/usb/*' \
    './lib/modules/*/kernel/drivers/hid/*' './lib/modules/*/kernel/drivers/scsi/*' \
    './lib/modules/*/kernel/fs/fat/*' './lib/modules/*/kernel/fs/nls/*' \
    './lib/modules/*/kernel/lib/*' './lib/modules/*/kernel/crypto/*' \
    './lib/modules/*/kernel/block/*' './lib/modules/*/kernel/arch/*'
  rm kernel/*.deb
  # vmlinuz holds an xz stream behind its loader; the kernel inside boots in half the time.
  offset=$(LC_ALL=C grep -abo -m 1 $'\xFD7zXZ' kernel/boot/vmlinuz-* | cut -d: -f1 | sed -n 1p)
  tail -c "+$((offset + 1))" kernel/boot/vmlinuz-* | xz -dc >kernel/vmlinux 2>/dev/null || true
  [ "$(head -c 4 kernel/vmlinux | tail -c 3)" = ELF ] || skip "no kernel was found in vmlinuz"
  touch kernel/complete
fi
version=$(basename kernel/lib/modules/*)

root=$folder/root
rm -rf "$root"
mkdir -p "$root"/{bin,dev,etc,lib64,mnt,proc,run,sys,tmp,usr/bin,usr/sbin,var/run} "$root/lib/modules/$version"
ln -s usr/lib/udev "$root/udev-rules" # for people who inspect the image
cp "$(command -v busybox)" "$root/bin/busybox"

# Modules and what they depend on.
depmod -b kernel "$version"
for module in vhci-hcd usbhid hid-generic usb-storage sd_mod vfat nls_cp437 nls_ascii nls_iso8859-1; do
  modprobe -d kernel -S "$version" --show-depends "$module" 2>/dev/null ||
    echo "insmod missing $module" >&2
done | sed -n 's/^insmod \([^ ]*\).*/\1/p' | sort -u >modules.list
while read -r module; do
  relative=${module#*/lib/modules/}
  mkdir -p "$root/lib/modules/$(dirname "$relative")"
  cp "$module" "$root/lib/modules/$relative"
done <modules.list
cp kernel/lib/modules/"$version"/modules.{builtin,builtin.modinfo,order} "$root/lib/modules/$version/" 2>/dev/null || true
depmod -b "$root" "$version" 2>/dev/null

# Programs with their libraries, each at its own place.
copy_program() {
  local file
  mkdir -p "$root$(dirname "$2")"
  cp -L "$1" "$root$2"
  ldd "$1" | sed -n -e 's/.* => \(\/[^ ]*\).*/\1/p' -e 's/^\t\(\/[^ ]*\).*/\1/p' | while read -r file; do
    if [ ! -e "$root$file" ]; then
      mkdir -p "$root$(dirname "$file")"
      cp -L "$file" "$root$file"
    fi
  done
}
copy_program "$sixpoint" /usr/bin/sixpoint
copy_program "$guest_tests" /usr/bin/guest_tests
copy_program "$(command -v usbip)" /usr/sbin/usbip
copy_program "$(command -v udevadm)" /usr/bin/udevadm
strip "$root/usr/bin/sixpoint" "$root/usr/bin/guest_tests" 2>/dev/null || true
ln -s /usr/bin/udevadm "$root/usr/sbin/systemd-udevd"
mkdir -p "$root/lib/udev/rules.d" "$root/etc/udev/rules.d"
for rules in 50-udev-default.rules 80-drivers.rules; do
  cp "/lib/udev/rules.d/$rules" "$root/lib/udev/rules.d/"
done
cp "$source_folder"/packaging/udev/*.rules "$root/lib/udev/rules.d/"
echo 'root:x:0:0:root:/:/bin/sh' >"$root/etc/passwd"
cp /etc/group "$root/etc/group"
echo 'passwd: files
group: files
hosts: files' >"$root/etc/nsswitch.conf"
echo '127.0.0.1 localhost' >"$root/etc/hosts"

cat >"$root/init" <<'INIT'
#!/bin/busybox sh
export PATH=/bin:/usr/bin:/usr/sbin:/sbin HOME=/ SIXPOINT_GUEST=1
/bin/busybox --install -s /bin
mount -t proc proc /proc
mount -t sysfs sysfs /sys
mount -t devtmpfs devtmpfs /dev
mount -t tmpfs tmpfs /run
mount -t tmpfs tmpfs /tmp
ifconfig lo 127.0.0.1 up
systemd-udevd --daemon
for module in vhci-hcd usbhid hid-generic usb-storage sd_mod vfat nls_cp437 nls_ascii; do
  modprobe $module
done
# No test waits for the second that usb-storage gives other people's disks to settle.
echo 0 >/sys/module/usb_storage/parameters/delay_use
status=0
sh -e /run.sh || status=$?
echo "SIXPOINT-GUEST-EXIT $status"
reboot -f
INIT
chmod +x "$root/init"
(cd "$root" && find . | cpio --quiet -o -H newc) >root.cpio.new
mv root.cpio.new root.cpio
cp kernel/vmlinux vmlinux
echo "image: kernel $version, $(($(stat -c %s root.cpio) >> 20)) MiB in memory"
