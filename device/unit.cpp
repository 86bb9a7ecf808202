#include "device/unit.h"

#include <fmt/format.h>

namespace sixpoint::device {

tl::unexpected<Error> Unit::cannot(const char* what) const {
  return fail(ErrorCode::usage, fmt::format("this unit {}", what), address(),
              abilities().offers_recordings
                  ? "calibrate it by a file: 'sixpoint capture --device ADDRESS'"
                  : "docs/devices lists what it can do");
}

Result<CalibrationPage> Unit::read_calibration() { return cannot("shows no constants"); }
Status Unit::write_calibration(const CalibrationPage& /*page*/) {
  return cannot("takes no constants");
}
Result<FilterState> Unit::filter() { return cannot("says nothing of its filter"); }
Status Unit::set_filter(FilterConfiguration /*filter*/) { return cannot("takes no filter"); }
Status Unit::start_stream(int /*rate_hz*/) { return cannot("sends no live samples"); }
Result<std::optional<SampleBlock>> Unit::next_samples(std::chrono::nanoseconds /*time_out*/) {
  return cannot("sends no live samples");
}
Status Unit::stop_stream() { return cannot("sends no live samples"); }
const StreamStatistics& Unit::stream_statistics() const {
  static const StreamStatistics kNothing;
  return kNothing;
}
Result<std::uint16_t> Unit::start_recording(int /*rate_hz*/, UtcTime /*now*/) {
  return cannot("records without being told");
}
Result<std::uint16_t> Unit::stop_recording() { return cannot("records without being told"); }
Result<std::vector<RecordingInfo>> Unit::recordings() { return cannot("offers no recordings"); }
Status Unit::download(const RecordingInfo& /*recording*/, FileSystem& /*files*/,
                      const std::string& /*path*/,
                      const std::function<void(std::uint64_t)>& /*progress*/) {
  return cannot("offers no recordings");
}

}  // namespace sixpoint::device
