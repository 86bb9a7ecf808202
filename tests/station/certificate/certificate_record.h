// The record of a run of a virtual unit, as the store gives it back; for the tests of certificates.
#pragma once

#include <nlohmann/json.hpp>

#include "db/store.h"
#include "station/virtual_bench.h"

namespace sixpoint::station {

// A run as the store would give it back, of a virtual unit.
inline db::RunRecord record_of(std::uint64_t seed, const JigSessionOptions& options,
                               const sim::GivenProperties& given = {}) {
  const auto report = VirtualBench(seed, given).run(options);
  db::RunRecord run;
  run.id = "0123456789abcdef0123456789abcdef";
  run.serial = report->serial;
  run.kind = "jig";
  run.filter = calib::to_string(report->filter);
  run.started = report->started;
  run.ended = report->ended;
  run.operator_name = "Ada Lovelace";
  run.station = "Bench 3";
  run.jig = "J-0042";
  run.jig_due = *parse_iso8601("2027-03-31");
  run.verdict = to_string(report->verdict);
  run.software = "sixpoint 9.9.9";
  run.document = report->to_json().dump();
  run.codes = report->codes;
  return run;
}

inline JigSessionOptions writing() {
  JigSessionOptions options;
  options.run.write = true;
  options.gravity = *calib::gravity_at(52.1, 40);
  return options;
}

}  // namespace sixpoint::station
