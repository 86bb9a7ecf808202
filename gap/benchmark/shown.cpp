#include "gap/benchmark/shown.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace sixpoint::gap {
namespace {

constexpr double kShownPiece_s = 10;
constexpr double kGainSd_mg = 20;  // 2 % of 1 g
constexpr double kOffsetSd_mg = 35;
constexpr double kHost_s = 0.002 / 1.7320508075688772;  // standard deviation of +-2 ms
constexpr double kPlainCounts = 1.25;  // a steady change that is rounded scatters by less than 1

// What differs by more than rounding, of one axis over some seconds: sums in noise^-2.
struct Plain {
  double difference2 = 0, product = 0, stimulus2 = 0;  // of differences in mg and stimuli in g
  const std::string* segment = nullptr;

  // Beyond what a gain makes of the stimulus.
  double beyond(double gain_mg) const {
    return difference2 - gain_mg * (2 * product - gain_mg * stimulus2);
  }
};

// The mean difference of one axis over some seconds, or over a segment.
struct Piece {
  double mean_mg = 0;
  double rounding_mg2 = 0;  // variance of that mean by rounding
  double noise_mg2 = 0;     // the same by noise, of a segment by seating, too
  double gravity = 0;       // along the axis
  const std::string* segment = nullptr;
};

class Comparison {
 public:
  Comparison(const sim::ProtocolRun& run, const sim::ProtocolRecord& without,
             const sim::ProtocolRecord& with, Shown& shown)
      : run_(run),
        without_(without),
        with_(with),
        shown_(shown),
        lsb_mg_(kMgPerG / run.accel_scale_lsb_per_g) {}

  void of_axis(std::size_t axis) {
    const double noise_mg2 = std::pow(run_.noise_mg[axis], 2) + lsb_mg_ * lsb_mg_ / 12;
    std::vector<Piece> segments;
    plain_.clear();
    for (const sim::ProtocolSegment& segment : run_.segments) {
      const auto length = static_cast<std::uint64_t>(kShownPiece_s * run_.rate_hz);
      std::vector<Piece> pieces;
      for (std::uint64_t first = 0; first < segment.samples; first += length) {
        const std::uint64_t count = std::min(length, segment.samples - first);
        pieces.push_back(piece(segment, first, count, axis, noise_mg2));
      }
      if (!pieces.empty()) {
        segments.push_back(whole(segment, pieces, axis));
      }
    }
    const double gain_mg = take_out_gain_and_offset(segments);
    for (const Piece& segment : segments) {
      add_mean(segment, static_cast<int>(axis));
    }
    for (const Plain& plain : plain_) {
      shown_.samples += plain.beyond(gain_mg);
      shown_.by_place[{static_cast<int>(axis), *plain.segment}] += plain.beyond(gain_mg);
    }
  }

  void of_times() {
    const auto packet = static_cast<std::uint64_t>(run_.rate_hz);
    for (const sim::ProtocolSegment& segment : run_.segments) {
      double sum = 0, squares = 0, n = 0;
      for (std::uint64_t i = 0; packet > 0 && i < segment.samples; i += packet) {
        const std::size_t at = segment.first_sample + i;
        const double late_s = with_.sample_time_s[at] - without_.sample_time_s[at];
        sum += late_s;
        squares += late_s * late_s;
        n += 1;
      }
      shown_.times += n > 0 ? (squares - sum * sum / n) / (kHost_s * kHost_s) : 0;
    }
  }

 private:
  Piece piece(const sim::ProtocolSegment& segment, std::uint64_t first, std::uint64_t count,
              std::size_t axis, double noise_mg2) {
    const auto stimulus_mg = [&](std::uint64_t i) {
      return lsb_mg_ * without_.counts[segment.first_sample + first + i][axis];
    };
    const auto difference = [&](std::uint64_t i) {
      return lsb_mg_ * with_.counts[segment.first_sample + first + i][axis] - stimulus_mg(i);
    };
    const auto n = static_cast<double>(count);
    double sum = 0, squares = 0, stimuli = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      sum += difference(i);
      squares += difference(i) * difference(i);
      stimuli += stimulus_mg(i);
    }
    Piece made;
    made.mean_mg = sum / n;
    made.rounding_mg2 = std::max(0.0, squares / n - made.mean_mg * made.mean_mg) / n;
    made.noise_mg2 = noise_mg2 / n;
    made.segment = &segment.name;
    Plain& plain = plain_.emplace_back();
    plain.segment = &segment.name;
    for (std::uint64_t i = 0; i < count; ++i) {
      const double off = difference(i) - made.mean_mg;
      if (std::abs(off) > kPlainCounts * lsb_mg_) {
        const double stimulus = (stimulus_mg(i) - stimuli / n) / kMgPerG;
        plain.difference2 += off * off / noise_mg2;
        plain.product += off * stimulus / noise_mg2;
        plain.stimulus2 += stimulus * stimulus / noise_mg2;
      }
    }
    return made;
  }

  // The mean of a segment's pieces; what they differ from it has no part in the seating.
  Piece whole(const sim::ProtocolSegment& segment, const std::vector<Piece>& pieces,
              std::size_t axis) {
    Piece all;
    double weights = 0;
    for (const Piece& piece : pieces) {
      all.mean_mg += piece.mean_mg / piece.noise_mg2;
      weights += 1 / piece.noise_mg2;
    }
    all.mean_mg /= weights;
    for (const Piece& piece : pieces) {
      const double share = 1 / piece.noise_mg2 / weights;
      all.rounding_mg2 += share * share * piece.rounding_mg2;
      Piece beside = piece;
      beside.mean_mg -= all.mean_mg;
      beside.rounding_mg2 *= 1 - share;
      add_mean(beside, static_cast<int>(axis));
    }
    all.noise_mg2 = 1 / weights + kSeating_mg * kSeating_mg;
    all.gravity = segment.rotation(static_cast<Eigen::Index>(axis), 2);
    all.segment = &segment.name;
    return all;
  }

  void add_mean(const Piece& piece, int axis) {
    const double square = (piece.mean_mg * piece.mean_mg - piece.rounding_mg2) / piece.noise_mg2;
    shown_.means += square;
    shown_.by_place[{axis, *piece.segment}] += square;
  }

  // Weighted least squares with the priors of a unit; what they take is evidence, too. Answers with
  // the gain.
  double take_out_gain_and_offset(std::vector<Piece>& pieces) {
    Eigen::Matrix2d normal;
    normal << 1 / (kOffsetSd_mg * kOffsetSd_mg), 0, 0, 1 / (kGainSd_mg * kGainSd_mg);
    const Eigen::Matrix2d prior = normal;
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (const Piece& piece : pieces) {
      const Eigen::Vector2d row(1, piece.gravity);
      normal += row * row.transpose() / piece.noise_mg2;
      right += row * piece.mean_mg / piece.noise_mg2;
    }
    for (const Plain& plain : plain_) {
      normal(1, 1) += plain.stimulus2;
      right[1] += plain.product;
    }
    const Eigen::Vector2d fitted = normal.ldlt().solve(right);
    for (Piece& piece : pieces) {
      piece.mean_mg -= fitted[0] + fitted[1] * piece.gravity;
    }
    shown_.means += fitted.dot(prior * fitted);
    return fitted[1];
  }

  const sim::ProtocolRun& run_;
  const sim::ProtocolRecord& without_;
  const sim::ProtocolRecord& with_;
  Shown& shown_;
  double lsb_mg_;
  std::vector<Plain> plain_;  // of this axis
};

}  // namespace

double Shown::index() const {
  return std::sqrt(std::max(0.0, means) + samples + std::max(0.0, times));
}

Shown what_is_shown(const sim::ProtocolRun& nominal, const sim::ProtocolRecord& without,
                    const sim::ProtocolRecord& with) {
  Shown shown;
  Comparison comparison(nominal, without, with, shown);
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    comparison.of_axis(axis);
  }
  comparison.of_times();
  return shown;
}

}  // namespace sixpoint::gap
