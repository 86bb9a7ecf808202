#include "gap/benchmark/shown.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace sixpoint::gap {
namespace {

constexpr double kShownPiece_s = 10;
constexpr double kGainSd_mg = 20;  // 2 % of 1 g
constexpr double kOffsetSd_mg = 35;
constexpr double kHost_s = 0.002 / 1.7320508075688772;  // standard deviation of +-2 ms
constexpr double kPlainCounts = 1.25;  // a steady change that is rounded scatters by less than 1

// What one axis shows over some seconds, or over a segment, of the numbers of the unit that are free:
// its offset, its gain, and the turns of its seat about the other two axes. Sums in noise^-2.
struct Sums {
  std::array<Eigen::Index, 4> numbers{};  // which they are of all
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  double square = 0;
  int axis = 0;
  const std::string* segment = nullptr;
  bool of_samples = false;

  void add(const Eigen::Vector4d& row, double value_mg, double variance_mg2) {
    normal += row * row.transpose() / variance_mg2;
    right += row * value_mg / variance_mg2;
    square += value_mg * value_mg / variance_mg2;
  }
  // Beyond what these values of the numbers make.
  double beyond(const Eigen::VectorXd& all) const {
    const Eigen::Vector4d own(all[numbers[0]], all[numbers[1]], all[numbers[2]], all[numbers[3]]);
    return square - own.dot(2 * right - normal * own);
  }
};

// What a unit at `force_g` shows on an axis of an offset, a gain and turns of its seat of one each,
// in mg, g^-1 and rad times 1000.
Eigen::Vector4d row_of(std::size_t axis, double offset, const Eigen::Vector3d& force_g) {
  const auto of = [&](std::size_t a) { return force_g[static_cast<Eigen::Index>(a % kAxes)]; };
  return {offset, of(axis), of(axis + 2), -of(axis + 1)};
}

// The mean difference of one axis over some seconds.
struct Piece {
  double mean_mg = 0;
  double rounding_mg2 = 0;  // variance of that mean by rounding
  double noise_mg2 = 0;     // the same by noise
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

  void of_means_and_samples() {
    int seat = -1;
    for (std::size_t k = 0; k < run_.segments.size(); ++k) {
      const sim::ProtocolSegment& segment = run_.segments[k];
      if (k == 0 || !sim::same_placement(run_.segments[k - 1], segment, run_.rate_hz)) {
        ++seat;
      }
      for (std::size_t axis = 0; axis < kAxes; ++axis) {
        of_segment(segment, axis, seat);
      }
    }
    take_out_the_units_own(seat + 1);
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
  // Offsets, gains, then three turns of each seat.
  static Eigen::Index seat_at(int seat, std::size_t axis) {
    return static_cast<Eigen::Index>(2 * kAxes + kAxes * static_cast<std::size_t>(seat) +
                                     axis % kAxes);
  }
  Sums sums_of(const sim::ProtocolSegment& segment, std::size_t axis, int seat) const {
    Sums sums;
    sums.numbers = {static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(kAxes + axis),
                    seat_at(seat, axis + 1), seat_at(seat, axis + 2)};
    sums.axis = static_cast<int>(axis);
    sums.segment = &segment.name;
    return sums;
  }

  void of_segment(const sim::ProtocolSegment& segment, std::size_t axis, int seat) {
    const auto length = static_cast<std::uint64_t>(kShownPiece_s * run_.rate_hz);
    std::vector<Piece> pieces;
    for (std::uint64_t first = 0; first < segment.samples; first += length) {
      const std::uint64_t count = std::min(length, segment.samples - first);
      pieces.push_back(piece(segment, first, count, axis, seat));
    }
    if (!pieces.empty()) {
      add_means(segment, pieces, axis, seat);
    }
  }

  // The mean; what differs from it by more than rounding goes into `sums_`.
  Piece piece(const sim::ProtocolSegment& segment, std::uint64_t first, std::uint64_t count,
              std::size_t axis, int seat) {
    const double noise_mg2 = std::pow(run_.noise_mg[axis], 2) + lsb_mg_ * lsb_mg_ / 12;
    const auto counts = [&](std::uint64_t i) -> const gt3x::Counts& {
      return without_.counts[segment.first_sample + first + i];
    };
    const auto difference = [&](std::uint64_t i) {
      return lsb_mg_ * (with_.counts[segment.first_sample + first + i][axis] - counts(i)[axis]);
    };
    const auto force_g = [&](std::uint64_t i) {
      return Eigen::Vector3d(Eigen::Vector3d(counts(i)[0], counts(i)[1], counts(i)[2]) * lsb_mg_ /
                             kMgPerG);
    };
    const auto n = static_cast<double>(count);
    double sum = 0, squares = 0;
    Eigen::Vector3d mean_g = Eigen::Vector3d::Zero();
    for (std::uint64_t i = 0; i < count; ++i) {
      sum += difference(i);
      squares += difference(i) * difference(i);
      mean_g += force_g(i) / n;
    }
    Piece made;
    made.mean_mg = sum / n;
    made.rounding_mg2 = std::max(0.0, squares / n - made.mean_mg * made.mean_mg) / n;
    made.noise_mg2 = noise_mg2 / n;
    Sums& plain = sums_.emplace_back(sums_of(segment, axis, seat));
    plain.of_samples = true;
    for (std::uint64_t i = 0; i < count; ++i) {
      const double off = difference(i) - made.mean_mg;
      if (std::abs(off) > kPlainCounts * lsb_mg_) {
        plain.add(row_of(axis, 0, force_g(i) - mean_g), off, noise_mg2);
      }
    }
    return made;
  }

  // The mean of a segment goes into `sums_`; in what its pieces differ from it offset, gain and seat
  // have no part.
  void add_means(const sim::ProtocolSegment& segment, const std::vector<Piece>& pieces,
                 std::size_t axis, int seat) {
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
      const double off_mg = piece.mean_mg - all.mean_mg;
      const double square = (off_mg * off_mg - (1 - share) * piece.rounding_mg2) / piece.noise_mg2;
      shown_.means += square;
      shown_.by_place[{static_cast<int>(axis), segment.name}] += square;
    }
    Sums& mean = sums_.emplace_back(sums_of(segment, axis, seat));
    mean.add(row_of(axis, 1, segment.rotation.col(2)), all.mean_mg, 1 / weights);
    mean.square -= all.rounding_mg2 * weights;
  }

  // Weighted least squares with the priors of a unit; what they take is evidence, too.
  void take_out_the_units_own(int seats) {
    const Eigen::Index n = seat_at(seats, 0);
    Eigen::VectorXd prior = Eigen::VectorXd::Constant(n, 1 / (kSeating_mg * kSeating_mg));
    prior.head<3>().setConstant(1 / (kOffsetSd_mg * kOffsetSd_mg));
    prior.segment<3>(3).setConstant(1 / (kGainSd_mg * kGainSd_mg));
    Eigen::MatrixXd normal = prior.asDiagonal();
    Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
    for (const Sums& sums : sums_) {
      for (std::size_t i = 0; i < sums.numbers.size(); ++i) {
        right[sums.numbers[i]] += sums.right[static_cast<Eigen::Index>(i)];
        for (std::size_t j = 0; j < sums.numbers.size(); ++j) {
          normal(sums.numbers[i], sums.numbers[j]) +=
              sums.normal(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
        }
      }
    }
    const Eigen::VectorXd fitted = normal.ldlt().solve(right);
    const Eigen::VectorXd taken = fitted.cwiseAbs2().cwiseProduct(prior);
    const Eigen::VectorXd known = (normal.diagonal() - prior).cwiseMax(1e-12);
    shown_.means += taken.sum();
    for (const Sums& sums : sums_) {
      const double square = sums.beyond(fitted);
      (sums.of_samples ? shown_.samples : shown_.means) += square;
      // What a seat takes stands where it shows.
      double of_seat = 0;
      for (std::size_t i = 2; i < sums.numbers.size(); ++i) {
        const auto at = static_cast<Eigen::Index>(i);
        of_seat += taken[sums.numbers[i]] * sums.normal(at, at) / known[sums.numbers[i]];
      }
      shown_.by_place[{sums.axis, *sums.segment}] += square + of_seat;
    }
  }

  const sim::ProtocolRun& run_;
  const sim::ProtocolRecord& without_;
  const sim::ProtocolRecord& with_;
  Shown& shown_;
  double lsb_mg_;
  std::vector<Sums> sums_;
};

}  // namespace

double Shown::index() const {
  return std::sqrt(std::max(0.0, means) + samples + std::max(0.0, times));
}

Shown what_is_shown(const sim::ProtocolRun& nominal, const sim::ProtocolRecord& without,
                    const sim::ProtocolRecord& with) {
  Shown shown;
  Comparison comparison(nominal, without, with, shown);
  comparison.of_means_and_samples();
  comparison.of_times();
  return shown;
}

}  // namespace sixpoint::gap
