# What the scripts that run inside the virtual machine share (". /guest.sh").

# wait_for COMMAND...: until it succeeds. A minute, because the machine that plays this one may be busy.
wait_for() {
  for i in $(seq 600); do
    "$@" 2>/dev/null && return
    sleep 0.1
  done
  echo "FAILED: a minute is over, and still not: $*"
  return 1
}
attach() {
  usbip attach -r 127.0.0.1 -b "$1"
}
nothing_attached() {
  ! ls /sys/bus/usb/devices | grep '^1-[1-9]'
}
has_disk() {
  ls /sys/bus/usb/devices/"$1"/host*/target*/*/block/*
}

# with_faults EXIT WORDS PLAN ARGUMENTS...: offers a unit and a motorised jig with the plan
# (docs/faults.md), attaches them, runs the program, expects its exit code and what it says. A unit
# that its plan takes off the bus is attached again. The unit's time passes at $pace.
plug_in_again() {
  while [ -e /sys/bus/usb/devices/1-1 ]; do sleep 0.1; done
  wait_for attach 1-1
}
with_faults() {
  expected=$1 words=$2 status=0
  echo "== at $(cut -d ' ' -f 1 /proc/uptime) s: $*"
  echo "{\"schema\": \"sixpoint/faults/1\", \"faults\": [$3]}" >F.json
  shift 3
  sixpoint virtual --device "virtual:seed=7,serial=MOS2A45130007,pace=$pace" --jig --faults F.json >offered 2>hints &
  server=$!
  wait_for grep -q listening offered
  # The kernel may still be putting the units of the test before away: "open vhci_driver" is refused then.
  wait_for attach 1-1
  wait_for attach 1-2
  wait_for [ -e /dev/hidraw1 ]
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
  wait_for nothing_attached
}
