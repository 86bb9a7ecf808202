// The streams of one run: a unit that is plugged in again begins a new one, and the run's numbers
// go on.
//
//   UnitStream stream(calib::FilterConfiguration::current, 100);
//   SIXPOINT_CHECK(stream.start(unit));
//   const bool whole = !stream.lost_since_asked(unit);  // nothing was lost yet
//   SIXPOINT_CHECK(stream.stop(unit));
//   stream.statistics(&unit).samples;  // of all streams of the run
//
// The unit is not owned. One object belongs to one thread.
#pragma once

#include "calib/constants.h"
#include "device/unit.h"

namespace sixpoint::station {

class UnitStream {
 public:
  // `before`: of the run's streams in an earlier program.
  UnitStream(calib::FilterConfiguration filter, int rate_hz, device::StreamStatistics before = {});

  // Begins a stream of `unit` under the run's filter. A program that was killed leaves its unit
  // streaming, and such a unit takes no other filter: it is stopped first.
  Status start(device::Unit& unit);
  // Where a stream ends, its numbers go to the run's. Without a stream nothing is counted.
  void count(const device::Unit& unit);
  // Counts, then stops the unit.
  Status stop(device::Unit& unit);

  // Whether this stream lost samples, or its clock jumped, since this was asked before. A reading
  // does not go across either.
  bool lost_since_asked(const device::Unit& unit);
  // Of the whole run; `unit` may be null where there is none any more. Lost samples are judged by
  // these numbers:
  //
  // | the run so far                         | its numbers                                       |
  // |----------------------------------------|---------------------------------------------------|
  // | one stream                             | those of the stream                               |
  // | plugged in again, or after a write     | the sums over its streams, and the one under way  |
  // | continued after a restart of the       | likewise: `before` holds those of the earlier     |
  // | program                                | program                                           |
  // | no sample came yet                     | 0 samples: the share of lost ones is no number    |
  device::StreamStatistics statistics(const device::Unit* unit) const;

 private:
  calib::FilterConfiguration filter_;
  int rate_hz_;
  bool is_streaming_ = false;
  // Of this stream, already reported.
  std::uint64_t lost_ = 0;
  std::uint64_t clock_jumps_ = 0;
  device::StreamStatistics before_;  // of the run's earlier streams
};

}  // namespace sixpoint::station
