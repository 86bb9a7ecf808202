#include "gap/recording/bundle.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "gap/recording/header_evidence.h"
#include "gap/recording/logs.h"
#include "gap/recording/protocol.h"
#include "gt3x/recording.h"
#include "gt3x/sample_reader.h"

namespace sixpoint::gap {
namespace {

constexpr std::size_t kMostSamples = 20'000'000;  // two days at 100 Hz, 120 MB

Status read_recording(FileSystem& files, const std::string& path, Bundle& bundle,
                      HeaderClaims& claims) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(files, path));
  const gt3x::Info& info = recording.info();
  bundle.header.serial = info.serial();
  bundle.header.firmware = info.firmware();
  const auto claim_scale = [&claims](const char* source, std::optional<double> lsb_per_g) {
    const bool known = std::any_of(claims.scales.begin(), claims.scales.end(),
                                   [&](const auto& claim) { return claim.source == source; });
    if (lsb_per_g && std::isfinite(*lsb_per_g) && *lsb_per_g > 0 && !known) {
      claims.scales.push_back({source, *lsb_per_g});
    }
  };
  claim_scale("info.txt", info.accel_scale_lsb_per_g());
  if (const auto rate_hz = info.sample_rate_hz(); rate_hz && *rate_hz > 0) {
    claims.rate_hz = *rate_hz;
  }
  gt3x::SampleReader reader(recording);
  std::uint64_t damaged_s = 0;
  std::map<std::size_t, std::size_t> records_by_samples;
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, reader.next());
    if (!item) {
      break;
    }
    if (item->kind == gt3x::SampleItem::Kind::recorded) {
      if (bundle.samples.size() + item->counts.size() > kMostSamples) {
        return fail(ErrorCode::bad_data, fmt::format("more than {} samples", kMostSamples), path,
                    "compare the file with the description of bundles");
      }
      bundle.samples.insert(bundle.samples.end(), item->counts.begin(), item->counts.end());
      ++records_by_samples[item->counts.size()];
      if (item->parameters != nullptr) {
        claim_scale("PARAMETERS record", item->parameters->accel_scale_lsb_per_g);
      }
    } else if (item->gap == gt3x::GapKind::damaged) {
      damaged_s += item->seconds;
    }
  }
  if (const std::uint64_t lost = reader.irregular().repeated_seconds() +
                                 reader.irregular().count(gt3x::IrregularKind::late);
      lost > 0) {
    return fail(ErrorCode::bad_data,
                fmt::format("{} records repeat a second or come too late, so that the protocol's "
                            "sample numbers no longer hold",
                            lost),
                path, "compare the file with the description of bundles");
  }
  if (damaged_s > 0) {
    return fail(ErrorCode::bad_data,
                fmt::format("{} seconds of the recording are damaged, so that the protocol's "
                            "sample numbers no longer hold",
                            damaged_s),
                path, "compare the file with the description of bundles");
  }
  const auto most =
      std::max_element(records_by_samples.begin(), records_by_samples.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most != records_by_samples.end() && most->first > 0) {
    claims.samples_per_record = static_cast<double>(most->first);
  }
  return {};
}

}  // namespace

void hold_step(HeldSigns& held, const Eigen::Vector3d& step_g) {
  for (Eigen::Index a = 0; a < 3; ++a) {
    for (std::size_t k = 0; k < kLeastSteps_g.size(); ++k) {
      if (std::abs(step_g[a]) > kLeastSteps_g[k]) {
        held(a, static_cast<Eigen::Index>(k)) = std::copysign(1.0, step_g[a]);
      }
    }
  }
}

namespace {

// Whether the command jumps between the two times, from one segment to the next.
bool command_jumps(const Bundle& bundle, double from_s, double to_s) {
  constexpr double kJump_c = 2;
  for (std::size_t i = 1; i < bundle.segments.size(); ++i) {
    const Segment& segment = bundle.segments[i];
    if (segment.host_start_s > from_s && segment.host_start_s <= to_s &&
        std::abs(segment.temperature_start_c - bundle.segments[i - 1].temperature_end_c) >
            kJump_c) {
      return true;
    }
  }
  return bundle.segments.empty();
}

}  // namespace

double Bundle::temperature_at(double host_time_s) const {
  constexpr double kPause_s = 60;
  if (temperature.empty()) {
    return commanded_c(host_time_s);
  }
  const auto& t = temperature.host_time_s;
  const auto& logged_c = temperature.temperature_c;
  const auto after = std::lower_bound(t.begin(), t.end(), host_time_s);
  if (after == t.begin() || after == t.end()) {
    const std::size_t nearest = after == t.begin() ? 0 : t.size() - 1;
    const auto [from_s, to_s] = std::minmax(t[nearest], host_time_s);
    return command_jumps(*this, from_s, to_s)
               ? logged_c[nearest]
               : logged_c[nearest] + commanded_c(host_time_s) - commanded_c(t[nearest]);
  }
  const auto i = static_cast<std::size_t>(after - t.begin());
  const double step_s = t[i] - t[i - 1];
  const double share = step_s > 0 ? (host_time_s - t[i - 1]) / step_s : 0;
  const double line_c = logged_c[i - 1] * (1 - share) + logged_c[i] * share;
  if (step_s <= kPause_s || command_jumps(*this, t[i - 1], t[i])) {
    return line_c;
  }
  const double commanded_line_c = commanded_c(t[i - 1]) * (1 - share) + commanded_c(t[i]) * share;
  return line_c + commanded_c(host_time_s) - commanded_line_c;
}

double Bundle::commanded_c(double host_time_s) const {
  const Segment* segment = &segments.front();
  for (const Segment& candidate : segments) {
    if (candidate.host_start_s <= host_time_s) {
      segment = &candidate;
    }
  }
  const double share = std::clamp(
      (host_time_s - segment->host_start_s) * rate_hz / static_cast<double>(segment->samples), 0.0,
      1.0);
  return segment->temperature_start_c * (1 - share) + segment->temperature_end_c * share;
}

Result<Bundle> read_bundle(FileSystem& files, const std::string& folder) {
  Bundle bundle;
  bundle.path = folder;
  const std::string protocol = folder + "/protocol.json";
  if (!files.info(protocol)) {
    return fail(ErrorCode::no_input, "this folder is no bundle: it has no protocol.json", folder,
                "name a bundle's folder or a .gt3x file; 'sixpoint simulate' makes bundles");
  }
  SIXPOINT_CHECK(read_protocol(files, protocol, bundle));
  HeaderClaims claims;
  SIXPOINT_CHECK(read_recording(files, folder + "/recording.gt3x", bundle, claims));
  const Segment& last = bundle.segments.back();
  if (last.first_sample + last.samples > bundle.samples.size()) {
    return fail(ErrorCode::bad_data,
                fmt::format("the last segment reaches to sample {}, the recording holds {}",
                            last.first_sample + last.samples, bundle.samples.size()),
                protocol, "compare the file with the description of bundles");
  }
  if (!bundle.protocol_serial.empty() && !bundle.header.serial.empty() &&
      bundle.protocol_serial != bundle.header.serial) {
    bundle.losses.push_back(fmt::format(
        "the protocol is of unit {}, the recording's header names {}: headers are copied, but make "
        "sure that this is the right recording",
        bundle.protocol_serial, printable(bundle.header.serial, 100)));
  }
  read_temperature(files, folder + "/temperature.csv", bundle);
  read_host_clock(files, folder + "/host_clock.csv", bundle);
  SIXPOINT_CHECK(check_header(claims, bundle));
  check_logs(bundle);
  return bundle;
}

}  // namespace sixpoint::gap
