// The standard protocols of a calibration station, as an operator and a jig would run one.
//
//   const auto segments = draw_protocol(StandardProtocol::production, 7);  // 100 Hz
//   const auto temperature = unit_temperature(segments, 100);
//
// production: six faces, the same in reverse order, and six placements after the unit was taken
// off; 10 s each, three minutes. production+: that, and three faces once more with the unit
// turned by half a turn about the vertical; 48 s more. engineering: that, and yaws, oblique poses,
// the shaker, twenty still minutes, temperature ramps and soaks; 75 minutes of recording in about
// three hours.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "sim/protocol_run.h"

namespace sixpoint::sim {

enum class StandardProtocol { production, production_plus, engineering };
std::string_view to_string(StandardProtocol protocol);
std::optional<StandardProtocol> parse_standard_protocol(std::string_view name);

// Order of the poses, pauses between them and phases of the tones are drawn from the seed.
std::vector<ProtocolSegment> draw_protocol(StandardProtocol protocol, std::uint64_t seed,
                                           double rate_hz = 100);

// Goes on after the last segment of the run with one more, by its name, as a station would: one of
// the engineering protocol, or `half_turn`, three faces turned by half a turn about the vertical.
// The temperature becomes that of the whole run. usage for another name.
Status extend_run(ProtocolRun& run, std::string_view segment, std::uint64_t seed);

// The temperature of the unit, one point a second from power-on to the end of the last segment: the
// chamber does what the segments command, goes from one to the next in five minutes, and the unit
// follows with a lag of one minute. No noise.
std::vector<TemperaturePoint> unit_temperature(const std::vector<ProtocolSegment>& segments,
                                               double rate_hz);

}  // namespace sixpoint::sim
