# The program records by a unit on a motorised jig and downloads, through fault plans.
. /guest.sh
cd /tmp
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
