#include "gap/recording/header_evidence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/recording/median.h"

namespace sixpoint::gap {
namespace {

// What a filter mismatch makes of the length of gravity (gap.md: 0.80 to 0.95, with some room).
constexpr double kMismatchLow = 0.75;
constexpr double kMismatchHigh = 0.97;

struct Mean {
  double sum = 0;
  double n = 0;
  double value() const { return sum / n; }
};

// The length of gravity in a segment, LSB per g. Nothing where too little of it is unclipped.
std::optional<double> length_lsb_per_g(const Bundle& bundle, const Segment& segment) {
  constexpr double kRing_s = 2;
  constexpr double kLeast = 100;             // samples: noise of 1 LSB averages to 0.1 LSB
  constexpr std::int16_t kNearLimit = 2040;  // 12 bits end at 2047
  const auto ring = static_cast<std::size_t>(kRing_s * bundle.rate_hz);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double n = 0;
  for (std::size_t i = std::min(ring, segment.samples / 2); i < segment.samples; ++i) {
    const gt3x::Counts& counts = bundle.samples[segment.first_sample + i];
    const bool clipped = std::any_of(counts.begin(), counts.end(), [](std::int16_t x) {
      return x > kNearLimit || x < -kNearLimit;
    });
    if (counts != gt3x::Counts{} && !clipped) {
      sum += Eigen::Vector3d(counts[0], counts[1], counts[2]);
      n += 1;
    }
  }
  return n < kLeast ? std::nullopt : std::optional((sum / n).norm() / bundle.gravity_g);
}

// The mean over all poses of the length at rest, in LSB per g: opposite faces cancel the offsets.
std::optional<double> measured_lsb_per_g(const Bundle& bundle) {
  std::map<std::array<long, 3>, Mean> by_pose;
  for (const Segment& segment : bundle.segments) {
    const auto length = segment.at_rest() ? length_lsb_per_g(bundle, segment) : std::nullopt;
    if (length) {
      const Eigen::Vector3d up = 4 * segment.rotation.col(2);  // poses within 15 degrees are one
      Mean& mean = by_pose[{std::lround(up[0]), std::lround(up[1]), std::lround(up[2])}];
      mean.sum += *length;
      mean.n += 1;
    }
  }
  double mean = 0;
  for (const auto& [pose, length] : by_pose) {
    mean += length.value() / static_cast<double>(by_pose.size());
  }
  return mean > 0 ? std::optional(mean) : std::nullopt;
}

// How near the data must be to one of two claims that differ by `apart` (a logarithm): well within
// half of the way, and at most as far as a unit's gain (2 % sd) and offsets (35 mg sd) reach.
double tolerance(double apart) { return std::min(0.12, 0.4 * std::abs(apart)); }

Status check_scale(const HeaderClaims::Scale& claim, std::optional<double> measured,
                   Bundle& bundle) {
  constexpr double kAlike = 0.002;  // digits that were cut
  constexpr double kHidden = 0.05;  // a unit's own gains (2 % sd) hide a smaller difference
  const double said = bundle.accel_scale_lsb_per_g;
  const double apart = std::log(claim.lsb_per_g / said);
  if (std::abs(apart) < kAlike) {
    return {};
  }
  const std::string both =
      fmt::format("protocol.json says {:g} LSB/g, the recording's {} says {:g} LSB/g", said,
                  claim.source, claim.lsb_per_g);
  if (!measured || std::abs(apart) < kHidden) {
    bundle.losses.push_back(fmt::format(
        "{}: the protocol's is used, and the samples can't say which is right: a common gain is "
        "in doubt by {:.1f} %",
        both, 100 * std::abs(std::expm1(apart))));
    return {};
  }
  const double by_protocol = *measured / said;
  const double by_header = *measured / claim.lsb_per_g;
  const auto fits = [&](double g) { return std::abs(std::log(g)) < tolerance(apart); };
  const auto mismatched = [](double g) { return g > kMismatchLow && g < kMismatchHigh; };
  const std::string lengths = fmt::format(
      "gravity at rest is {:.3f} g by the protocol's and {:.3f} "
      "g by the header's",
      by_protocol, by_header);
  if (fits(by_protocol) ||
      (!fits(by_header) && mismatched(by_protocol) && !mismatched(by_header))) {
    bundle.losses.push_back(
        fmt::format("{}; {}: the header's is set aside, headers are copied", both, lengths));
    return {};
  }
  return fail(ErrorCode::bad_data, fmt::format("{}; {}", both, lengths),
              bundle.path + "/protocol.json: accel_scale_lsb_per_g",
              fits(by_header) ? "correct the protocol's scale: the samples agree with the header"
                              : "find out the unit's scale: the samples agree with neither");
}

// Samples per second of the host's time, by the stamps within each segment; the median.
std::optional<double> stamped_rate_hz(const Bundle& bundle) {
  constexpr double kLeast_s = 0.5;
  std::vector<double> rates;
  const HostClock& clock = bundle.host_clock;
  for (const Segment& segment : bundle.segments) {
    const auto begin = std::lower_bound(clock.sample_index.begin(), clock.sample_index.end(),
                                        segment.first_sample);
    const auto end =
        std::lower_bound(begin, clock.sample_index.end(), segment.first_sample + segment.samples);
    if (end - begin < 2) {
      continue;
    }
    const auto first = static_cast<std::size_t>(begin - clock.sample_index.begin());
    const auto last = static_cast<std::size_t>(end - clock.sample_index.begin()) - 1;
    const double passed_s = clock.host_time_s[last] - clock.host_time_s[first];
    if (passed_s > kLeast_s) {
      rates.push_back(static_cast<double>(clock.sample_index[last] - clock.sample_index[first]) /
                      passed_s);
    }
  }
  return rates.empty() ? std::nullopt : std::optional(upper_median(rates));
}

Status check_rate(const HeaderClaims& claims, Bundle& bundle) {
  constexpr double kAlike_hz = 0.5;
  constexpr double kAlike = 0.025;  // a clock error and lost samples
  const double said = bundle.rate_hz;
  const auto agrees = [said](const std::optional<double>& rate_hz) {
    return rate_hz && std::abs(std::log(*rate_hz / said)) < kAlike;
  };
  const std::optional<double> stamped = stamped_rate_hz(bundle);
  const bool contradicted = claims.rate_hz && std::abs(*claims.rate_hz - said) > kAlike_hz;
  // Of two claims the nearer one: 100 and 101 Hz are no clock error, but two numbers.
  const auto nearer = [&](const std::optional<double>& rate_hz) {
    return agrees(rate_hz) &&
           (!claims.rate_hz || std::abs(*rate_hz - said) < std::abs(*rate_hz - *claims.rate_hz));
  };
  const bool confirmed = nearer(stamped) || (!stamped && nearer(claims.samples_per_record));
  const bool disproved = (stamped || claims.samples_per_record) && !agrees(stamped) &&
                         !agrees(claims.samples_per_record);
  if (!disproved && (!contradicted || confirmed)) {
    if (contradicted) {
      bundle.losses.push_back(fmt::format(
          "protocol.json says {:g} Hz, the recording's header {:g} Hz: {} bear out the "
          "protocol, the header's is set aside",
          said, *claims.rate_hz, stamped ? "the host's stamps" : "the records' lengths"));
    }
    return {};
  }
  std::string what = fmt::format("protocol.json says {:g} Hz", said);
  if (claims.rate_hz) {
    what += fmt::format(", the recording's header {:g} Hz", *claims.rate_hz);
  }
  what += stamped ? fmt::format(", the host's stamps {:.1f} Hz", *stamped) : "";
  what += claims.samples_per_record ? fmt::format(", a record of one second holds {:g} samples",
                                                  *claims.samples_per_record)
                                    : "";
  return fail(ErrorCode::bad_data, what, bundle.path + "/protocol.json: sample_rate_hz",
              "correct the protocol's rate, or take the recording that belongs to it");
}

}  // namespace

Status check_header(const HeaderClaims& claims, Bundle& bundle) {
  SIXPOINT_CHECK(check_rate(claims, bundle));
  const std::optional<double> measured = measured_lsb_per_g(bundle);
  for (const HeaderClaims::Scale& claim : claims.scales) {
    SIXPOINT_CHECK(check_scale(claim, measured, bundle));
  }
  return {};
}

}  // namespace sixpoint::gap
