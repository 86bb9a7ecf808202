# The program calibrates a unit on a motorised jig, through fault plans.
. /guest.sh
cd /tmp
pace=10
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
