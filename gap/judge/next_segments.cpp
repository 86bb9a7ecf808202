#include "gap/judge/next_segments.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "gap/explain/catalogue.h"

namespace sixpoint::gap {
namespace {

constexpr double kLeastNats = 0.01;  // a question of which a segment says less is not named
constexpr double kCertain = 0.99;    // a name that is this likely is no question any more
constexpr double kEvenOdds = 0.5;
constexpr double kBeyondDoubt_nats = 1e9;
// Of the typical sizes and a fifth of them, but not of a fifth of that (parameter_groups()).
constexpr double kSmallestOverPrior = 3;

// `axis` up (or down), turned about the vertical.
Eigen::Matrix3d planned_face(int axis, double sign, double yaw_rad = 0) {
  const Eigen::Vector3d up = sign * Eigen::Vector3d::Unit(axis);
  return Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), up).toRotationMatrix() *
         Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

// Directions, even over the sphere.
std::vector<PlannedPiece> planned_obliques(int count) {
  std::vector<PlannedPiece> pieces;
  for (int i = 0; i < count; ++i) {  // a Fibonacci lattice
    const double z = 1 - (2.0 * i + 1) / count;
    const double longitude = i * std::numbers::pi * (3 - std::sqrt(5.0));
    const Eigen::Vector3d up(std::sqrt(1 - z * z) * std::cos(longitude),
                             std::sqrt(1 - z * z) * std::sin(longitude), z);
    pieces.push_back(
        {Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), up).toRotationMatrix()});
  }
  return pieces;
}

std::vector<PlannedPiece> six_faces(double pause_s, double seconds, bool reversed,
                                    std::optional<double> temperature_c = {}) {
  std::vector<PlannedPiece> pieces;
  for (int i = 0; i < 6; ++i) {
    const int pose = reversed ? 5 - i : i;
    pieces.push_back(
        {planned_face(pose / 2, pose % 2 == 0 ? 1 : -1), pause_s, seconds, true, temperature_c});
  }
  return pieces;
}

std::vector<PlannedPiece> yaws() {
  std::vector<PlannedPiece> pieces;
  for (int quarter = 0; quarter < 4; ++quarter) {
    for (int pose = 0; pose < 6; ++pose) {
      pieces.push_back(
          {planned_face(pose / 2, pose % 2 == 0 ? 1 : -1, quarter * std::numbers::pi / 2)});
    }
  }
  return pieces;
}

std::vector<PlannedPiece> half_turn() {
  std::vector<PlannedPiece> pieces;
  pieces.reserve(3);
  for (int axis = 0; axis < 3; ++axis) {
    pieces.push_back({planned_face(axis, 1, std::numbers::pi)});
  }
  return pieces;
}

std::vector<PlannedPiece> still(double pause_s, int minutes, std::optional<double> from_c = {},
                                std::optional<double> to_c = {}) {
  std::vector<PlannedPiece> pieces;
  for (int i = 0; i < minutes; ++i) {
    const bool first = i == 0;
    std::optional<double> celsius = from_c;
    if (from_c && to_c) {
      celsius = *from_c + (*to_c - *from_c) * i / (minutes - 1);
    }
    pieces.push_back({planned_face(2, 1), first ? pause_s : 0, 60, first, celsius});
  }
  return pieces;
}

std::vector<PlannedPiece> shaker(const std::vector<double>& frequencies_hz, double most_g) {
  std::vector<PlannedPiece> pieces;
  constexpr double kStroke_m = 0.01;
  for (int axis = 0; axis < 3; ++axis) {
    bool first = true;
    for (const double frequency_hz : frequencies_hz) {
      const double omega = 2 * std::numbers::pi * frequency_hz;
      const double reach_g = std::max(most_g > 1 ? most_g : 0, kStroke_m * omega * omega / 9.81);
      pieces.push_back({planned_face(axis, 1),
                        first ? 80.0 : 3.0,
                        10,
                        first,
                        {},
                        std::min(most_g, reach_g),
                        frequency_hz});
      first = false;
    }
  }
  return pieces;
}

std::vector<PlannedPiece> soak() {
  std::vector<PlannedPiece> pieces = six_faces(6, 30, false, 12.0);
  const std::vector<PlannedPiece> warm = six_faces(6, 30, false, 40.0);
  pieces.insert(pieces.end(), warm.begin(), warm.end());
  pieces[0].pause_s = pieces[6].pause_s = 2100;  // the chamber's way there
  return pieces;
}

// A pose lies about the vertical as it lay in the recording, where that has it: repeated faces are
// no turned ones.
Eigen::Matrix3d as_recorded(const Eigen::Matrix3d& planned, const std::vector<Block>& recorded) {
  constexpr double kSamePose = 0.999;  // cosine
  const Eigen::Vector3d up = planned.col(2);
  const auto same = std::ranges::find_if(
      recorded, [&](const Block& block) { return block.rotation.col(2).dot(up) > kSamePose; });
  if (same == recorded.end()) {
    return planned;
  }
  const Eigen::Matrix3d untwisted =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), up).toRotationMatrix();
  return same->rotation * (untwisted.transpose() * planned);
}

// Planned pieces as blocks that follow those of the recording.
std::vector<Block> blocks_of(const std::vector<PlannedPiece>& pieces,
                             const std::vector<Block>& recorded, double rate_hz) {
  std::vector<Block> blocks;
  Block block = recorded.back();
  ++block.session;
  const double room_c = block.temperature_c;
  double at_s = block.middle_s + block.seconds / 2;
  for (const PlannedPiece& piece : pieces) {
    at_s += piece.pause_s;
    if (piece.placed) {
      ++block.placement;
      block.approach_g = piece.rotation.col(2) - block.rotation.col(2);
      hold_step(block.held_sign, block.approach_g);
    }
    block.rotation = as_recorded(piece.rotation, recorded);
    block.seconds = piece.seconds;
    block.middle_s = at_s + piece.seconds / 2;
    at_s += piece.seconds;
    block.temperature_c = piece.temperature_c.value_or(room_c);
    block.tone = piece.vibration_g > 0;
    block.harmonics = piece.vibration_g > 4;
    block.vibration_lab_g = piece.vibration_g * Eigen::Vector3d::UnitZ();
    if (block.tone) {
      piece.rotation.col(2).cwiseAbs().maxCoeff(&block.axis);
    }
    const Eigen::Vector3d mean_mg2 = block.noise_mg.array().square() / (piece.seconds * rate_hz);
    const Eigen::Index size = block.harmonics ? 8 : block.tone ? 6 : 3;
    block.value_mg = Eigen::VectorXd::Zero(size);
    // An amplitude has twice the variance of a mean.
    Eigen::VectorXd variance_mg2 = Eigen::VectorXd::Constant(size, 2 * mean_mg2[block.axis]);
    variance_mg2.head<3>() = mean_mg2;
    if (block.tone) {
      variance_mg2.segment<3>(kToneAmplitude) = 2 * mean_mg2;
    }
    block.white_mg2 = variance_mg2.asDiagonal();
    if (piece.frequency_hz < rate_hz / 2) {
      blocks.push_back(block);
    }
  }
  return blocks;
}

// The recording's information, and that of a segment beside it.
class Expectation {
 public:
  Expectation(const Request& request, const Explanation& explanation)
      : model_(explanation.model()),
        best_(explanation.best()),
        rate_hz_(request.bundle.rate_hz),
        own_(model_
                 .whiten(model_.linearise(best_.state), best_.scatter, best_.scatter_size,
                         best_.seats_deg)
                 .sums),
        after_(own_) {}

  void plan(const std::vector<PlannedPiece>& pieces) {
    const std::vector<Block> blocks = blocks_of(pieces, model_.blocks(), rate_hz_);
    EvidenceModel planned(blocks, model_.options());
    for (int g = 0; g < planned.group_count(); ++g) {
      if (planned.group(g).tau_s > 0) {
        planned.set_time_constant(g, model_.group(g).tau_s);
      }
    }
    after_ = own_;
    after_.a += planned.whiten(planned.linearise(best_.state), Scatter::nominal, 0).sums.a;
  }

  bool in_means(const std::string& effect) const { return !model_.groups_of(effect).empty(); }

  // What is known of the effect, of any size and shape, beside everything else that was found.
  double prior(const std::string& effect) const {
    const std::vector<int> own = model_.groups_of(effect);
    const std::vector<int> others = without(own);
    if (own.empty()) {  // the means do not show it: it counts like one that they do
      return probability_of(log_prior_of_count(others.size() + 1) -
                            log_prior_of_count(others.size()));
    }
    double odds = 0;
    for (const int g : own) {
      odds += std::exp(model_.log_prior(with_group(others, g)) - model_.log_prior(others));
    }
    return odds / (1 + odds);
  }

  // Weight of evidence for the effect that the planned segment adds. `beside`: an effect that
  // could stand in its place.
  double weight_nats(const std::string& effect, const std::string& beside = {}) const {
    std::vector<int> others = without(model_.groups_of(effect));
    if (!beside.empty()) {
      others = with_group(others, likeliest(beside, without(model_.groups_of(beside))));
    }
    const int g = likeliest(effect, others);
    const Size now = size_of(g, others, own_);
    const Size then = size_of(g, others, after_);
    const Eigen::LLT<Eigen::MatrixXd> before(now.covariance), after(then.covariance);
    if (before.info() != Eigen::Success || after.info() != Eigen::Success) {
      return 0;
    }
    const Eigen::MatrixXd ratio = after.solve(now.covariance);
    const double moved = now.mean.dot(after.solve(now.mean) - before.solve(now.mean));
    const double log_det = 2 * (half_log_determinant(before) - half_log_determinant(after));
    return 0.5 * std::max(0.0, ratio.trace() - static_cast<double>(ratio.rows()) - log_det + moved);
  }

  // Whether the planned segment leaves a third or less of a standard uncertainty of an effect of
  // the explanation, with the priors of Explanation::estimate().
  bool settles(const std::string& effect) const {
    constexpr double kSettled = 3;
    const std::vector<int> own = model_.groups_of(effect);
    std::vector<int> groups = best_.subset.groups;
    const auto at = std::ranges::find_first_of(groups, own);
    if (at == groups.end()) {
      return false;
    }
    const int g = model_.widest(*at);
    groups.erase(at);
    std::ranges::transform(groups, groups.begin(), [&](int each) { return model_.widest(each); });
    const Eigen::VectorXd now = size_of(g, groups, own_).covariance.diagonal();
    const Eigen::VectorXd then = size_of(g, groups, after_).covariance.diagonal();
    return (now.array() > kSettled * kSettled * then.array()).any();
  }

 private:
  struct Size {
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
  };

  std::vector<int> without(const std::vector<int>& own) const {
    std::vector<int> others = best_.subset.groups;
    std::erase_if(others, [&](int g) { return std::find(own.begin(), own.end(), g) != own.end(); });
    return others;
  }

  // The size and shape of the effect that the recording supports most, but for sizes far below the
  // smallest realistic one: a recording supports these because it says nothing of them.
  int likeliest(const std::string& effect, const std::vector<int>& others) const {
    int chosen = -1;
    double most = kNoEvidence_nats;
    for (const int g : model_.groups_of(effect)) {
      if (model_.group(g).smallest > kSmallestOverPrior * model_.group(g).prior_sd) {
        continue;
      }
      const double nats = model_.solve(own_, with_group(others, g)).nats;
      if (chosen < 0 || nats > most) {
        most = nats;
        chosen = g;
      }
    }
    return chosen;
  }

  Size size_of(int g, const std::vector<int>& others, const NormalSums& sums) const {
    const Posterior posterior = model_.solve(sums, with_group(others, g)).posterior();
    const auto at = std::find(posterior.columns.begin() + kNuisanceParameters,
                              posterior.columns.end(), model_.first_column(g)) -
                    posterior.columns.begin();
    const Eigen::Index count = std::min(3, model_.group(g).count);
    return {posterior.mean.segment(at, count), posterior.covariance.block(at, at, count, count)};
  }

  const EvidenceModel& model_;
  const Fit& best_;
  double rate_hz_;
  NormalSums own_;
  NormalSums after_;
};

// Whether the recording with this segment has what the effect needs, and which segment shows it.
bool enough(const Offer& offer, unsigned abilities, const CatalogueEntry& entry) {
  return (entry.needs & ~(abilities | offer.gives)) == 0;
}

// Of an effect that samples show.
bool shows(const Offer& offer, unsigned abilities, const CatalogueEntry& entry,
           std::string_view needs_segment) {
  return enough(offer, abilities, entry) &&
         ((entry.needs & ~abilities & offer.gives) != 0 || needs_segment == offer.name);
}

class Questions {
 public:
  Questions(const Offer& offer, unsigned abilities, const Expectation& expected)
      : offer_(offer),
        abilities_(abilities),
        expected_(expected),
        next_{offer.name, offer.minutes(), 0, {}} {}

  void add_not_observable(const CatalogueEntry& entry, const std::string& needs_segment) {
    const std::string name(entry.name);
    if (!expected_.in_means(name)) {
      if (shows(offer_, abilities_, entry, needs_segment)) {
        ask(name, expected_.prior(name), kBeyondDoubt_nats);
      }
    } else if (enough(offer_, abilities_, entry)) {
      ask(name, expected_.prior(name), expected_.weight_nats(name));
    }
  }

  void add_observable(const CatalogueEntry& entry, double probability) {
    const std::string name(entry.name);
    if (expected_.in_means(name) && enough(offer_, abilities_, entry) && probability < kCertain) {
      ask(name, probability, expected_.weight_nats(name));
    }
  }

  void add_either(const std::string& name, const CatalogueEntry& other) {
    const std::string other_name(other.name);
    const bool in_means = expected_.in_means(name) && expected_.in_means(other_name);
    if (in_means ? enough(offer_, abilities_, other)
                 : shows(offer_, abilities_, other, other.segment)) {
      ask(name + "/" + other_name, kEvenOdds,
          in_means ? expected_.weight_nats(name, other_name) : kBeyondDoubt_nats);
    }
  }

  // How much each of two effects has that are both there.
  void add_shares(const std::string& name, const CatalogueEntry& other) {
    if (enough(offer_, abilities_, other) && expected_.settles(name)) {
      ask(name + "/" + std::string(other.name), kEvenOdds, kBeyondDoubt_nats);
    }
  }

  NextSegment next() && { return std::move(next_); }

 private:
  void ask(const std::string& question, double probability, double weight_nats) {
    const double nats = information_nats(probability, weight_nats);
    if (nats >= kLeastNats) {
      next_.expected_nats += nats;
      next_.separates.push_back(question);
    }
  }

  const Offer& offer_;
  unsigned abilities_;
  const Expectation& expected_;
  NextSegment next_;
};

}  // namespace

double Offer::minutes() const {
  double seconds = 0;
  for (const PlannedPiece& piece : pieces) {
    seconds += piece.pause_s + piece.seconds;
  }
  return std::round(seconds / 6) / 10;
}

const std::vector<Offer>& standard_offers() {
  static const std::vector<Offer> kOffers = {
      {"half_turn", 0, half_turn()},
      {"faces", kPoses | kMoves, six_faces(6, 10, false)},
      {"faces_reversed", kBothWays | kRepeats, six_faces(6, 10, true)},
      {"reseat", kRepeats, six_faces(20, 10, false)},
      {"yaw", kYaws | kRepeats | kBothWays, yaws()},
      {"oblique", 0, planned_obliques(18)},
      {"shaker", kShaker, shaker({2, 4, 7, 11, 16, 22, 30, 40}, 1)},
      // Its second tone clips: what is left of it is not counted here.
      {"shaker_high", kHighShaker | kFullScale, shaker({20}, 6)},
      {"still", kLongRecord | kHours, still(120, 20)},
      {"ramp_up", kTemperature | kHours, still(1700, 17, 15.0, 40.0)},
      {"soak", kSoak | kTemperature | kHours, soak()}};
  return kOffers;
}

double information_nats(double probability, double weight_nats) {
  const double p = probability;
  if (!(p > 0 && p < 1) || !(weight_nats > 0)) {
    return 0;
  }
  const double entropy = -p * std::log(p) - (1 - p) * std::log(1 - p);
  // Above this weight less than 1e-10 of the entropy is left.
  constexpr double kMost_nats = 100;
  if (weight_nats > kMost_nats) {
    return entropy;
  }
  // What is left of the entropy, by trapezoids over the reading: log(1 + e^x) without overflow.
  constexpr int kSteps = 400;
  constexpr double kReach_sd = 8;
  const auto soft = [](double x) {
    return x > 0 ? x + std::log1p(std::exp(-x)) : std::log1p(std::exp(x));
  };
  const double odds_nats = std::log(p / (1 - p));
  double left = 0, sum = 0;
  for (int i = 0; i <= kSteps; ++i) {
    const double x = kReach_sd * (2.0 * i / kSteps - 1);
    const double density = std::exp(-0.5 * x * x);
    const double spread = std::sqrt(2 * weight_nats) * x;
    left += density * (p * soft(-odds_nats - weight_nats - spread) +
                       (1 - p) * soft(odds_nats - weight_nats + spread));
    sum += density;
  }
  return std::clamp(entropy - left / sum, 0.0, entropy);
}

std::vector<NextSegment> next_segments(const Request& request, unsigned abilities,
                                       const Explanation& explanation, const Findings& found,
                                       const Diagnosis& out) {
  Expectation expected(request, explanation);
  // What list_not_observable() leaves out of a record without the unit's constants no segment shows.
  const auto can_be_judged = [&](std::string_view effect) {
    return !request.options.uncalibrated || effect != "filter_mismatch";
  };
  std::vector<NextSegment> list;
  for (const Offer& offer : standard_offers()) {
    expected.plan(offer.pieces);
    Questions questions(offer, abilities, expected);
    for (const CatalogueEntry& entry : catalogue()) {
      if (!can_be_judged(entry.name)) {
        continue;
      }
      const auto named = [&](const auto& f) { return f.name == entry.name; };
      const auto blind = std::find_if(out.not_observable.begin(), out.not_observable.end(),
                                      [&](const auto& n) { return n.first == entry.name; });
      if (blind != out.not_observable.end()) {
        questions.add_not_observable(entry, blind->second);
      } else if (const auto f =
                     std::find_if(found.candidates.begin(), found.candidates.end(), named);
                 f != found.candidates.end()) {
        questions.add_observable(entry, f->probability);
      }
    }
    for (const EffectFinding& e : found.effects) {
      for (const std::string& other : e.confounded_with) {
        const CatalogueEntry* entry = find_entry(other);
        if (!can_be_judged(other)) {
          continue;
        }
        if (entry != nullptr && !explanation.best().contains(other)) {
          questions.add_either(e.name, *entry);
        } else if (entry != nullptr && (!found.accepted(other) || e.name < other)) {  // once
          questions.add_shares(e.name, *entry);
        }
      }
    }
    if (NextSegment next = std::move(questions).next(); !next.separates.empty()) {
      list.push_back(std::move(next));
    }
  }
  std::sort(list.begin(), list.end(), [](const NextSegment& a, const NextSegment& b) {
    return a.expected_nats / a.minutes > b.expected_nats / b.minutes;
  });
  return list;
}

}  // namespace sixpoint::gap
