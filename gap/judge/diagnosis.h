// The answer: where simulator and recording differ, which effect explains it, how much is left.
//
//   std::cout << diagnosis.brief() << "\n" << diagnosis.to_json().dump(2) << "\n";
//
// Plain data. Units are in the names: mg, g, Hz, s, C; sigma: standard deviations.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace sixpoint::gap {

// One number, three (per axis, or a vector), or a matrix of nine in rows.
struct NamedValue {
  std::string name;
  std::vector<double> value;
  // Empty where there is none; NaN of a number that nothing shows, which is 0 in JSON.
  std::vector<double> sd;
  // The part of `sd` by which the effect may differ from its law. Units of one kind share it, so
  // that it is no scatter between them. Empty where there is none.
  std::vector<double> form_sd = {};
};

// Whether a parameter of this effect follows from its others and is no setting of the simulator:
// `angle_deg` of a tilt, `floor_mg` of flicker; and in JSON `relative_per_c` of a
// sensitivity_tempco (a hundredth of `percent_per_c`) and `f0_hz` of a soft_mount.
bool is_derived(std::string_view effect, std::string_view parameter);

// Its uncertainties for people: "0.012", and "-" for a number that nothing shows.
std::vector<std::string> uncertainty_texts(const NamedValue& parameter);

struct EffectFinding {
  std::string name;
  double probability = 0;
  double nats = 0;  // evidence for it over its absence, prior included; see diagnose.h
  std::vector<NamedValue> parameters = {};
  double held_out_gain_nats = 0;
  bool outside_datasheet = false;
  std::vector<std::string> confounded_with = {};
  // Log odds of a cause that the catalogue lacks in its place: they lower the probability.
  double other_nats = -1e3;
  // Mean square per axis that it adds to the recording, mg^2, and its share of the whole gap.
  double gap_mg2 = 0;
  double share_of_gap = 0;
  // That it is there and adds more than DiagnoseOptions::matters_mg.
  double probability_it_matters = 0;
  // The size, in the unit of the first parameter, that this recording shows half of the time; of a
  // vector its length. None of an effect without a size, and where no segment shows it.
  std::optional<double> bound = {};
  // Earlier units behind the sizes that were expected of it; 0: the catalogue's sizes.
  std::size_t learnt_from_units = 0;
  // Parameters of each further line of the same kind, strongest first; of lines only.
  std::vector<std::vector<NamedValue>> further_lines = {};

  // For people: its parameters, and behind them those of its further lines.
  std::vector<NamedValue> all_parameters() const;
};

struct UnknownPlace {
  int axis = 0;
  std::string segment;
  std::string factor;  // pose, yaw, temperature, frequency, amplitude, time, noise
};

struct UnknownFinding {
  bool present = false;
  double probability = 0;
  std::vector<std::string> why;     // strongest first, in words
  std::vector<UnknownPlace> where;  // strongest first; none where it is in the times alone
  double size_mg = 0;               // rms per axis that nothing named explains, above the floor
};

struct GapSize {
  double before_mg = 0, before_sigma = 0;
  double after_mg = 0, after_sigma = 0;
  std::array<double, 2> after_interval_mg{};
  double floor_mg = 0;
  double closed_fraction = 0;
  // sqrt(chi-square per number) before and after: mean, tone, spectrum, codes, timing.
  std::array<std::array<double, 2>, 5> by_feature{};
};
inline constexpr std::array<const char*, 5> kFeatureNames = {"mean", "tone", "spectrum", "codes",
                                                             "timing"};

struct Location {
  int axis = 0;
  std::string segment;
  std::string factor;  // pose, yaw, temperature, frequency, amplitude, time
  double residual_mg = 0;
  double sigma = 0;
};

struct NextSegment {
  std::string name;
  double minutes = 0;
  double expected_nats = 0;
  std::vector<std::string> separates;
};

// Diagnosis::protocol of a plain recording or a table.
inline constexpr const char* kNoProtocol = "none";

enum class Verdict { no_gap, explained, partly_explained, unexplained };
std::string_view to_string(Verdict verdict);

struct UnitEstimate {
  std::array<double, 3> gain{1, 1, 1};
  std::array<double, 3> offset_g{};
  std::array<double, 3> noise_mg{};
};

// Series for the report page; kept small.
struct Plots {
  std::vector<double> frequency_hz;
  std::array<std::vector<double>, 3> noise_mg2;        // equivalent white variance
  std::array<std::vector<double>, 3> noise_model_mg2;  // nominal, or with the low-pass
  // Allan deviation of the longest still record: measured, of white noise alone, with the accepted
  // slow noise.
  std::vector<double> allan_s;
  std::array<std::vector<double>, 3> allan_mg, allan_nominal_mg, allan_model_mg;
  std::vector<double> step_s;
  std::vector<double> step_share;
  std::vector<double> step_model;
  struct Tone {
    int axis;
    double frequency_hz;
    double ratio;  // to the nominal amplitude
    double model;
  };
  std::vector<Tone> tones;
  struct Residual {
    int axis;
    std::string segment;
    double temperature_c;
    double minutes;
    double before_mg, before_sigma, after_mg;
  };
  std::vector<Residual> residuals;
};

struct Diagnosis {
  std::string bundle;
  std::string protocol;  // production, engineering, or other
  std::string serial, firmware;
  Verdict verdict = Verdict::no_gap;
  bool inconclusive = false;  // too little data to say anything
  std::vector<EffectFinding> effects;
  std::vector<EffectFinding> candidates;
  UnknownFinding unknown;
  std::vector<std::pair<std::string, std::string>> not_observable;  // effect, segment
  GapSize gap;
  std::vector<Location> where;
  std::vector<NextSegment> next_segments;
  UnitEstimate unit;
  std::vector<std::string> losses;
  std::uint64_t seed = 0;
  double seconds = 0;
  Plots plots;

  // One sentence for a technician.
  std::string brief() const;
  // Whether the answer can be acted on: something was decided.
  bool usable() const { return !inconclusive; }
  // The document of gap.md, "The answer", without `schema`.
  nlohmann::ordered_json to_json() const;
};

// Settings with which `sixpoint simulate` reproduces the recording, gaps and all; null where no
// protocol says what was done to the unit.
nlohmann::ordered_json augmented_scenario(const Diagnosis& diagnosis);

}  // namespace sixpoint::gap
