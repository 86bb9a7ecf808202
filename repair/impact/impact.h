// What a study would have found before a repair, and after it.
//
//   Impact impact;
//   impact.before = before;                         // epochs_of() the file as it was
//   impact.after = after;                           // ... and of the repaired one
//   impact.after_uncertainty_mg = {{1.5, 1.2, 2}};  // of a sample, from the repair's mark
//   impact.cuts = {{"moderate", Measure::enmo_mg, 100}};
//   SIXPOINT_CHECK(check(impact));
//   const ImpactSummary summary = summary_of(*impact.before, impact.after_uncertainty_mg, {});
//   const std::string text = impact.brief();
//
// Uncertainty: the standard uncertainty of a sample comes from the constants, so it is the same for
// all samples of an axis; it is carried to first order through ENMO and MAD (epochs.h), and does
// not become smaller with more epochs. That of counts is not stated: thresholds and cut-offs have
// no first order.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"
#include "repair/impact/epochs.h"

namespace sixpoint::repair {

enum class Measure : std::uint8_t { enmo_mg, mad_mg, counts_x, counts_y, counts_z, counts_vm };
std::string_view to_string(Measure measure);

// Of one epoch; counts_vm is the length of the three counts taken as a vector.
double value_of(const Epoch& epoch, Measure measure);

// Epochs above `value` are counted as minutes.
struct CutPoint {
  std::string name;  // the user's own
  Measure measure = Measure::enmo_mg;
  double value = 0;  // mg, or counts of one epoch
};
// "moderate=100" for ENMO in mg, "moderate=counts_vm:200" for another measure. usage for what is
// neither.
Result<CutPoint> parse_cut_point(std::string_view text);

struct Minutes {
  double above = 0;
  // Where the uncertainty is known: at the values less and plus twice their standard uncertainty.
  std::optional<double> least;
  std::optional<double> most;
};

struct ImpactSummary {
  std::size_t epochs = 0;
  double recorded_minutes = 0;
  double enmo_mg = 0;  // means over the epochs
  double mad_mg = 0;
  std::optional<double> enmo_uncertainty_mg;  // standard
  std::optional<double> mad_uncertainty_mg;
  std::optional<PerAxis<double>> counts_per_minute;
  std::vector<Minutes> minutes;  // by cut point
};
ImpactSummary summary_of(const EpochSeries& series,
                         const std::optional<PerAxis<double>>& uncertainty_mg,
                         std::span<const CutPoint> cuts);

struct Impact {
  std::optional<EpochSeries> before;
  std::optional<EpochSeries> after;
  // Standard uncertainty of a sample of `after`, by axis.
  std::optional<PerAxis<double>> after_uncertainty_mg;
  std::vector<CutPoint> cuts;

  std::string brief() const;  // a table
  nlohmann::ordered_json to_json() const;
};

// bad_data where the two have no epoch in common or epochs of other lengths, usage for a cut point
// in counts where the rate has none.
Status check(const Impact& impact);

// A line per epoch of either, by its time.
std::string impact_csv(const Impact& impact);

// A page that needs nothing else: the table, and ENMO over the time before and after.
std::string impact_html(const Impact& impact);

}  // namespace sixpoint::repair
