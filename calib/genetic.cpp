#include "calib/genetic.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "base/random.h"
#include "calib/coverage.h"
#include "calib/least_squares.h"

namespace sixpoint::calib {

namespace {

using Genes = std::array<double, 6>;  // relative change of sensitivity X Y Z, zero in g X Y Z

struct Member {
  Genes genes{};
  double error_g = HUGE_VAL;
};

// The points of one recursion, in g by the file's constants, as arrays of floats: a float holds g
// to 1e-7, and four or eight members' worth of points fit into a register.
struct Subset {
  static constexpr std::size_t kLanes = 8;
  PerAxis<std::vector<float>> level;
  std::vector<float> ramp;  // what slow turning takes from the square
  std::size_t size = 0;

  double error_g(const Genes& genes, float gravity_g) const {
    const auto gx = static_cast<float>(1 + genes[0]);
    const auto gy = static_cast<float>(1 + genes[1]);
    const auto gz = static_cast<float>(1 + genes[2]);
    const auto zx = static_cast<float>(genes[3]);
    const auto zy = static_cast<float>(genes[4]);
    const auto zz = static_cast<float>(genes[5]);
    const float* x = level[0].data();
    const float* y = level[1].data();
    const float* z = level[2].data();
    const float* r = ramp.data();
    std::array<float, kLanes> sum{};
    for (std::size_t i = 0; i < size; i += kLanes) {
      for (std::size_t k = 0; k < kLanes; ++k) {
        const float qx = gx * (x[i + k] - zx);
        const float qy = gy * (y[i + k] - zy);
        const float qz = gz * (z[i + k] - zz);
        sum[k] += std::abs(std::sqrt(qx * qx + qy * qy + qz * qz + r[i + k]) - gravity_g);
      }
    }
    double total = 0;
    for (const float part : sum) {
      total += static_cast<double>(part);
    }
    return total / static_cast<double>(size);
  }
};

Calibration calibration_of(const Genes& genes, const Calibration& base) {
  Calibration out;
  for (std::size_t a = 0; a < kAxes; ++a) {
    out.sensitivity_g_per_lsb[a] = base.sensitivity_g_per_lsb[a] * (1 + genes[a]);
    out.zero_lsb[a] = base.zero_lsb[a] + genes[3 + a] / base.sensitivity_g_per_lsb[a];
  }
  return out;
}

class Search {
 public:
  Search(std::span<const StillBlock> blocks, const Calibration& base, const GeneticOptions& options)
      : blocks_(blocks), base_(base), options_(options), random_(options.seed) {
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      for (std::size_t a = 0; a < kAxes; ++a) {
        const ValueSubset subset = value_subset(blocks[i].mean_g[a]);
        if (subset != ValueSubset::outside) {
          by_subset_[a * kSubsetsPerAxis + static_cast<std::size_t>(subset)].push_back(i);
        }
      }
    }
    const auto tenth =
        static_cast<std::size_t>(options.subset * static_cast<double>(blocks.size()));
    points_ = std::clamp(tenth, std::min(options.fewest_points, blocks.size()),
                         std::max<std::size_t>(1, options.most_points));
    // Whole registers: a few points more than asked for.
    points_ = (points_ + Subset::kLanes - 1) / Subset::kLanes * Subset::kLanes;
    for (int i = 0; i < options.population; ++i) {
      population_.push_back({random_genes()});
    }
    population_.front().genes = {};  // the file's own constants: unaffected files need no search
  }

  GeneticResult run() {
    GeneticResult result;
    std::vector<Genes> bests;
    for (int recursion = 0; recursion < options_.recursions; ++recursion) {
      draw();
      evaluate(0);
      for (int generation = 0; generation < options_.generations; ++generation) {
        breed();
        evaluate(1);
      }
      bests.push_back(population_.front().genes);
      result.fitness_mg.push_back(kMgPerG * population_.front().error_g);
    }
    judge(bests, result);
    return result;
  }

 private:
  Genes random_genes() {
    Genes genes{};
    for (std::size_t a = 0; a < kAxes; ++a) {
      genes[a] = random_.uniform(kLeastGain, kMostGain) - 1;
      genes[3 + a] = random_.uniform(-kMostZeroChange_g, kMostZeroChange_g);
    }
    return genes;
  }

  void add(std::size_t block_number) {
    const StillBlock& block = blocks_[block_number];
    double ramp = 0;
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double s = base_.sensitivity_g_per_lsb[a];
      subset_.level[a].push_back(static_cast<float>(base_.to_g(a, block.mean_lsb[a])));
      ramp += s * s * block.ramp_variance_lsb2[a];
    }
    subset_.ramp.push_back(static_cast<float>(ramp));
    ++subset_.size;
  }

  // This recursion's points: evenly over the value subsets that hold any, then some at random.
  void draw() {
    subset_ = {};
    std::vector<const std::vector<std::size_t>*> filled;
    for (const auto& members : by_subset_) {
      if (!members.empty()) {
        filled.push_back(&members);
      }
    }
    const auto random_points =
        filled.empty()
            ? points_
            : static_cast<std::size_t>(options_.random_share * static_cast<double>(points_));
    for (std::size_t i = 0; i + random_points < points_; ++i) {
      const auto& members = *filled[i % filled.size()];
      add(members[random_.below(members.size())]);
    }
    while (subset_.size < points_) {
      add(random_.below(blocks_.size()));
    }
  }

  void evaluate(std::size_t first) {
    const auto gravity = static_cast<float>(options_.gravity_g);
    for (std::size_t i = first; i < population_.size(); ++i) {
      population_[i].error_g = subset_.error_g(population_[i].genes, gravity);
    }
    std::stable_sort(
        population_.begin(), population_.end(),
        [](const Member& left, const Member& right) { return left.error_g < right.error_g; });
  }

  // Parents come from the better half, better ones more often.
  const Genes& parent() {
    const std::size_t half = std::max<std::size_t>(2, population_.size() / 2);
    return population_[std::min(random_.below(half), random_.below(half))].genes;
  }

  void breed() {
    std::vector<Member> next;
    next.reserve(population_.size());
    next.push_back(population_.front());
    const std::size_t bred =
        population_.size() - 1 - static_cast<std::size_t>(options_.random_members);
    while (next.size() < 1 + bred) {
      const Genes& mother = parent();
      const Genes& father = parent();
      Member child;
      if (random_.uniform() < 0.5) {
        // Somewhere on the line through both, also a little beyond either.
        const double t = random_.uniform(-0.3, 1.3);
        for (std::size_t i = 0; i < child.genes.size(); ++i) {
          child.genes[i] = mother[i] + t * (father[i] - mother[i]);
        }
      } else {
        for (std::size_t i = 0; i < child.genes.size(); ++i) {
          child.genes[i] = random_.uniform() < 0.5 ? mother[i] : father[i];
        }
      }
      // Mutation by the difference of two other members: its size and direction follow the
      // population's spread, which a fixed step cannot in a narrow valley. Small steps of any
      // direction besides, so that spread never dies.
      if (random_.uniform() < 0.8) {
        const Genes& one = parent();
        const Genes& other = parent();
        const double strength = random_.uniform(0.3, 1.1);
        for (std::size_t i = 0; i < child.genes.size(); ++i) {
          child.genes[i] += strength * (one[i] - other[i]);
        }
      }
      if (random_.uniform() < 0.1) {
        for (double& gene : child.genes) {
          gene += 0.002 * random_.normal();
        }
      }
      for (std::size_t a = 0; a < kAxes; ++a) {
        child.genes[a] = std::clamp(child.genes[a], kLeastGain - 1, kMostGain - 1);
        child.genes[3 + a] = std::clamp(child.genes[3 + a], -kMostZeroChange_g, kMostZeroChange_g);
      }
      next.push_back(child);
    }
    while (next.size() < population_.size()) {
      next.push_back({random_genes()});
    }
    population_ = std::move(next);
  }

  void judge(const std::vector<Genes>& bests, GeneticResult& result) const {
    const std::size_t begin = bests.size() / 2;
    const auto count = static_cast<double>(bests.size() - begin);
    Genes mean{};
    for (std::size_t r = begin; r < bests.size(); ++r) {
      for (std::size_t i = 0; i < mean.size(); ++i) {
        mean[i] += bests[r][i] / count;
      }
      result.level_mg += result.fitness_mg[r] / count;
    }
    result.calibration = calibration_of(mean, base_);
    double square = 0;
    double moment = 0;
    double index_square = 0;
    double square_apart = 0;
    for (std::size_t r = begin; r < bests.size(); ++r) {
      const double off = result.fitness_mg[r] - result.level_mg;
      const double index = static_cast<double>(r - begin) - 0.5 * (count - 1);
      square += off * off;
      moment += index * off;
      index_square += index * index;
      const double apart =
          difference_over_sphere(result.calibration, calibration_of(bests[r], base_)).rms_mg;
      square_apart += apart * apart;
    }
    result.spread_mg = count > 1 ? std::sqrt(square / (count - 1)) : HUGE_VAL;
    result.trend_mg = index_square > 0 ? moment / index_square * (count - 1) : HUGE_VAL;
    result.scatter_mg = std::sqrt(square_apart / count);
    if (!(result.level_mg <= options_.most_level_mg)) {
      result.reasons.push_back(
          fmt::format("the best fitness dithers about {:.1f} mg and not about 0 (limit {:.1f} mg)",
                      result.level_mg, options_.most_level_mg));
    }
    if (!(result.spread_mg <= options_.most_spread_mg)) {
      result.reasons.push_back(
          fmt::format("the best fitness spreads by {:.1f} mg (limit {:.1f} mg)", result.spread_mg,
                      options_.most_spread_mg));
    }
    if (!(std::abs(result.trend_mg) <= 2 * options_.most_spread_mg)) {
      result.reasons.push_back(
          fmt::format("the best fitness still tends by {:.1f} mg", result.trend_mg));
    }
    if (!(result.scatter_mg <= options_.most_scatter_mg)) {
      result.reasons.push_back(
          fmt::format("the best members of different subsets lie {:.1f} mg apart (limit {:.1f} mg)",
                      result.scatter_mg, options_.most_scatter_mg));
    }
    result.settled = result.reasons.empty();
  }

  std::span<const StillBlock> blocks_;
  Calibration base_;
  GeneticOptions options_;
  Random random_;
  std::array<std::vector<std::size_t>, kAxes * kSubsetsPerAxis> by_subset_;
  std::size_t points_ = 0;
  Subset subset_;
  std::vector<Member> population_;
};

}  // namespace

Result<GeneticResult> genetic(std::span<const StillBlock> blocks, const Calibration& file_constants,
                              const GeneticOptions& options) {
  SIXPOINT_CHECK(validate(file_constants));
  if (blocks.empty()) {
    return fail(ErrorCode::bad_data, "no still block", "genetic algorithm",
                "lay the unit still on each of its six sides for a minute");
  }
  for (const StillBlock& block : blocks) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      if (!std::isfinite(block.mean_g[a]) || !std::isfinite(block.mean_lsb[a]) ||
          !std::isfinite(block.ramp_variance_lsb2[a])) {
        return fail(ErrorCode::bad_data, "a still block is not a finite number",
                    "genetic algorithm", "the recording is damaged");
      }
    }
  }
  return Search(blocks, file_constants, options).run();
}

}  // namespace sixpoint::calib
