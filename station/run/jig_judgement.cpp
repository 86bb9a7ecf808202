#include "station/run/jig_judgement.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "station/run/budget.h"

namespace sixpoint::station {

Result<calib::SixPoseReport> solve_faces(const std::vector<PoseReading>& faces,
                                         const std::vector<PoseReading>& held_out,
                                         const calib::LocalGravity& gravity, const Limits& limits) {
  const auto readings = [](const std::vector<PoseReading>& from) {
    std::vector<calib::PoseMean> to;
    to.reserve(from.size());
    for (const PoseReading& reading : from) {
      to.push_back({device::direction_of(reading.pose), reading.mean_lsb, reading.sd_lsb,
                    reading.samples, reading.temperature_c});
    }
    return to;
  };
  calib::SixPoseOptions options;
  options.gravity = gravity;
  // Ranges and residuals are judged by the limits, with their guard bands. The solver only judges
  // whether the readings contradict each other.
  options.gain_range = HUGE_VAL;
  options.zero_range_g = HUGE_VAL;
  options.held_out_mg = HUGE_VAL;
  options.most_sd_mg = std::max(options.most_sd_mg, 2 * *limits.of("noise_mg").high);
  options.most_tilt_deg = std::max(options.most_tilt_deg, 2 * *limits.of("tilt_deg").high);
  return calib::solve_six_poses(readings(faces), readings(held_out), options);
}

Result<bool> judge_readings(JigReport& report, const JigRun& run) {
  report.faces = run.faces();
  report.half_turn = run.half_turn();
  if (report.faces.size() < device::kPoses.size()) {
    return false;
  }
  SIXPOINT_ASSIGN(report.six,
                  solve_faces(run.faces(), run.verification(), report.gravity, report.limits));
  const calib::SixPoseSolution& best = report.six->best();
  report.method = fmt::format("six_pose_{}", calib::to_string(report.six->chosen));
  const std::vector<std::size_t>& choosing = report.six->choosing;
  report.verification = judge(run.verification(), best.calibration, report.gravity.g(), choosing);
  if (const auto rounded = calib::calibration_from(best.stored)) {
    report.rounded_residual_mg =
        judge(run.verification(), *rounded, report.gravity.g(), choosing).worst_mg;
  }
  for (PoseReading& face : report.faces) {
    for (const calib::PoseResidual& residual : report.six->poses) {
      if (!residual.held_out && residual.side == device::to_string(face.pose)) {
        face.tilt_deg = residual.tilt_deg;
      }
    }
  }
  const double left_mg = report.verification.rms_mg;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    report.combined.sensitivity_relative[axis] =
        std::hypot(best.uncertainty.sensitivity_relative[axis], left_mg / kMgPerG);
    report.combined.zero_mg[axis] = std::hypot(best.uncertainty.zero_mg[axis], left_mg);
  }
  return report.six->verified &&
         judge_quantities(measured_quantities(report), report.limits).usable();
}

namespace {

// The end of a run that did not get through all poses. False where it did.
bool conclude_early(JigReport& report, JigOutcome outcome, const JigEnding& ending) {
  const auto end = [&report](JigVerdict verdict, const char* code, std::string reason) {
    report.verdict = verdict;
    report.codes = {code};
    report.reasons.push_back(std::move(reason));
  };
  switch (outcome) {
    case JigOutcome::sensor_stuck:
      end(JigVerdict::fail, "sensor_stuck", ending.last_text);
      return true;
    case JigOutcome::stopped:
      end(JigVerdict::stopped, "stopped", "stopped by the operator");
      return true;
    case JigOutcome::timed_out:
      end(JigVerdict::inconclusive, "time_out",
          "no pose was accepted in time; is the unit on the jig, and does the jig turn it?");
      if (report.stream.lost_samples > 0) {
        report.reasons.push_back(
            fmt::format("{} samples were lost or damaged on the way, and every reading begins anew "
                        "then: look at the cable",
                        report.stream.lost_samples));
      }
      return true;
    case JigOutcome::too_many_refusals:
      end(JigVerdict::inconclusive, "too_many_refusals",
          "too many placements were refused; look at jig, seat and cable");
      return true;
    case JigOutcome::unit_gone:
      report.ended_by = ending.gone;
      end(JigVerdict::inconclusive, "unit_gone",
          fmt::format("the unit went away in mid-run and did not come back ({})",
                      ending.gone ? ending.gone->what : std::string()));
      return true;
    case JigOutcome::running:
    case JigOutcome::complete:
      break;
  }
  return false;
}

}  // namespace

void conclude_report(JigReport& report, const JigRun& run, const JigEnding& ending) {
  if (conclude_early(report, run.outcome(), ending)) {
    return;
  }
  if (report.written) {
    const auto left = calib::calibration_from(report.as_left->constants);
    report.recheck = judge(run.recheck(), *left, report.gravity.g());
  }
  Verdict judged = judge_quantities(measured_quantities(report), report.limits);
  const auto worse = [&](JigVerdict verdict, const char* code) {
    judged.verdict = verdict;
    judged.codes.emplace_back(code);
  };
  if (!report.six || !report.six->missing_directions.empty()) {
    worse(JigVerdict::inconclusive, "missing_pose");
  } else if (!report.six->verified) {
    worse(JigVerdict::fail, "not_verified");
    judged.reasons.insert(judged.reasons.end(), report.six->reasons.begin(),
                          report.six->reasons.end());
  }
  if (report.written && report.as_left->constants != report.six->best().stored) {
    worse(JigVerdict::fail, "read_back_differs");
    judged.reasons.emplace_back("the unit does not hold what was written");
  } else if (!report.written && ending.write && judged.usable()) {
    if (report.ended_by) {  // by this machine, before the unit was asked
      worse(JigVerdict::inconclusive, "interrupted");
    } else {
      worse(JigVerdict::fail, "write_refused");
    }
    judged.reasons.emplace_back("the constants were not written into the unit");
  }
  apply_retest(judged, ending.retest);
  report.verdict = judged.verdict;
  report.is_last_failure = is_last_failure(judged.verdict, ending.retest);
  report.codes = std::move(judged.codes);
  report.quantities = std::move(judged.quantities);
  report.reasons.insert(report.reasons.end(), judged.reasons.begin(), judged.reasons.end());
}

}  // namespace sixpoint::station
