// The constants that tests of repairs use: of the unit of MadeRecording, as a jig would store them.
#pragma once

#include "db/records.h"

namespace sixpoint::tests {

inline constexpr const char* kConstants = R"({"serial": "MOS2A45130450", "filter": "current",
  "constants": {"sensitivity_g_per_lsb": [0.0042, 0.004, 0.0041], "zero_lsb": [90.5, 50.25, 88]}})";

inline db::ConstantsRecord jig_constants() {
  db::ConstantsRecord record;
  record.serial = "MOS2A45130450";
  record.filter = "current";
  record.method = "jig";
  record.made_at = from_unix_seconds(1'700'000'000);
  record.document = kConstants;
  return record;
}

}  // namespace sixpoint::tests
