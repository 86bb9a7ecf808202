# The program and Debian's usbip tool, as a person would use them.
cd /tmp
sixpoint virtual --count 2 --device virtual:seed=7,serial=MOS2A45130007 >offered 2>hints &
server=$!
for i in $(seq 100); do grep -q listening offered && break; sleep 0.1; done
cat offered hints
usbip list -r 127.0.0.1 2>/dev/null | tee listed
[ "$(grep -c '1209:0001' listed)" -eq 2 ]

echo "== attach both"
usbip attach -r 127.0.0.1 -b 1-1
usbip attach -r 127.0.0.1 -b 1-2
for i in $(seq 100); do [ -e /dev/hidraw1 ] && [ -e /dev/sdb ] && break; sleep 0.1; done
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
for i in $(seq 100); do [ -e /sys/bus/usb/devices/1-1 ] || break; sleep 0.1; done
[ ! -e /sys/bus/usb/devices/1-1 ]
for i in $(seq 100); do usbip attach -r 127.0.0.1 -b 1-1 2>/dev/null && break; sleep 0.1; done
for i in $(seq 100); do [ -e /sys/bus/usb/devices/1-1/serial ] && break; sleep 0.1; done
[ "$(cat /sys/bus/usb/devices/1-1/serial)" = MOS2A45130007 ]

echo "== the program ends and takes its units along"
kill -TERM $server
wait $server
for i in $(seq 100); do ls /sys/bus/usb/devices | grep -q '^1-[1-9]' || break; sleep 0.1; done
! ls /sys/bus/usb/devices | grep '^1-[1-9]'

echo "== a unit that is files alone: found, mounted, calibrated from its mount point"
sixpoint virtual --device virtual:seed=7,serial=MOS2A45130008,interfaces=storage >offered2 2>hints &
server=$!
for i in $(seq 100); do grep -q listening offered2 && break; sleep 0.1; done
usbip attach -r 127.0.0.1 -b 1-1
for i in $(seq 100); do ls /sys/bus/usb/devices/1-1:1.0/host*/target*/*/block/* >/dev/null 2>&1 && break; sleep 0.1; done
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
for i in $(seq 100); do [ -e /sys/bus/usb/devices/1-1 ] || break; sleep 0.1; done
status=0; sixpoint capture --device "drive:/mnt/my unit" -o gone.gt3x --store bench.db || status=$?
[ $status -ne 0 ]
[ ! -e gone.gt3x ]
kill -TERM $server
wait $server

echo "== the installed program, a unit and a motorised jig, through fault plans (docs/faults.md)"
# with_faults EXIT WORDS PLAN ARGUMENTS...: offers both with the plan, attaches them, runs the
# program, expects its exit code and what it says. A unit that its plan takes off the bus is
# attached again. The unit's time passes at $pace.
pace=4
plug_in_again() {
  for i in $(seq 1000); do [ -e /sys/bus/usb/devices/1-1 ] || break; sleep 0.1; done
  for i in $(seq 100); do usbip attach -r 127.0.0.1 -b 1-1 2>/dev/null && break; sleep 0.1; done
}
with_faults() {
  expected=$1 words=$2 status=0
  echo "== at $(cut -d ' ' -f 1 /proc/uptime) s: $*"
  echo "{\"schema\": \"sixpoint/faults/1\", \"faults\": [$3]}" >F.json
  shift 3
  sixpoint virtual --device "virtual:seed=7,serial=MOS2A45130007,pace=$pace" --jig --faults F.json >offered3 2>hints &
  server=$!
  for i in $(seq 100); do grep -q listening offered3 && break; sleep 0.1; done
  usbip attach -r 127.0.0.1 -b 1-1
  usbip attach -r 127.0.0.1 -b 1-2
  for i in $(seq 100); do [ -e /dev/hidraw1 ] && break; sleep 0.1; done
  udevadm settle --timeout=10
  plug_in_again &
  cable=$!
  sixpoint "$@" --json >answer 2>said || status=$?
  kill $cable 2>/dev/null || true
  cat said
  [ $status -eq "$expected" ] || { echo "FAILED: ended with $status, not with $expected"; cat answer; return 1; }
  cat said answer | grep -q "$words" || { echo "FAILED: no word of: $words"; cat answer; return 1; }
  kill -TERM $server
  wait $server
  for i in $(seq 100); do ls /sys/bus/usb/devices | grep -q '^1-[1-9]' || break; sleep 0.1; done
}
run="jig --device hid:MOS2A45130007 --jig hid:J600001 --store bench.db --dwell 0.5 --filter current"
with_faults 74 'charge the unit' '{"fault": "battery_low", "at_s": 0}' $run --write
with_faults 1 'y axis is stuck' '{"fault": "axis_stuck", "of": "samples", "at_report": 20, "axis": "y"}' $run
with_faults 69 'does not answer' '{"fault": "lost", "of": "replies", "at_report": 4, "count": 0}' $run
[ "$(sixpoint history MOS2A45130007 --store bench.db --json | grep -c '"method"')" -eq 0 ]
with_faults 0 '"verdict": "pass"' '{"fault": "bad_page", "at_s": 0},
  {"fault": "stall", "of": "replies", "at_report": 3}, {"fault": "bad_crc", "of": "replies", "at_report": 6},
  {"fault": "duplicate", "at_report": 2, "every": 3}, {"fault": "garbage", "of": "samples", "at_report": 70},
  {"fault": "bit_flip", "of": "samples", "at_report": 150, "bit": 6},
  {"fault": "wrong_sequence", "of": "samples", "at_report": 310}' $run --write
grep -q 'were unreadable' answer said
with_faults 0 'it is back' '{"fault": "power_loss", "at_s": 1, "bytes": 300, "seconds": 1},
  {"fault": "lost", "of": "replies", "at_report": 5}' $run --write
echo "== captures"
pace=40
run="capture --device hid:MOS2A45130007 --jig hid:J600001 --store bench.db --side-seconds 1 --turn-seconds 0.4"
with_faults 74 'storage full' '{"fault": "full_flash", "at_s": 0}' $run -o full.gt3x
[ ! -e full.gt3x ]
with_faults 0 '"verified": true' '{"fault": "stall", "channel": "bulk", "at_report": 1},
  {"fault": "bit_flip", "channel": "bulk", "at_report": 2}, {"fault": "short_packet", "channel": "bulk", "at_report": 4, "bytes": 100},
  {"fault": "lost", "channel": "bulk", "at_report": 5}, {"fault": "garbage", "channel": "bulk", "at_report": 7},
  {"fault": "bad_crc", "of": "replies", "at_report": 3}, {"fault": "duplicate", "channel": "bulk", "at_report": 9},
  {"fault": "wrong_sequence", "of": "replies", "at_report": 5}' $run -o poor.gt3x
sixpoint solve poor.gt3x
with_faults 0 'the unit came back' '{"fault": "unplug", "channel": "bulk", "at_report": 2, "seconds": 30}' $run -o away.gt3x
