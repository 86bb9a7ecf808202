# The program and Debian's usbip tool, as a person would use them.
. /guest.sh
cd /tmp
sixpoint virtual --count 2 --device virtual:seed=7,serial=MOS2A45130007 >offered 2>hints &
server=$!
wait_for grep -q listening offered
cat offered hints
usbip list -r 127.0.0.1 2>/dev/null | tee listed
[ "$(grep -c '1209:0001' listed)" -eq 2 ]

echo "== attach both"
attach 1-1
attach 1-2
wait_for [ -e /dev/hidraw1 ]
wait_for [ -e /dev/sdb ]
ls /dev/hidraw0 /dev/hidraw1
grep -l MOS2A45130007 /sys/bus/usb/devices/*/serial

echo "== the volume"
disk=/dev/$(basename "$(ls -d /sys/bus/usb/devices/1-1:1.2/host*/target*/*/block/*)")
mount -t vfat -o ro "$disk" /mnt
ls -l /mnt
grep -q 'Serial Number: MOS2A45130007' /mnt/info.txt
[ -s /mnt/log.bin ]
umount /mnt

echo "== detach and attach again"
usbip detach -p 0
wait_for [ ! -e /sys/bus/usb/devices/1-1 ]
wait_for attach 1-1
wait_for [ -e /sys/bus/usb/devices/1-1/serial ]
[ "$(cat /sys/bus/usb/devices/1-1/serial)" = MOS2A45130007 ]

echo "== the program ends and takes its units along"
kill -TERM $server
wait $server
wait_for nothing_attached

echo "== a unit that is files alone: found, mounted, calibrated from its mount point"
sixpoint virtual --device virtual:seed=7,serial=MOS2A45130008,interfaces=storage >offered2 2>hints &
server=$!
wait_for grep -q listening offered2
wait_for attach 1-1
wait_for has_disk 1-1:1.0
udevadm settle --timeout=10
[ "$(cat /sys/bus/usb/devices/1-1/bNumInterfaces)" -eq 1 ]
sixpoint devices | tee found
grep -q '^MOS2A45130008 .*file-monitor .*not mounted' found
disk=/dev/$(basename "$(ls -d /sys/bus/usb/devices/1-1:1.0/host*/target*/*/block/*)")
mkdir -p "/mnt/my unit"
mount -t vfat -o ro "$disk" "/mnt/my unit"
sixpoint devices | tee found
grep -q '^drive:/mnt/my unit .*file-monitor .*ready' found
sixpoint capture --device "drive:/mnt/my unit" -o copy.gt3x --constants-out C.json --store bench.db
sixpoint solve copy.gt3x
grep -q MOS2A45130008 C.json
status=0; sixpoint jig --device "drive:/mnt/my unit" --store bench.db || status=$?
[ $status -eq 64 ]
echo "== pulled out while it is mounted"
usbip detach -p 0
wait_for [ ! -e /sys/bus/usb/devices/1-1 ]
status=0; sixpoint capture --device "drive:/mnt/my unit" -o gone.gt3x --store bench.db || status=$?
[ $status -ne 0 ]
[ ! -e gone.gt3x ]
kill -TERM $server
wait $server
