// The JSON of the report of solve_from_still_blocks().
#include <nlohmann/json.hpp>

#include "calib/solve.h"

namespace sixpoint::calib {

namespace {

using Json = nlohmann::ordered_json;

void add_constants(Json& json, const SolveReport& report) {
  json["constants"] = nullptr;
  json["standard_uncertainty"] = nullptr;
  if (!report.calibration) {
    return;
  }
  if (report.stored) {
    json["constants"] = to_json(*report.calibration, *report.stored);
  } else {
    json["constants"] = to_json(*report.calibration);
  }
  json["standard_uncertainty"] = to_json(report.uncertainty);
  json["standard_uncertainty"]["of_the_data_alone"] = to_json(report.statistical);
}

Json to_json(const Coverage& coverage) {
  Json json;
  json["min"] = coverage.min_g;
  json["max"] = coverage.max_g;
  // Blocks at -1.3 .. -0.7, -0.7 .. 0.7 and 0.7 .. 1.3 g of each axis.
  for (const auto& [name, subset] :
       {std::pair{"low", ValueSubset::low}, std::pair{"middle", ValueSubset::middle},
        std::pair{"high", ValueSubset::high}}) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      json["value_subsets"][name].push_back(
          coverage.subset_blocks[a][static_cast<std::size_t>(subset)]);
    }
  }
  return json;
}

void add_fit(Json& json, const BlockFit& fit) {
  json["least_squares"] = {{"converged", fit.fit.converged},
                           {"condition", fit.fit.condition},
                           {"degrees_of_freedom", fit.fit.degrees_of_freedom},
                           {"blocks_left_out", fit.blocks_left_out},
                           {"block_sd_mg", fit.block_sd_mg},
                           {"structural_mg", fit.structural_mg}};
  if (!fit.richer) {
    return;
  }
  const LeastSquaresFit& more = fit.richer->fit;
  Json& richer = json["richer_model"];
  richer = to_json(more.calibration);
  richer["cross_axis"] = more.model.cross_axis ? Json(more.cross_axis) : Json(nullptr);
  richer["zero_lsb_per_c"] = more.model.temperature ? Json(more.zero_lsb_per_c) : Json(nullptr);
  richer["reference_temperature_c"] =
      more.model.temperature ? number_or_null(fit.reference_temperature_c) : Json(nullptr);
  richer["held_out_rms_mg"] = fit.richer->held_out_rms_mg;
}

// How the six constants were chosen, and the map with cross-axis terms.
void add_six(Json& json, const SolveReport& report) {
  if (report.six && report.six->unseen_mg) {
    const BestSix& six = *report.six;
    json["best_six"] = {{"chosen", to_string(six.from)},
                        {"unseen_mg",
                         {{"of_sensor", six.unseen_mg->of_sensor},
                          {"of_directions", six.unseen_mg->of_directions},
                          {"of_time", six.unseen_mg->of_time},
                          {"matrix", six.unseen_mg->matrix}}},
                        {"unseen_directions", six.unseen_mg->directions},
                        {"elsewhere_mg", six.elsewhere_mg}};
  }
  if (report.cross_axis) {
    json["cross_axis"] = to_json(*report.cross_axis);
  }
}

Json to_json(const GeneticResult& search) {
  return {{"settled", search.settled},   {"fitness_mg", search.fitness_mg},
          {"level_mg", search.level_mg}, {"spread_mg", search.spread_mg},
          {"trend_mg", search.trend_mg}, {"constants", to_json(search.calibration)}};
}

}  // namespace

Json to_json(const SolveReport& report) {
  const bool any = report.points > 0;
  Json json;
  json["serial"] = report.serial;
  json["filter"] = report.filter ? Json(to_string(*report.filter)) : Json(nullptr);
  json["method"] = to_string(report.method);
  add_constants(json, report);
  json["points"] = report.points;
  json["points_found"] = report.points_found;
  json["noisy_points"] = report.noisy_points;
  json["coverage_g"] = any ? to_json(report.coverage) : Json({{"min", nullptr}, {"max", nullptr}});
  json["residual_mg"]["before"] = any ? Json(report.residual_before_mg) : Json(nullptr);
  json["residual_mg"]["after"] = number_or_null(report.residual_after_mg);
  json["residual_mg"]["rounded"] = number_or_null(report.residual_rounded_mg);
  json["verified"] = report.verification.verified;
  json["verdict"] = to_string(report.verification.verdict);
  json["reasons"] = report.verification.reasons;
  json["missing_directions"] = report.verification.missing_directions;
  json["notes"] = report.notes;
  json["iterations"] = report.iterations;
  json["seconds"] = report.seconds;
  json["gravity_m_per_s2"] = report.gravity_g * kStandardGravity_m_per_s2;
  // What the constants hold for.
  json["temperature_c"] =
      report.fit ? number_or_null(report.fit->reference_temperature_c) : Json(nullptr);
  json["from_prior"] = report.from_prior;
  json["verification"] = to_json(report.verification);
  if (report.fit) {
    add_fit(json, *report.fit);
  }
  add_six(json, report);
  if (report.trust) {
    json["trust"] = {{"trusted", to_string(report.trust->trusted)},
                     {"apart_mg", report.trust->apart_mg},
                     {"why", report.trust->why}};
  }
  if (report.search) {
    json["genetic"] = to_json(*report.search);
  }
  if (report.temperature) {
    const TemperatureDrift& drift = *report.temperature;
    json["temperature"] = {{"low_c", drift.low_c},
                           {"high_c", drift.high_c},
                           {"zero_mg_per_c", drift.zero_mg_per_c},
                           {"standard_uncertainty_mg_per_c", drift.standard_uncertainty_mg_per_c},
                           {"blocks", drift.blocks}};
  }
  if (report.partial) {
    const PartialKnowledge& partial = *report.partial;
    json["partial"] = {{"zero_mg", partial.zero_mg},
                       {"sensitivity_relative", partial.sensitivity_relative},
                       {"zero_determined", partial.zero_determined},
                       {"sensitivity_determined", partial.sensitivity_determined}};
  }
  return json;
}

}  // namespace sixpoint::calib
