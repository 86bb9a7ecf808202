#include "station/records/shared_effects.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "device/jig.h"
#include "station/records/jig_bundle.h"

namespace sixpoint::station {

namespace {

using Matrix12 = Eigen::Matrix<double, 12, 12>;
using Vector12 = Eigen::Matrix<double, 12, 1>;

constexpr std::size_t kTurn = 0;
constexpr std::size_t kShear = 1;
constexpr std::size_t kEven = 2;
constexpr std::array<Eigen::Index, 4> kFirstOfGroup = {0, 3, 6, 12};
constexpr std::size_t kNoFace = 6;
// Held elements are wide beside everything: their size is the readings'.
constexpr double kHeldOverLargest = 2;
constexpr double kRivalFactor = 20;
// Below this factor alone, no combination of forms is tried.
constexpr double kWorthCombining_log = 2;

double shared_square(double x) { return x * x; }

double log_sum(const std::vector<double>& logs) {
  const double most = *std::max_element(logs.begin(), logs.end());
  double sum = 0;
  for (const double each : logs) {
    sum += std::exp(each - most);
  }
  return most + std::log(sum);
}

double probability_of(double log_odds) { return 1 / (1 + std::exp(-log_odds)); }

// Rows: turn, shear, even; columns: SkewPattern. Orthonormal.
Matrix12 make_basis() {
  const auto at = [](device::Pose pose, std::size_t axis) {
    const auto face = static_cast<Eigen::Index>(
        std::find(device::kPoses.begin(), device::kPoses.end(), pose) - device::kPoses.begin());
    const std::size_t first_other = device::axis_of(pose) == 0 ? 1 : 0;
    return 2 * face + (axis == first_other ? 0 : 1);
  };
  Matrix12 basis = Matrix12::Zero();
  Eigen::Index pair = 0;
  for (std::size_t a = 0; a < kAxes; ++a) {
    for (std::size_t b = a + 1; b < kAxes; ++b, ++pair) {
      for (const int sign : {1, -1}) {
        const Eigen::Index on_a = at(device::pose_of(a, sign), b);
        const Eigen::Index on_b = at(device::pose_of(b, sign), a);
        basis(pair, on_a) = sign * 0.5;
        basis(pair, on_b) = -sign * 0.5;
        basis(3 + pair, on_a) = sign * 0.5;
        basis(3 + pair, on_b) = sign * 0.5;
        basis(6 + 2 * pair, on_a) = std::numbers::sqrt2 / 2;
        basis(7 + 2 * pair, on_b) = std::numbers::sqrt2 / 2;
      }
    }
  }
  return basis;
}

const Matrix12& basis() {
  static const Matrix12 kBasis = make_basis();
  return kBasis;
}

// What a base that leans by a degree along the laboratory's x and y does, in the groups' coordinates.
Eigen::Matrix<double, 12, 2> make_base() {
  Eigen::Matrix<double, 12, 2> skew;
  Eigen::Index row = 0;
  for (const device::Pose pose : device::kPoses) {
    const Eigen::Matrix3d rotation = rotation_on_jig(pose);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      if (axis != device::axis_of(pose)) {
        skew.row(row++) = rotation.row(static_cast<Eigen::Index>(axis)).head<2>();
      }
    }
  }
  return basis() * skew;
}

const Matrix12& base_matrix() {
  static const Matrix12 kMatrix = make_base() * make_base().transpose();
  return kMatrix;
}

// What is known of the sizes of a level's effects: the store teaches it.
struct LevelPrior {
  double share = 0.1;
  std::array<double, 3> size_weight{1.0 / 3, 1.0 / 3, 1.0 / 3};
};
using LevelPriors = std::array<LevelPrior, 3>;  // by SharedLevel

// A form that an effect may have.
struct Hypothesis {
  double log_weight = 0;  // beforehand, then with the evidence
  Eigen::VectorXd tilt;   // variances beforehand, of the groups' coordinates
  double base_variance = 0;
  std::array<std::size_t, 2> faces{kNoFace, kNoFace};
  double face_variance = 0;
  std::size_t size = 0;  // which of the level's
  bool has_tilt = false;
};

// Reading of an element with all else taken off, and its variances, of all coordinates.
struct Reading12 {
  Eigen::VectorXd value;
  Eigen::VectorXd variance;
};

struct Evidence {
  double log_odds = 0;                 // that it is there, against not
  std::vector<Hypothesis> hypotheses;  // weights sum to 1 in the end
};

struct Candidate {
  SharedLevel level = SharedLevel::jig;
  std::size_t index = 0;
  std::size_t element = 0;
};

struct Group {
  CrossedEffects model;
  ScatterPrior prior;
};

// One quantity's problem: skew in three groups of columns, or zero, or sensitivity in one.
struct Problem {
  std::vector<Group> groups;
  std::vector<Eigen::Index> first_column;  // of each group, and the end
  std::vector<HeldElement> always;         // the means
  std::vector<Candidate> candidates;
  std::array<double, 3> sizes{};
  double held_sd = 1;
  bool is_skew = false;
};

bool acts_in(const Problem& problem, SharedLevel level, std::size_t group) {
  return !(problem.is_skew && level == SharedLevel::lot && group == kEven);
}

// Which of turn, shear and even a tilt of this level moves, or a base does.
constexpr std::size_t kBase = 3;
std::vector<std::array<bool, 4>> tilt_forms(const Problem& problem, SharedLevel level) {
  if (!problem.is_skew) {
    return {{true}};
  }
  if (level == SharedLevel::lot) {
    return {{true}, {true, true}};
  }
  return {{true}, {false, false, true}, {true, true, true}, {false, false, false, true}};
}

Eigen::VectorXd variances_of(const Problem& problem, const std::array<bool, 4>& form, double size) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(problem.first_column.back());
  for (std::size_t g = 0; g < problem.groups.size(); ++g) {
    if (form[g]) {
      out.segment(problem.first_column[g], problem.first_column[g + 1] - problem.first_column[g])
          .setConstant(shared_square(size));
    }
  }
  return out;
}

Matrix12 face_matrix(std::size_t face) {
  const auto first = static_cast<Eigen::Index>(2 * face);
  return basis().col(first) * basis().col(first).transpose() +
         basis().col(first + 1) * basis().col(first + 1).transpose();
}

Eigen::MatrixXd tilt_covariance_of(const Hypothesis& hypothesis) {
  Eigen::MatrixXd out = hypothesis.tilt.asDiagonal();
  if (hypothesis.base_variance > 0) {
    out += hypothesis.base_variance * base_matrix();
  }
  return out;
}

Eigen::MatrixXd covariance_of(const Hypothesis& hypothesis) {
  Eigen::MatrixXd out = tilt_covariance_of(hypothesis);
  for (const std::size_t face : hypothesis.faces) {
    if (face != kNoFace) {
      out += hypothesis.face_variance * face_matrix(face);
    }
  }
  return out;
}

// The logarithm of the density with the effect over that without it.
double log_ratio(const Reading12& reading, const Hypothesis& hypothesis) {
  double without = 0;
  for (Eigen::Index i = 0; i < reading.value.size(); ++i) {
    without +=
        std::log(reading.variance(i)) + shared_square(reading.value(i)) / reading.variance(i);
  }
  if (hypothesis.faces[0] == kNoFace && hypothesis.base_variance == 0) {
    double with = 0;
    for (Eigen::Index i = 0; i < reading.value.size(); ++i) {
      const double variance = reading.variance(i) + hypothesis.tilt(i);
      with += std::log(variance) + shared_square(reading.value(i)) / variance;
    }
    return 0.5 * (without - with);
  }
  Eigen::MatrixXd covariance = covariance_of(hypothesis);
  covariance += Eigen::MatrixXd(reading.variance.asDiagonal());
  const Eigen::LLT<Matrix12> factor{Matrix12(covariance)};
  const Matrix12 root = factor.matrixL();
  const Vector12 whitened = factor.matrixL().solve(Vector12(reading.value));
  return 0.5 * (without - 2 * root.diagonal().array().log().sum() - whitened.squaredNorm());
}

constexpr double kTiltShare = 0.5;  // of jigs that have an effect
constexpr double kFaceShare = 0.35;
constexpr double kBothShare = 0.1;
constexpr double kTwoFacesShare = 0.05;

void add_tilts(const Problem& problem, SharedLevel level, const LevelPrior& prior, double share,
               std::vector<Hypothesis>& out) {
  const auto forms = tilt_forms(problem, level);
  for (const std::array<bool, 4>& form : forms) {
    for (std::size_t s = 0; s < problem.sizes.size(); ++s) {
      Hypothesis tilt;
      tilt.log_weight = std::log(share * prior.size_weight[s] / static_cast<double>(forms.size()));
      tilt.tilt = variances_of(problem, form, problem.sizes[s]);
      tilt.base_variance = form[kBase] ? shared_square(problem.sizes[s]) : 0;
      tilt.size = s;
      tilt.has_tilt = true;
      out.push_back(std::move(tilt));
    }
  }
}

void add_faces(const Problem& problem, std::vector<Hypothesis>& out, bool combined) {
  const std::vector<Hypothesis> tilts = out;
  const auto sizes = static_cast<double>(problem.sizes.size());
  const auto add = [&](Hypothesis base, std::array<std::size_t, 2> faces, double size,
                       double weight) {
    base.log_weight = base.has_tilt ? base.log_weight + std::log(weight) : std::log(weight);
    base.faces = faces;
    base.face_variance = shared_square(size);
    out.push_back(std::move(base));
  };
  Hypothesis none;
  none.tilt = Eigen::VectorXd::Zero(problem.first_column.back());
  for (const double size : problem.sizes) {
    for (std::size_t face = 0; face < kNoFace; ++face) {
      if (!combined) {
        add(none, {face, kNoFace}, size, kFaceShare / (6 * sizes));
        continue;
      }
      for (const Hypothesis& tilt : tilts) {
        if (tilt.has_tilt && tilt.faces[0] == kNoFace) {
          add(tilt, {face, kNoFace}, size, kBothShare / kTiltShare / (6 * sizes));
        }
      }
      for (std::size_t other = face + 1; other < kNoFace; ++other) {
        add(none, {face, other}, size, kTwoFacesShare / (15 * sizes));
      }
    }
  }
}

Evidence evidence_of(const Problem& problem, const Candidate& candidate, const LevelPrior& prior,
                     const Reading12& reading) {
  Evidence out;
  const bool has_faces = problem.is_skew && candidate.level == SharedLevel::jig;
  add_tilts(problem, candidate.level, prior, has_faces ? kTiltShare : 1, out.hypotheses);
  if (has_faces) {
    add_faces(problem, out.hypotheses, false);
  }
  std::vector<double> ratios;
  const auto weigh = [&] {
    for (std::size_t i = ratios.size(); i < out.hypotheses.size(); ++i) {
      ratios.push_back(log_ratio(reading, out.hypotheses[i]));
    }
  };
  weigh();
  if (has_faces && *std::max_element(ratios.begin(), ratios.end()) > kWorthCombining_log) {
    add_faces(problem, out.hypotheses, true);
    weigh();
  }
  for (std::size_t i = 0; i < ratios.size(); ++i) {
    out.hypotheses[i].log_weight += ratios[i];
    ratios[i] = out.hypotheses[i].log_weight;
  }
  const double total = log_sum(ratios);
  for (Hypothesis& each : out.hypotheses) {
    each.log_weight -= total;
  }
  out.log_odds = total + std::log(prior.share / (1 - prior.share));
  return out;
}

class Search {
 public:
  Search(const Problem& problem, const LevelPriors& priors) : problem_(problem), priors_(priors) {
    scatter_.resize(problem.groups.size());
  }

  void run() {
    std::set<std::size_t> taken_out;
    for (std::size_t step = 0; step <= 2 * problem_.candidates.size(); ++step) {
      learn();
      const auto estimates = estimates_of(held_);
      std::optional<std::size_t> strongest;
      double best = 0;
      double worst = 0;
      std::size_t weakest = 0;
      std::vector<double> odds;
      for (std::size_t c = 0; c < problem_.candidates.size(); ++c) {
        odds.push_back(evidence(c, estimates).log_odds);
        if (held_.contains(c) && odds[c] < worst) {
          worst = odds[c];
          weakest = c;
        } else if (!held_.contains(c) && !taken_out.contains(c) && odds[c] > best) {
          best = odds[c];
          strongest = c;
        }
      }
      if (worst < 0) {
        held_.erase(weakest);
        taken_out.insert(weakest);
        continue;
      }
      if (!strongest) {
        return;
      }
      held_.insert(*strongest);
      add_other_jigs(odds, *strongest, taken_out);
    }
    learn();
  }

  Evidence evidence(std::size_t c,
                    const std::vector<std::vector<ElementEstimate>>& estimates) const {
    const Candidate& candidate = problem_.candidates[c];
    return evidence_of(problem_, candidate, priors_[static_cast<std::size_t>(candidate.level)],
                       reading_of(candidate.element, estimates));
  }

  std::vector<std::vector<ElementEstimate>> estimates_of(const std::set<std::size_t>& held) const {
    std::vector<std::vector<ElementEstimate>> out;
    for (std::size_t g = 0; g < problem_.groups.size(); ++g) {
      out.push_back(problem_.groups[g].model.estimates(elements_of(held, g), scatter_[g]));
    }
    return out;
  }

  Reading12 reading_of(std::size_t element,
                       const std::vector<std::vector<ElementEstimate>>& estimates) const {
    // Of what the readings cannot tell from others, nothing is known.
    constexpr double kUnknown = 1e12;
    Reading12 out;
    out.value.resize(problem_.first_column.back());
    out.variance.resize(problem_.first_column.back());
    for (std::size_t g = 0; g < problem_.groups.size(); ++g) {
      const ElementEstimate& estimate = estimates[g][element];
      const Eigen::Index first = problem_.first_column[g];
      const Eigen::Index count = problem_.first_column[g + 1] - first;
      out.value.segment(first, count) = estimate.value;
      out.variance.segment(first, count)
          .setConstant(std::min(estimate.variance, kUnknown * shared_square(problem_.held_sd)));
    }
    return out;
  }

  std::vector<HeldElement> elements_of(const std::set<std::size_t>& held, std::size_t group) const {
    std::vector<HeldElement> out = problem_.always;
    for (const std::size_t c : held) {
      const Candidate& candidate = problem_.candidates[c];
      if (acts_in(problem_, candidate.level, group)) {
        out.push_back({candidate.element, problem_.held_sd});
      }
    }
    return out;
  }

  const std::set<std::size_t>& held() const { return held_; }
  const std::vector<CrossedScatter>& scatter() const { return scatter_; }

 private:
  void learn() {
    for (std::size_t g = 0; g < problem_.groups.size(); ++g) {
      scatter_[g] = problem_.groups[g].model.learn_scatter(
          elements_of(held_, g), problem_.groups[g].prior,
          is_learnt_ ? std::optional(scatter_[g]) : std::nullopt);
    }
    is_learnt_ = true;
  }

  // Hundreds of tilted jigs would take hundreds of steps: those with overwhelming evidence are
  // taken together. Where they were too many, they are taken out one by one.
  void add_other_jigs(const std::vector<double>& odds, std::size_t best,
                      const std::set<std::size_t>& taken_out) {
    constexpr double kOverwhelming_log = 10;
    if (problem_.candidates[best].level != SharedLevel::jig) {
      return;
    }
    for (std::size_t c = 0; c < odds.size(); ++c) {
      if (problem_.candidates[c].level == SharedLevel::jig && !taken_out.contains(c) &&
          odds[c] > std::max(kOverwhelming_log, odds[best] / 4)) {
        held_.insert(c);
      }
    }
  }

  const Problem& problem_;
  const LevelPriors& priors_;
  std::set<std::size_t> held_;
  std::vector<CrossedScatter> scatter_;
  bool is_learnt_ = false;
};

// Shares and sizes as the store has them, beside what was believed as if of some elements more.
void learn_levels(const Problem& problem, const Search& search, const SharedEffectOptions& options,
                  LevelPriors& priors) {
  std::array<double, 3> there{};
  std::array<double, 3> all{};
  std::array<std::array<double, 3>, 3> sizes{};
  const auto estimates = search.estimates_of(search.held());
  for (std::size_t c = 0; c < problem.candidates.size(); ++c) {
    const auto level = static_cast<std::size_t>(problem.candidates[c].level);
    const Evidence evidence = search.evidence(c, estimates);
    const double probability = probability_of(evidence.log_odds);
    all[level] += 1;
    there[level] += probability;
    for (const Hypothesis& each : evidence.hypotheses) {
      sizes[level][each.size] += each.has_tilt ? probability * std::exp(each.log_weight) : 0;
    }
  }
  for (std::size_t level = 0; level < priors.size(); ++level) {
    LevelPrior& prior = priors[level];
    double tilts = 0;
    for (const double each : sizes[level]) {
      tilts += each;
    }
    prior.share = (prior.share * options.prior_elements + there[level]) /
                  (options.prior_elements + all[level]);
    for (std::size_t s = 0; s < prior.size_weight.size(); ++s) {
      const double believed = options.prior_elements * prior.size_weight[s];
      prior.size_weight[s] = (believed + sizes[level][s]) / (options.prior_elements + tilts);
    }
  }
}

// Mean and covariance of one part of an effect, of a hypothesis with all its parts.
struct Part {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
};
Part part_of(const Reading12& reading, const Eigen::MatrixXd& prior, const Eigen::MatrixXd& all) {
  const Eigen::MatrixXd total = all + Eigen::MatrixXd(reading.variance.asDiagonal());
  const Eigen::LLT<Eigen::MatrixXd> factor(total);
  return {prior * factor.solve(reading.value), prior - prior * factor.solve(prior)};
}

// The length of a part, over the forms that have it: root mean square, and uncertainty by the
// variance of the square. For a normal vector of mean m and covariance C the square has the mean
// m'm + tr C and the variance 4 m'Cm + 2 tr CC.
class Length {
 public:
  void add(double weight, const Part& part) {
    const double mean = part.mean.squaredNorm() + part.covariance.trace();
    const double variance = 4 * part.mean.dot(part.covariance * part.mean) +
                            2 * part.covariance.cwiseProduct(part.covariance).sum();
    weight_ += weight;
    square_ += weight * mean;
    fourth_ += weight * (variance + mean * mean);
  }
  double size() const { return weight_ > 0 ? std::sqrt(square_ / weight_) : 0; }
  double standard_uncertainty() const {
    const double square = shared_square(size());
    return square > 0 ? std::sqrt(std::max(0.0, fourth_ / weight_ - square * square)) / (2 * size())
                      : 0;
  }

 private:
  double weight_ = 0;
  double square_ = 0;
  double fourth_ = 0;
};

ElementFinding finding_of(const Problem& problem, const Reading12& reading,
                          const Evidence& evidence) {
  constexpr double kNegligible_log = -14;
  ElementFinding out;
  out.probability = probability_of(evidence.log_odds);
  const Eigen::Index count = reading.value.size();
  double tilt_weight = 0;
  Eigen::VectorXd tilt_sum = Eigen::VectorXd::Zero(count);
  Eigen::MatrixXd tilt_squares = Eigen::MatrixXd::Zero(count, count);
  Length tilt;
  Length all;
  std::array<Length, 6> faces;
  for (const Hypothesis& each : evidence.hypotheses) {
    const double weight = std::exp(each.log_weight);
    out.tilt_probability += each.has_tilt ? out.probability * weight : 0;
    const bool counts = each.log_weight > kNegligible_log;
    const Eigen::MatrixXd covariance = counts ? covariance_of(each) : Eigen::MatrixXd();
    if (counts) {
      all.add(weight, part_of(reading, covariance, covariance));
    }
    if (counts && each.has_tilt) {
      const Part part = part_of(reading, tilt_covariance_of(each), covariance);
      tilt.add(weight, part);
      tilt_weight += weight;
      tilt_sum += weight * part.mean;
      tilt_squares += weight * (part.covariance + part.mean * part.mean.transpose());
    }
    for (const std::size_t face : each.faces) {
      if (face != kNoFace) {
        out.faces[face].probability += out.probability * weight;
      }
      if (face != kNoFace && counts) {
        faces[face].add(weight,
                        part_of(reading, each.face_variance * face_matrix(face), covariance));
      }
    }
  }
  const Eigen::VectorXd mean = tilt_sum / std::max(tilt_weight, 1e-300);  // 0 where no form is left
  if (!problem.is_skew) {
    Eigen::Index axis = 0;
    mean.cwiseAbs().maxCoeff(&axis);
    out.axis = static_cast<std::size_t>(axis);
    out.size = mean(axis);
    out.standard_uncertainty = std::sqrt(
        std::max(0.0, tilt_squares(axis, axis) / tilt_weight - shared_square(mean(axis))));
    out.value.assign(mean.begin(), mean.end());
    return out;
  }
  const double root_of_faces = std::sqrt(6.0);
  out.size = tilt.size() / root_of_faces;
  out.standard_uncertainty = tilt.standard_uncertainty() / root_of_faces;
  out.all_size = all.size() / root_of_faces;
  const Eigen::VectorXd pattern = basis().transpose() * mean;
  out.value.assign(pattern.begin(), pattern.end());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    out.faces[f].size = faces[f].size();
    out.faces[f].standard_uncertainty = faces[f].standard_uncertainty();
  }
  return out;
}

std::vector<Rival> rivals_of(const Problem& problem, const Search& search, std::size_t c,
                             double log_odds) {
  std::set<std::size_t> others = search.held();
  others.erase(c);
  const auto estimates = search.estimates_of(others);
  std::vector<Rival> out;
  for (std::size_t rival = 0; rival < problem.candidates.size(); ++rival) {
    const Candidate& candidate = problem.candidates[rival];
    if (rival != c && !others.contains(rival) &&
        search.evidence(rival, estimates).log_odds > log_odds - std::log(kRivalFactor)) {
      out.push_back({candidate.level, candidate.index});
    }
  }
  return out;
}

struct Elements {
  explicit Elements(const ModelSizes& sizes)
      : first_station(sizes.jigs),
        first_lot(first_station + sizes.stations),
        first_filter(first_lot + sizes.lots),
        all(first_filter + sizes.filters) {}
  std::size_t first_station;
  std::size_t first_lot;
  std::size_t first_filter;
  std::size_t all;

  std::vector<std::size_t> of(const ModelRun& run, bool with_filter) const {
    std::vector<std::size_t> out = {run.jig, first_station + run.station};
    if (run.lot) {
      out.push_back(first_lot + *run.lot);
    }
    if (with_filter) {
      out.push_back(first_filter + run.filter);
    }
    return out;
  }
};

void add_candidates(const std::vector<ModelRun>& runs, const ModelSizes& sizes,
                    const SharedEffectOptions& options, Problem& problem) {
  const Elements elements(sizes);
  std::vector<std::set<std::size_t>> jigs_of_station(sizes.stations);
  std::vector<std::set<std::size_t>> units_of_lot(sizes.lots);
  for (const ModelRun& run : runs) {
    jigs_of_station[run.station].insert(run.jig);
    if (run.lot) {
      units_of_lot[*run.lot].insert(run.unit);
    }
  }
  for (std::size_t j = 0; problem.is_skew && j < sizes.jigs; ++j) {
    problem.candidates.push_back({SharedLevel::jig, j, j});
  }
  for (std::size_t s = 0; s < sizes.stations; ++s) {
    // A station with one jig is that jig; zero and sensitivity are no jig's.
    if (jigs_of_station[s].size() > 1 || (!problem.is_skew && sizes.stations > 1)) {
      problem.candidates.push_back({SharedLevel::station, s, elements.first_station + s});
    }
  }
  for (std::size_t l = 0; l < sizes.lots; ++l) {
    if (units_of_lot[l].size() >= options.fewest_units) {
      problem.candidates.push_back({SharedLevel::lot, l, elements.first_lot + l});
    }
  }
}

QuantityFindings solve(const std::vector<ModelRun>& runs, const ModelSizes& sizes,
                       const SharedEffectOptions& options, Problem& problem,
                       const std::vector<Eigen::VectorXd>& readings) {
  add_candidates(runs, sizes, options, problem);
  problem.held_sd = kHeldOverLargest * problem.sizes.back();
  LevelPriors priors;
  priors[0].share = options.jig_share;
  priors[1].share = options.station_share;
  priors[2].share = options.lot_share;
  {
    Search first(problem, priors);
    first.run();
    LevelPriors learnt = priors;
    learn_levels(problem, first, options, learnt);
    priors = learnt;
  }
  Search search(problem, priors);
  search.run();

  QuantityFindings out;
  out.jigs.resize(problem.is_skew ? sizes.jigs : 0);
  out.stations.resize(sizes.stations);
  out.lots.resize(sizes.lots);
  out.scatter = search.scatter();
  for (std::size_t level = 0; level < priors.size(); ++level) {
    out.share[level] = priors[level].share;
  }
  const auto estimates = search.estimates_of(search.held());
  for (std::size_t c = 0; c < problem.candidates.size(); ++c) {
    const Candidate& candidate = problem.candidates[c];
    const Evidence evidence = search.evidence(c, estimates);
    ElementFinding finding =
        finding_of(problem, search.reading_of(candidate.element, estimates), evidence);
    if (search.held().contains(c)) {
      finding.rivals = rivals_of(problem, search, c, evidence.log_odds);
    }
    auto& list = candidate.level == SharedLevel::jig       ? out.jigs
                 : candidate.level == SharedLevel::station ? out.stations
                                                           : out.lots;
    list[candidate.index] = std::move(finding);
  }
  const Elements elements(sizes);
  for (std::size_t r = 0; r < runs.size(); ++r) {
    Eigen::VectorXd own = readings[r];
    const std::vector<std::size_t> acting = elements.of(runs[r], true);
    for (std::size_t g = 0; g < problem.groups.size(); ++g) {
      const Eigen::Index first = problem.first_column[g];
      const Eigen::Index count = problem.first_column[g + 1] - first;
      for (const HeldElement& held : search.elements_of(search.held(), g)) {
        if (std::find(acting.begin(), acting.end(), held.element) != acting.end()) {
          own.segment(first, count) -= estimates[g][held.element].value;
        }
      }
    }
    out.own.push_back(std::move(own));
  }
  return out;
}

Group make_group(const std::vector<ModelRun>& runs, const ModelSizes& sizes, bool is_skew,
                 const std::vector<Eigen::VectorXd>& readings, Eigen::Index first,
                 Eigen::Index count, const ScatterPrior& prior) {
  const Elements elements(sizes);
  std::vector<CrossedRun> crossed;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    crossed.push_back({is_skew ? runs[r].unit : runs[r].unit_and_filter,
                       elements.of(runs[r], !is_skew), readings[r].segment(first, count),
                       is_skew ? static_cast<double>(runs[r].readings.placements) : 1});
  }
  return {CrossedEffects(is_skew ? sizes.units : sizes.units_and_filters, elements.all,
                         std::move(crossed)),
          prior};
}

// Of the repeats within runs; none where there are few.
std::optional<double> scatter_of_placements(const std::vector<ModelRun>& runs) {
  constexpr double kFewest = 12;  // one repeat of all faces
  FaceRepeats sum;
  for (const ModelRun& run : runs) {
    for (const FaceRepeats& face : run.readings.repeats) {
      sum.square_deg2 += face.square_deg2;
      sum.degrees_of_freedom += face.degrees_of_freedom;
    }
  }
  if (sum.degrees_of_freedom < kFewest || !(sum.square_deg2 > 0)) {
    return std::nullopt;
  }
  return std::sqrt(sum.square_deg2 / sum.degrees_of_freedom);
}

QuantityFindings skew_findings(const std::vector<ModelRun>& runs, const ModelSizes& sizes,
                               const SharedEffectOptions& options) {
  std::vector<Eigen::VectorXd> readings;
  readings.reserve(runs.size());
  for (const ModelRun& run : runs) {
    readings.emplace_back(basis() * Eigen::Map<const Vector12>(run.readings.skew_deg.data()));
  }
  Problem problem;
  problem.is_skew = true;
  problem.sizes = options.skew_sizes_deg;
  problem.first_column.assign(kFirstOfGroup.begin(), kFirstOfGroup.end());
  std::array<ScatterPrior, 3> priors = {options.turn_deg, options.shear_deg, options.even_deg};
  if (const auto placement_deg = scatter_of_placements(runs)) {
    for (ScatterPrior& prior : priors) {
      prior.median.run = *placement_deg;
    }
  }
  for (const std::size_t g : {kTurn, kShear, kEven}) {
    problem.groups.push_back(make_group(runs, sizes, true, readings, kFirstOfGroup[g],
                                        kFirstOfGroup[g + 1] - kFirstOfGroup[g], priors[g]));
  }
  return solve(runs, sizes, options, problem, readings);
}

QuantityFindings axis_findings(const std::vector<ModelRun>& runs, const ModelSizes& sizes,
                               const SharedEffectOptions& options, const ScatterPrior& prior,
                               const std::array<double, 3>& effect_sizes,
                               const std::vector<Eigen::VectorXd>& readings) {
  Problem problem;
  problem.sizes = effect_sizes;
  problem.first_column = {0, 3};
  problem.groups.push_back(make_group(runs, sizes, false, readings, 0, 3, prior));
  const Elements elements(sizes);
  for (std::size_t f = 0; f < sizes.filters; ++f) {
    problem.always.push_back({elements.first_filter + f, std::nullopt});
  }
  return solve(runs, sizes, options, problem, readings);
}

}  // namespace

SharedEffects find_shared_effects(const std::vector<ModelRun>& runs, const ModelSizes& sizes,
                                  const SharedEffectOptions& options) {
  SharedEffects out;
  if (runs.empty()) {
    return out;
  }
  out.skew = skew_findings(runs, sizes, options);
  std::vector<Eigen::VectorXd> zero_mg;
  std::vector<Eigen::VectorXd> sensitivity_percent;
  for (const ModelRun& run : runs) {
    zero_mg.emplace_back(Eigen::Map<const Eigen::Vector3d>(run.readings.zero_mg.data()));
    Eigen::VectorXd logs(3);
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      logs(static_cast<Eigen::Index>(axis)) =
          100 * std::log(run.readings.sensitivity_lsb_per_g[axis]);
    }
    sensitivity_percent.push_back(std::move(logs));
  }
  out.zero = axis_findings(runs, sizes, options, options.zero_mg, options.zero_sizes_mg, zero_mg);
  out.sensitivity = axis_findings(runs, sizes, options, options.sensitivity_percent,
                                  options.sensitivity_sizes_percent, sensitivity_percent);
  return out;
}

}  // namespace sixpoint::station
