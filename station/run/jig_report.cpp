#include "station/run/jig_report.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "station/run/jig_progress.h"

namespace sixpoint::station {

namespace {

using calib::Calibration;

// What was not measured is no 0.
nlohmann::ordered_json number_or_null(const std::optional<double>& number) {
  return number ? nlohmann::ordered_json(*number) : nlohmann::ordered_json(nullptr);
}

std::optional<double> residual_of(const JudgedPoses& judged) {
  return judged.poses.empty() ? std::nullopt : std::optional(judged.worst_mg);
}

nlohmann::ordered_json json_of(const JudgedPoses& judged) {
  nlohmann::ordered_json json;
  json["residual_mg"] = number_or_null(residual_of(judged));
  json["rms_mg"] = judged.poses.empty() ? nlohmann::ordered_json(nullptr)
                                        : nlohmann::ordered_json(judged.rms_mg);
  json["poses"] = nlohmann::ordered_json::array();
  for (const JudgedPose& pose : judged.poses) {
    nlohmann::ordered_json item = station::to_json(pose.reading);
    item["magnitude_g"] = pose.magnitude_g;
    item["error_mg"] = pose.error_mg;
    item["chose_solution"] = pose.chose;
    json["poses"].push_back(std::move(item));
  }
  return json;
}

// Standard uncertainties under the contract's names, then what they are made of and expanded to.
nlohmann::ordered_json uncertainty_to_json(const JigReport& report) {
  const double coverage = report.limits.decision.coverage_factor;
  nlohmann::ordered_json json = calib::to_json(report.combined);
  PerAxis<double> sensitivity_percent{};
  PerAxis<double> zero_mg{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    sensitivity_percent[axis] = 100 * coverage * report.combined.sensitivity_relative[axis];
    zero_mg[axis] = coverage * report.combined.zero_mg[axis];
  }
  json["coverage_factor"] = coverage;
  json["expanded"] = {{"sensitivity_percent", sensitivity_percent}, {"zero_mg", zero_mg}};
  json["budget"] = {{"noise_tilt_gravity", calib::to_json(report.six->best().uncertainty)},
                    {"gravity_relative", report.gravity.sd_g() / report.gravity.g()},
                    {"unused_poses_rms_mg", report.verification.rms_mg}};
  return json;
}

}  // namespace

nlohmann::ordered_json page_to_json(const std::optional<device::CalibrationPage>& page) {
  if (!page) {
    return nullptr;
  }
  nlohmann::ordered_json json = calib::to_json(page->constants);
  json["calibrated"] = to_iso8601(page->calibrated);
  return json;
}

JudgedPoses judge(const std::vector<PoseReading>& readings, const Calibration& calibration,
                  double gravity_g, const std::vector<std::size_t>& choosing) {
  JudgedPoses judged;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const PerAxis<double> force_g = calibration.to_g(readings[i].mean_lsb);
    JudgedPose pose;
    pose.reading = readings[i];
    pose.magnitude_g = std::hypot(force_g[0], force_g[1], force_g[2]);
    pose.error_mg = (pose.magnitude_g - gravity_g) * kMgPerG;
    pose.chose = std::ranges::find(choosing, i) != choosing.end();
    if (!pose.chose) {
      ++judged.judging;
      judged.worst_mg = std::max(judged.worst_mg, std::abs(pose.error_mg));
      judged.rms_mg += pose.error_mg * pose.error_mg;
    }
    judged.poses.push_back(pose);
  }
  judged.rms_mg =
      std::sqrt(judged.rms_mg / static_cast<double>(std::max<std::size_t>(1, judged.judging)));
  return judged;
}

void JigReport::settle_as_left() {
  if (write_begun) {
    as_left.reset();
    reasons.emplace_back(
        "a write of the constants was begun and what the unit holds now was not read: the old ones "
        "or the new ones, whole; measure it again to know which");
  } else if (!as_left) {
    as_left = as_found;
  }
}

std::string JigReport::brief() const {
  std::string text = fmt::format("{} under '{}': {}", printable(serial), calib::to_string(filter),
                                 to_string(verdict));
  if (!verification.poses.empty()) {
    text += fmt::format("; {:.1f} mg off on {} poses that were not fitted", verification.worst_mg,
                        verification.judging);
  }
  for (const std::string& reason : reasons) {
    text += "; " + reason;
  }
  return text;
}

nlohmann::ordered_json JigReport::to_json() const {
  nlohmann::ordered_json json;
  json["serial"] = serial;
  json["firmware"] = firmware;
  json["jig"] = jig;
  json["filter"] = calib::to_string(filter);
  json["protocol"] = to_string(protocol);
  json["verdict"] = to_string(verdict);
  json["codes"] = codes;
  json["reasons"] = reasons;
  json["started"] = to_iso8601(started);
  json["ended"] = to_iso8601(ended);
  json["gravity_m_per_s2"] = gravity.m_per_s2;
  json["gravity_standard_uncertainty_m_per_s2"] = gravity.standard_uncertainty_m_per_s2;
  json["raw_sha256"] = raw_sha256();
  json["poses"] = nlohmann::ordered_json::array();
  for (const PoseReading& face : faces) {
    json["poses"].push_back(station::to_json(face));
  }
  if (protocol == JigProtocol::production_plus) {
    json["half_turn"] = nlohmann::ordered_json::array();
    for (const PoseReading& face : half_turn) {
      json["half_turn"].push_back(station::to_json(face));
    }
  }
  json["constants"] = six ? calib::to_json(six->best().calibration, six->best().stored)
                          : nlohmann::ordered_json(nullptr);
  json["method"] = method;
  json["as_found"] = page_to_json(as_found);
  if (as_found) {
    json["as_found"]["residual_mg"] = number_or_null(as_found_residual_mg);
  }
  json["as_left"] = page_to_json(as_left);
  if (as_left) {
    json["as_left"]["written"] = written;
    json["as_left"]["residual_mg"] =
        number_or_null(written ? residual_of(recheck) : as_found_residual_mg);
  }
  json["verification"] = json_of(verification);
  json["verification"]["residual_rounded_mg"] = verification.poses.empty()
                                                    ? nlohmann::ordered_json(nullptr)
                                                    : nlohmann::ordered_json(rounded_residual_mg);
  json["recheck"] = written ? json_of(recheck) : nlohmann::ordered_json(nullptr);
  json["uncertainty"] = six ? uncertainty_to_json(*this) : nlohmann::ordered_json(nullptr);
  json["limits"] = station::to_json(limits);
  json["quantities"] = nlohmann::ordered_json::array();
  for (const JudgedQuantity& quantity : quantities) {
    json["quantities"].push_back(station::to_json(quantity));
  }
  json["solutions"] = six ? calib::to_json(*six) : nlohmann::ordered_json(nullptr);
  json["refusals"] = refusals;
  device::for_each_count(
      [&](const char* name, auto member) { json["stream"][name] = stream.*member; });
  return json;
}

std::string JigReport::raw_sha256() const { return text_sha256(raw_csv); }

calib::ConstantsRecord JigReport::record() const {
  calib::ConstantsRecord record;
  record.serial = serial;
  record.filter = filter;
  if (six) {
    record.calibration = six->best().calibration;
    record.stored = six->best().stored;
    record.uncertainty = combined;
  }
  record.method = method;
  record.made_at = ended;
  record.made_from.sha256 = raw_sha256();
  record.made_from.kind = "jig";
  record.gravity_m_per_s2 = gravity.m_per_s2;
  return record;
}

}  // namespace sixpoint::station
