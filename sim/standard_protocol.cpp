#include "sim/standard_protocol.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>

#include "base/error.h"
#include "base/random.h"

namespace sixpoint::sim {

namespace {

constexpr std::uint64_t kProtocolStream = 0x70726F74;
constexpr std::uint64_t kExtensionStream = 0x65787465;
constexpr double kRoom_c = 23;
constexpr double kFullTurn_rad = 2 * std::numbers::pi;

// Rows of the sensor's frame: which axis of it points up, the others in cyclic order.
std::vector<Eigen::Matrix3d> faces() {
  std::vector<Eigen::Matrix3d> list(6);
  list[0] << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  list[1] << 0, 1, 0, 0, 0, 1, 1, 0, 0;
  list[2] << 1, 0, 0, 0, 1, 0, 0, 0, 1;
  list[3] << 0, 0, -1, 1, 0, 0, 0, -1, 0;
  list[4] << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  list[5] << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  return list;
}

class Drawing {
 public:
  Drawing(std::uint64_t seed, double rate_hz) : random_(seed, kProtocolStream), rate_hz_(rate_hz) {
    at_s_ = random_.uniform(30, 41);
  }
  // Goes on after the last of these.
  Drawing(std::vector<ProtocolSegment> segments, std::uint64_t seed, double rate_hz)
      : random_(seed, kExtensionStream), rate_hz_(rate_hz), segments_(std::move(segments)) {
    if (!segments_.empty()) {
      const ProtocolSegment& last = segments_.back();
      at_s_ = last.host_start_s + static_cast<double>(last.samples) / rate_hz;
    }
  }

  void add(std::string name, SegmentKind kind, const Eigen::Matrix3d& rotation, double duration_s,
           std::array<double, 2> commanded_c = {kRoom_c, kRoom_c}) {
    ProtocolSegment segment;
    segment.name = std::move(name);
    segment.kind = kind;
    segment.first_sample =
        segments_.empty() ? 0 : segments_.back().first_sample + segments_.back().samples;
    segment.samples = static_cast<std::uint64_t>(std::llround(duration_s * rate_hz_));
    segment.host_start_s = std::round(at_s_ * 1e4) / 1e4;
    segment.rotation = rotation;
    segment.commanded_c = commanded_c;
    segments_.push_back(std::move(segment));
    at_s_ += duration_s;
  }
  void pause(double from_s, double to_s) { at_s_ += random_.uniform(from_s, to_s); }

  void poses(const std::string& name, const std::vector<Eigen::Matrix3d>& list, double from_s,
             double to_s) {
    for (const Eigen::Matrix3d& rotation : list) {
      if (!segments_.empty()) {
        pause(from_s, to_s);
      }
      add(name, SegmentKind::still, rotation, 10);
    }
  }

  std::vector<Eigen::Matrix3d> shuffled(std::vector<Eigen::Matrix3d> list) {
    for (std::size_t i = list.size(); i > 1; --i) {
      std::swap(list[i - 1], list[static_cast<std::size_t>(random_.below(i))]);
    }
    return list;
  }

  void production() {
    std::vector<Eigen::Matrix3d> order = shuffled(faces());
    poses("faces", order, 4, 8);
    std::reverse(order.begin(), order.end());
    poses("faces_reversed", order, 4, 8);
    poses("reseat", shuffled(order), 15, 25);
  }

  // The six poses of the segment `faces`, last first; of none, the standard order.
  std::vector<Eigen::Matrix3d> reversed() const {
    std::vector<Eigen::Matrix3d> order;
    for (const ProtocolSegment& segment : segments_) {
      if (segment.name == "faces" && order.size() < faces().size()) {
        order.push_back(segment.rotation);
      }
    }
    order = order.empty() ? faces() : order;
    std::reverse(order.begin(), order.end());
    return order;
  }

  void yaws() {
    std::vector<Eigen::Matrix3d> list;
    for (const Eigen::Matrix3d& face : faces()) {
      for (int quarter = 0; quarter < 4; ++quarter) {
        Eigen::Matrix3d turn;
        const double c = std::array{1, 0, -1, 0}[static_cast<std::size_t>(quarter)];
        const double s = std::array{0, 1, 0, -1}[static_cast<std::size_t>(quarter)];
        turn << c, -s, 0, s, c, 0, 0, 0, 1;
        list.emplace_back(face * turn);
      }
    }
    poses("yaw", shuffled(list), 4, 8);
  }

  // Three faces once more, turned by half a turn about the vertical.
  void half_turn() {
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    turn(0, 0) = turn(1, 1) = -1;
    std::vector<Eigen::Matrix3d> list;
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      list.emplace_back(faces()[axis] * turn);
    }
    poses("half_turn", list, 4, 8);
  }

  void obliques() {
    constexpr int kPoses = 18;
    std::vector<Eigen::Matrix3d> list;
    for (int i = 0; i < kPoses; ++i) {  // even over the sphere: a Fibonacci lattice
      const double z = 1 - (2.0 * i + 1) / kPoses;
      const double longitude = i * std::numbers::pi * (3 - std::sqrt(5.0));
      const Eigen::Vector3d up(std::sqrt(1 - z * z) * std::cos(longitude),
                               std::sqrt(1 - z * z) * std::sin(longitude), z);
      const Eigen::AngleAxisd yaw(random_.uniform(0, kFullTurn_rad), Eigen::Vector3d::UnitZ());
      list.emplace_back(
          Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), up).toRotationMatrix() *
          yaw.toRotationMatrix());
    }
    poses("oblique", shuffled(list), 4, 8);
  }

  void tone(const std::string& name, const Eigen::Matrix3d& rotation, double frequency_hz,
            double amplitude_g, double duration_s) {
    add(name, SegmentKind::vibration, rotation, duration_s);
    segments_.back().vibration = Tone{Eigen::Vector3d::UnitZ(), frequency_hz, amplitude_g,
                                      random_.uniform(0, kFullTurn_rad)};
  }

  void shakers() {
    constexpr double kStroke_m = 0.01;  // of a small electrodynamic shaker, peak
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      pause(60, 95);
      bool first = true;
      for (const double frequency_hz : {2.0, 4.0, 7.0, 11.0, 16.0, 22.0, 30.0, 40.0}) {
        const double omega = kFullTurn_rad * frequency_hz;
        const double reach_g = kStroke_m * omega * omega / kStandardGravity_m_per_s2;
        at_s_ += first ? 0 : 3;
        first = false;
        tone("shaker", faces()[axis], frequency_hz, std::min(1.0, std::round(reach_g * 1e4) / 1e4),
             10);
      }
    }
  }

  void high_shakers() {
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      pause(60, 95);
      tone("shaker_high", faces()[axis], 20, 6, 10);
      at_s_ += 3;
      tone("shaker_high", faces()[axis], 19.3, 11, 5);
    }
  }

  void still() {
    at_s_ += 120;
    add("still", SegmentKind::still, Eigen::Matrix3d::Identity(), 1200);
  }

  struct Step {
    double duration_s;
    double from_c;
    double to_c;
  };
  void ramp(const char* name, const std::vector<Step>& steps) {
    for (const Step& step : steps) {
      add(name, SegmentKind::ramp, Eigen::Matrix3d::Identity(), step.duration_s,
          {step.from_c, step.to_c});
    }
  }
  void ramp_up() {
    pause(1500, 1900);
    ramp("ramp_up",
         {{120, 15, 15}, {240, 15, 27.5}, {90, 27.5, 27.5}, {480, 27.5, 40}, {90, 40, 40}});
  }

  void soaks() {
    for (const double soak_c : {12.0, 40.0}) {
      pause(1750, 2400);
      bool first = true;
      for (const Eigen::Matrix3d& rotation : shuffled(faces())) {
        if (!first) {
          pause(4, 8);
        }
        first = false;
        add("soak", SegmentKind::soak, rotation, 30, {soak_c, soak_c});
      }
    }
  }

  void engineering() {
    production();
    yaws();
    obliques();
    shakers();
    high_shakers();
    still();
    ramp_up();
    ramp("ramp_down", {{240, 40, 27.5}, {90, 27.5, 27.5}, {480, 27.5, 15}, {210, 15, 15}});
    soaks();
  }

  bool segment(std::string_view name) {
    const std::map<std::string_view, std::function<void()>> kinds = {
        {"faces", [&] { poses("faces", shuffled(faces()), 4, 8); }},
        {"faces_reversed", [&] { poses("faces_reversed", reversed(), 4, 8); }},
        {"reseat", [&] { poses("reseat", shuffled(faces()), 15, 25); }},
        {"half_turn", [&] { half_turn(); }},
        {"yaw", [&] { yaws(); }},
        {"oblique", [&] { obliques(); }},
        {"shaker", [&] { shakers(); }},
        {"shaker_high", [&] { high_shakers(); }},
        {"still", [&] { still(); }},
        {"ramp_up", [&] { ramp_up(); }},
        {"soak", [&] { soaks(); }}};
    const auto found = kinds.find(name);
    if (found != kinds.end()) {
      found->second();
    }
    return found != kinds.end();
  }

  std::vector<ProtocolSegment> segments() && { return std::move(segments_); }

 private:
  Random random_;
  double rate_hz_;
  double at_s_ = 0;
  std::vector<ProtocolSegment> segments_;
};

}  // namespace

std::string_view to_string(StandardProtocol protocol) {
  constexpr std::array<std::string_view, 3> kNames = {"production", "production+", "engineering"};
  return kNames[static_cast<std::size_t>(protocol)];
}

std::optional<StandardProtocol> parse_standard_protocol(std::string_view name) {
  for (const auto protocol : {StandardProtocol::production, StandardProtocol::production_plus,
                              StandardProtocol::engineering}) {
    if (to_string(protocol) == name) {
      return protocol;
    }
  }
  return std::nullopt;
}

std::vector<ProtocolSegment> draw_protocol(StandardProtocol protocol, std::uint64_t seed,
                                           double rate_hz) {
  Drawing drawing(seed, rate_hz);
  switch (protocol) {
    case StandardProtocol::production:
      drawing.production();
      break;
    case StandardProtocol::production_plus:
      drawing.production();
      drawing.half_turn();
      break;
    case StandardProtocol::engineering:
      drawing.engineering();
      break;
  }
  return std::move(drawing).segments();
}

Status extend_run(ProtocolRun& run, std::string_view segment, std::uint64_t seed) {
  Drawing drawing(run.segments, seed, run.rate_hz);
  if (!drawing.segment(segment)) {
    return fail(ErrorCode::usage, "there is no such segment", printable(segment, 40),
                "one of faces, faces_reversed, reseat, half_turn, yaw, oblique, shaker, "
                "shaker_high, still, ramp_up and soak");
  }
  run.segments = std::move(drawing).segments();
  run.temperature = unit_temperature(run.segments, run.rate_hz);
  return {};
}

std::vector<TemperaturePoint> unit_temperature(const std::vector<ProtocolSegment>& segments,
                                               double rate_hz) {
  constexpr double kMove_s = 300;
  constexpr double kLag_s = 60;
  constexpr double kMost_s = 30 * 86'400.0;
  std::vector<TemperaturePoint> points;
  if (segments.empty()) {
    return points;
  }
  const auto end_of = [&](const ProtocolSegment& segment) {
    return segment.host_start_s + static_cast<double>(segment.samples) / rate_hz;
  };
  std::size_t next = 0;  // the first segment that has not ended
  double left_s = 0;     // when the one before ended
  double left_c = segments.front().commanded_c[0];
  double unit_c = left_c;
  const double last_s = std::min(kMost_s, end_of(segments.back()) + 1);
  const auto seconds = static_cast<std::size_t>(std::max(0.0, last_s));
  for (std::size_t second = 0; second < seconds; ++second) {
    const double time_s = static_cast<double>(second) + 0.5;
    while (next < segments.size() && end_of(segments[next]) <= time_s) {
      left_s = end_of(segments[next]);
      left_c = segments[next].commanded_c[1];
      ++next;
    }
    double chamber_c = left_c;
    if (next < segments.size()) {
      const ProtocolSegment& segment = segments[next];
      const double into_s = time_s - segment.host_start_s;
      const double duration_s = static_cast<double>(segment.samples) / rate_hz;
      const double part =
          into_s >= 0 ? into_s / duration_s : std::min(1.0, (time_s - left_s) / kMove_s);
      const double from_c = into_s >= 0 ? segment.commanded_c[0] : left_c;
      const double to_c = segment.commanded_c[into_s >= 0 ? 1 : 0];
      chamber_c = from_c + (to_c - from_c) * part;
    }
    unit_c += (chamber_c - unit_c) * (1 - std::exp(-1 / kLag_s));
    points.push_back({time_s, unit_c});
  }
  return points;
}

}  // namespace sixpoint::sim
