#include "station/run/unit_stream.h"

#include <utility>

namespace sixpoint::station {

namespace {

device::StreamStatistics sum_of(device::StreamStatistics sum, const device::StreamStatistics& of) {
  device::for_each_count([&](const char*, auto member) { sum.*member += of.*member; });
  return sum;
}

Status choose_filter(device::Unit& unit, calib::FilterConfiguration filter) {
  Status chosen = unit.set_filter(filter);
  if (chosen || chosen.error().code != ErrorCode::io) {
    return chosen;
  }
  SIXPOINT_CHECK(unit.stop_stream());
  return unit.set_filter(filter);
}

}  // namespace

UnitStream::UnitStream(calib::FilterConfiguration filter, int rate_hz,
                       device::StreamStatistics before)
    : filter_(filter), rate_hz_(rate_hz), before_(before) {}

Status UnitStream::start(device::Unit& unit) {
  count(unit);
  SIXPOINT_CHECK(choose_filter(unit, filter_));
  SIXPOINT_CHECK(unit.start_stream(rate_hz_));
  is_streaming_ = true;
  lost_ = 0;  // a new stream counts from 0
  clock_jumps_ = 0;
  return {};
}

void UnitStream::count(const device::Unit& unit) {
  before_ = statistics(&unit);
  is_streaming_ = false;
}

Status UnitStream::stop(device::Unit& unit) {
  count(unit);
  return unit.stop_stream();
}

bool UnitStream::lost_since_asked(const device::Unit& unit) {
  const device::StreamStatistics& now = unit.stream_statistics();
  const bool lost = now.lost_samples > std::exchange(lost_, now.lost_samples);
  const bool jumped = now.clock_jumps > std::exchange(clock_jumps_, now.clock_jumps);
  return lost || jumped;
}

device::StreamStatistics UnitStream::statistics(const device::Unit* unit) const {
  return is_streaming_ && unit != nullptr ? sum_of(before_, unit->stream_statistics()) : before_;
}

}  // namespace sixpoint::station
