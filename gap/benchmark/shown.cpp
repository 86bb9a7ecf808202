#include "gap/benchmark/shown.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace sixpoint::gap {
namespace {

constexpr double kPiece_s = 10;
constexpr double kSeating_mg = 0.17;
constexpr double kGainSd_mg = 20;  // 2 % of 1 g
constexpr double kOffsetSd_mg = 35;
constexpr double kHost_s = 0.002 / 1.7320508075688772;  // standard deviation of +-2 ms
constexpr double kPlainCounts = 2;

// The mean difference of one axis over some seconds.
struct Piece {
  double mean_mg = 0;
  double rounding_mg2 = 0;  // variance of that mean by rounding
  double noise_mg2 = 0;     // of a mean, seating included
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
    std::vector<Piece> pieces;
    for (const sim::ProtocolSegment& segment : run_.segments) {
      const auto length = static_cast<std::uint64_t>(kPiece_s * run_.rate_hz);
      for (std::uint64_t first = 0; first < segment.samples; first += length) {
        const std::uint64_t count = std::min(length, segment.samples - first);
        pieces.push_back(piece(segment, first, count, axis, noise_mg2));
      }
    }
    take_out_gain_and_offset(pieces);
    for (const Piece& piece : pieces) {
      const double square =
          (piece.mean_mg * piece.mean_mg - piece.rounding_mg2) / piece.noise_mg2;
      shown_.means += square;
      shown_.by_place[{static_cast<int>(axis), *piece.segment}] += square;
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
    const auto difference = [&](std::uint64_t i) {
      const std::size_t at = segment.first_sample + first + i;
      return lsb_mg_ * (with_.counts[at][axis] - without_.counts[at][axis]);
    };
    const auto n = static_cast<double>(count);
    double sum = 0, squares = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      sum += difference(i);
      squares += difference(i) * difference(i);
    }
    Piece made;
    made.mean_mg = sum / n;
    made.rounding_mg2 = std::max(0.0, squares / n - made.mean_mg * made.mean_mg) / n;
    made.noise_mg2 = noise_mg2 / n + kSeating_mg * kSeating_mg;
    made.gravity = segment.rotation(static_cast<Eigen::Index>(axis), 2);
    made.segment = &segment.name;
    double plain = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      const double off = difference(i) - made.mean_mg;
      plain += std::abs(off) > kPlainCounts * lsb_mg_ ? off * off / noise_mg2 : 0;
    }
    shown_.samples += plain;
    shown_.by_place[{static_cast<int>(axis), segment.name}] += plain;
    return made;
  }

  // Weighted least squares with the priors of a unit; what they take is evidence, too.
  void take_out_gain_and_offset(std::vector<Piece>& pieces) {
    Eigen::Matrix2d normal;
    normal << 1 / (kOffsetSd_mg * kOffsetSd_mg), 0, 0, 1 / (kGainSd_mg * kGainSd_mg);
    const Eigen::Matrix2d prior = normal;
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (const Piece& piece : pieces) {
      const Eigen::Vector2d row(1, piece.gravity);
      normal += row * row.transpose() / piece.noise_mg2;
      right += row * piece.mean_mg / piece.noise_mg2;
    }
    const Eigen::Vector2d fitted = normal.ldlt().solve(right);
    for (Piece& piece : pieces) {
      piece.mean_mg -= fitted[0] + fitted[1] * piece.gravity;
    }
    shown_.means += fitted.dot(prior * fitted);
  }

  const sim::ProtocolRun& run_;
  const sim::ProtocolRecord& without_;
  const sim::ProtocolRecord& with_;
  Shown& shown_;
  double lsb_mg_;
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
