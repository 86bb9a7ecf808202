// The faults of a virtual unit, and when they come: a plan in JSON (docs/faults.md).
//
//   SIXPOINT_ASSIGN(const FaultPlan plan, read_fault_plan(env.files, "F.json"));
//
//     {"schema": "sixpoint/faults/1",
//      "faults": [{"fault": "unplug", "at_s": 20, "seconds": 2},
//                 {"fault": "bit_flip", "of": "samples", "at_report": 100, "every": 50}]}
//
// The plan is data; fault_injector.h carries it out between a virtual unit and its carrier, so one
// plan does the same in-process, over umockdev and over USB/IP.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/env.h"
#include "base/measure.h"

namespace sixpoint::mocks {

enum class FaultKind {
  // Of a transfer.
  stall,           // the endpoint refuses it; the data stay where they are
  delay,           // it comes `seconds` late, and all later ones wait
  short_packet,    // only its first `bytes` come
  garbage,         // random bytes of the same length
  bit_flip,        // bit `bit` of one byte is inverted
  bad_crc,         // its CRC does not fit
  duplicate,       // it comes twice
  lost,            // it does not come
  wrong_sequence,  // its sequence is another one, and the CRC fits
  // Of the unit.
  reset,          // the firmware restarts; the cable stays
  reenumerate,    // it leaves the bus and comes back at once as another node
  unplug,         // the cable is out for `seconds`; for good without
  swap,           // another unit of serial `serial` is put in its place, after `seconds`
  full_flash,     // no room for recordings; one that runs ends
  battery_low,    // `battery_mv`
  frozen_sensor,  // all axes repeat their reading
  axis_stuck,     // the axis `axis` does
  bad_page,       // the constants' own CRC does not fit
  clock_jump,     // device time and calendar jump by `seconds`, which may be negative
  power_loss,     // power fails when `bytes` more bytes are written to the page memory, and comes
                  // back `seconds` later
};
std::string_view to_string(FaultKind kind);
bool is_of_transfer(FaultKind kind);

enum class FaultChannel { reports, bulk };
enum class FaultDirection { from_unit, to_unit };
enum class FaultSubject { any, replies, samples };  // of reports from the unit

// When. Exactly one of the three counts is set. Reports (on `bulk`: blocks) count from 1 and bytes
// from 0, each from the start of the plan, and only those of the fault's channel, direction and
// subject. A transfer that holds byte N is the one.
struct FaultTime {
  std::optional<std::uint64_t> report;
  std::optional<std::uint64_t> byte;
  std::optional<double> time_s;  // since the plan's start; a transfer's: the first after it
};

struct Fault {
  FaultKind kind = FaultKind::lost;
  FaultTime at;
  FaultChannel channel = FaultChannel::reports;
  FaultDirection direction = FaultDirection::from_unit;
  FaultSubject subject = FaultSubject::any;
  std::uint64_t count = 1;             // transfers in succession; 0: all from here on
  std::optional<std::uint64_t> every;  // and again after each so many transfers
  std::optional<double> seconds;
  std::uint64_t bytes = 8;
  int bit = 0;                        // 0 to 7
  std::optional<std::uint64_t> byte;  // within the transfer, for bit_flip; else drawn
  std::size_t axis = 0;
  std::uint16_t battery_mv = 3200;
  std::string serial = "MOS2B99990001";
};

struct FaultPlan {
  std::uint64_t seed = 1;  // of all random values
  std::vector<Fault> faults;
};

// configuration on anything that docs/faults.md does not allow, with the path of the key.
Result<FaultPlan> parse_fault_plan(std::string_view json);
// Also no_input; at most 1 MiB.
Result<FaultPlan> read_fault_plan(FileSystem& files, const std::string& path);

}  // namespace sixpoint::mocks
