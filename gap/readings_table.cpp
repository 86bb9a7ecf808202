#include "gap/readings_table.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <zlib.h>

#include "gap/catalogue.h"
#include "gap/plain.h"

namespace sixpoint::gap {
namespace {

constexpr std::size_t kMostBlocks = 500'000;
constexpr std::size_t kLongestLine = 4096;
constexpr double kLogPrior = -3.5;  // as of every effect of a plain recording
constexpr double kAccept = 2.2;
constexpr double kLost_mg = 12;  // lengths this far off after all are nothing that is known

// Bytes of a file, unpacked where it is gzip.
class TextSource {
 public:
  TextSource(std::unique_ptr<ReadableFile> file, std::string path)
      : file_(std::move(file)), path_(std::move(path)), packed_(1 << 16), plain_(1 << 16) {}
  TextSource(const TextSource&) = delete;
  TextSource& operator=(const TextSource&) = delete;
  ~TextSource() {
    if (is_gzip_) {
      inflateEnd(&stream_);
    }
  }

  Status start() {
    SIXPOINT_CHECK(fill());
    is_gzip_ = have_ >= 2 && packed_[0] == 0x1F && packed_[1] == 0x8B;
    if (is_gzip_) {
      constexpr int kGzip = 16 + MAX_WBITS;
      if (inflateInit2(&stream_, kGzip) != Z_OK) {
        is_gzip_ = false;
        return fail(ErrorCode::internal, "zlib does not start", path_, "");
      }
    }
    return {};
  }

  // The next line without its end; none at the end of the file.
  Result<bool> line(std::string& text) {
    text.clear();
    for (;;) {
      if (at_ == ready_) {
        SIXPOINT_ASSIGN(const bool more, more_text());
        if (!more) {
          return !text.empty();
        }
      }
      const auto* begin = plain_.data() + at_;
      const auto* end = plain_.data() + ready_;
      const auto* stop = std::find(begin, end, static_cast<std::uint8_t>('\n'));
      text.append(reinterpret_cast<const char*>(begin), static_cast<std::size_t>(stop - begin));
      at_ = static_cast<std::size_t>(stop - plain_.data());
      if (text.size() > kLongestLine) {
        return fail(ErrorCode::bad_data, "a line is longer than 4096 characters", path_,
                    "give a table: a line holds time and three readings");
      }
      if (stop != end) {
        ++at_;
        return true;
      }
    }
  }

 private:
  Status fill() {
    SIXPOINT_ASSIGN(have_, file_->read_at(offset_, packed_));
    offset_ += have_;
    used_ = 0;
    return {};
  }

  Result<bool> more_text() {
    at_ = 0;
    ready_ = 0;
    if (!is_gzip_) {
      if (used_ == have_) {
        SIXPOINT_CHECK(fill());
      }
      std::copy_n(packed_.begin() + static_cast<std::ptrdiff_t>(used_), have_ - used_,
                  plain_.begin());
      ready_ = have_ - used_;
      used_ = have_;
      return ready_ > 0;
    }
    while (ready_ == 0 && !ended_) {
      if (used_ == have_) {
        SIXPOINT_CHECK(fill());
        if (have_ == 0) {
          return fail(ErrorCode::bad_data, "the gzip file ends too early", path_, "copy it again");
        }
      }
      stream_.next_in = packed_.data() + used_;
      stream_.avail_in = static_cast<uInt>(have_ - used_);
      stream_.next_out = plain_.data();
      stream_.avail_out = static_cast<uInt>(plain_.size());
      const int result = inflate(&stream_, Z_NO_FLUSH);
      if (result != Z_OK && result != Z_STREAM_END) {
        return fail(ErrorCode::bad_data, "the gzip file is damaged", path_, "copy it again");
      }
      used_ = have_ - stream_.avail_in;
      ready_ = plain_.size() - stream_.avail_out;
      ended_ = result == Z_STREAM_END;
    }
    return ready_ > 0;
  }

  std::unique_ptr<ReadableFile> file_;
  std::string path_;
  Bytes packed_;
  Bytes plain_;
  std::uint64_t offset_ = 0;
  std::size_t have_ = 0, used_ = 0;  // of packed_
  std::size_t ready_ = 0, at_ = 0;   // of plain_
  bool is_gzip_ = false;
  bool ended_ = false;
  z_stream stream_{};
};

// The numbers of a line; nothing where something else stands in it.
std::optional<std::size_t> numbers_of(std::string_view text, std::array<double, 5>& numbers) {
  std::size_t count = 0;
  const auto is_gap = [](char c) {
    return c == ' ' || c == ',' || c == ';' || c == '\t' || c == '\r';
  };
  for (std::size_t i = 0; i < text.size();) {
    if (is_gap(text[i])) {
      ++i;
      continue;
    }
    if (text[i] == '+') {
      ++i;
    }
    double value = 0;
    const auto [end, error] = std::from_chars(text.data() + i, text.data() + text.size(), value);
    const auto next = static_cast<std::size_t>(end - text.data());
    if (error != std::errc() || !std::isfinite(value) || std::abs(value) > 1e12 ||
        (next < text.size() && !is_gap(text[next])) || count == numbers.size()) {
      return std::nullopt;
    }
    numbers[count++] = value;
    i = next;
  }
  return count;
}

struct Block {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d sd = Eigen::Vector3d::Zero();  // about the line
  double slope = 0;                              // largest of the axes, over the block
  bool follows = false;                          // the block before without a gap
};

Block block_of(const std::vector<Eigen::Vector3d>& readings, bool follows) {
  Block block;
  block.follows = follows;
  const auto n = static_cast<double>(readings.size());
  for (const auto& r : readings) {
    block.mean += r / n;
  }
  Eigen::Vector3d slope = Eigen::Vector3d::Zero();
  Eigen::Vector3d square = Eigen::Vector3d::Zero();
  double xx = 0;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const double x = static_cast<double>(i) - (n - 1) / 2;
    slope += x * (readings[i] - block.mean);
    xx += x * x;
  }
  slope /= xx;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const double x = static_cast<double>(i) - (n - 1) / 2;
    square += (readings[i] - block.mean - x * slope).cwiseAbs2();
  }
  block.sd = (square / (n - 2)).cwiseSqrt();
  block.slope = slope.cwiseAbs().maxCoeff() * n;
  return block;
}

// Stretches of still blocks of one direction. What is still goes by the table itself: its unit is
// not known.
std::vector<RestingReading> rests_of(const std::vector<Block>& blocks, double still_factor,
                                     double per_block) {
  std::vector<double> scatter;
  for (const Block& block : blocks) {
    if (block.sd.minCoeff() > 0) {  // an axis that repeats one value measures nothing
      scatter.push_back(block.sd.maxCoeff());
    }
  }
  if (scatter.size() < 12) {
    return {};
  }
  const auto tenth = scatter.begin() + static_cast<std::ptrdiff_t>(scatter.size() / 10);
  std::nth_element(scatter.begin(), tenth, scatter.end());
  const double most = still_factor * *tenth;
  std::vector<RestingReading> rests;
  bool open = false;
  for (const Block& block : blocks) {
    const bool still =
        block.sd.minCoeff() > 0 && block.sd.maxCoeff() < most && block.slope < 2 * most;
    open = open && block.follows && still &&
           (block.mean - rests.back().mean).cwiseAbs().maxCoeff() < 2 * most;
    if (still && open) {
      RestingReading& rest = rests.back();
      const double n = rest.readings + per_block;
      rest.mean += (block.mean - rest.mean) * (per_block / n);
      rest.sd += (block.sd - rest.sd) * (per_block / n);
      rest.readings = n;
    } else if (still) {
      rests.push_back({block.mean, block.sd, per_block});
      open = true;
    }
  }
  return rests;
}

struct Placement {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  std::size_t direction = 0;  // those of one direction are held out together
};

// Four placements of a direction at most, spread over the time: a night on a table must not drown
// the rest. They are not averaged, for a mean of two directions is shorter than both.
std::vector<Placement> placements_of(const std::vector<RestingReading>& rests) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300);
  Eigen::Vector3d high = -low;
  for (const RestingReading& rest : rests) {
    low = low.cwiseMin(rest.mean);
    high = high.cwiseMax(rest.mean);
  }
  const Eigen::Vector3d middle = 0.5 * (low + high);
  const Eigen::Vector3d half = 0.5 * (high - low).cwiseMax(1e-300);
  std::map<std::array<long, 3>, std::vector<Eigen::Vector3d>> bins;
  for (const RestingReading& rest : rests) {
    const Eigen::Vector3d u = 8 * (rest.mean - middle).cwiseQuotient(half);
    bins[{std::lround(u[0]), std::lround(u[1]), std::lround(u[2])}].push_back(rest.mean);
  }
  constexpr std::size_t kMost = 4;
  std::vector<Placement> placements;
  std::size_t direction = 0;
  for (const auto& [key, means] : bins) {
    const std::size_t taken = std::min(kMost, means.size());
    for (std::size_t i = 0; i < taken; ++i) {
      placements.push_back({means[i * means.size() / taken], direction});
    }
    ++direction;
  }
  return placements;
}

std::vector<Eigen::Vector3d> means_of(const std::vector<Placement>& placements) {
  std::vector<Eigen::Vector3d> means;
  means.reserve(placements.size());
  for (const Placement& placement : placements) {
    means.push_back(placement.mean);
  }
  return means;
}

double length_error(const LengthFit& fit, const Eigen::Vector3d& raw) {
  return (fit.sensitivity * (raw - fit.zero)).norm() - 1;
}

struct HeldOut {
  std::vector<double> square, cross;  // errors of length with three and six terms
  double gain_nats = 0;
};

// Each direction is judged by constants that did not see it.
std::optional<HeldOut> hold_out(const std::vector<Placement>& placements) {
  constexpr std::size_t kFolds = 8;
  HeldOut out;
  for (std::size_t fold = 0; fold < kFolds; ++fold) {
    std::vector<Eigen::Vector3d> seen;
    for (const Placement& placement : placements) {
      if (placement.direction % kFolds != fold) {
        seen.push_back(placement.mean);
      }
    }
    const auto square = fit_lengths(seen, 1, CrossAxis::none);
    const auto cross = fit_lengths(seen, 1, CrossAxis::symmetric);
    if (!square || !cross || !(square->residual > 0) || !(cross->residual > 0)) {
      return std::nullopt;
    }
    const auto n = static_cast<double>(seen.size());
    const double square_sd = square->residual * std::sqrt(n / (n - 6));
    const double cross_sd = cross->residual * std::sqrt(n / (n - 9));
    for (const Placement& placement : placements) {
      if (placement.direction % kFolds != fold) {
        continue;
      }
      out.square.push_back(length_error(*square, placement.mean));
      out.cross.push_back(length_error(*cross, placement.mean));
      const auto nats = [](double error, double sd) {
        return -0.5 * std::pow(error / sd, 2) - std::log(sd);
      };
      out.gain_nats += nats(out.cross.back(), cross_sd) - nats(out.square.back(), square_sd);
    }
  }
  return out;
}

double rms_mg(const std::vector<double>& errors_g) {
  double sum = 0;
  for (const double e : errors_g) {
    sum += e * e;
  }
  return 1000 * std::sqrt(sum / static_cast<double>(errors_g.size()));
}

// Placements that do not fit at five times the others' scatter were not at rest after all.
std::size_t leave_out_strays(std::vector<Placement>& placements, const LengthFit& fit) {
  std::vector<double> sizes;
  sizes.reserve(placements.size());
  for (const Placement& placement : placements) {
    sizes.push_back(std::abs(length_error(fit, placement.mean)));
  }
  auto sorted = sizes;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const double most = 5 * 1.4826 * *middle;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < placements.size(); ++i) {
    if (sizes[i] <= most) {
      placements[kept++] = placements[i];
    }
  }
  const std::size_t left_out = placements.size() - kept;
  placements.resize(kept);
  return left_out;
}

}  // namespace

bool is_readings_table(const std::string& path) {
  std::string name = path;
  if (name.ends_with(".gz")) {
    name.resize(name.size() - 3);
  }
  return name.ends_with(".txt") || name.ends_with(".csv") || name.ends_with(".tsv");
}

Result<ReadingsTable> read_readings_table(FileSystem& files, const std::string& path,
                                          const ReadingsTableOptions& options) {
  SIXPOINT_ASSIGN(auto file, files.open(path));
  TextSource source(std::move(file), path);
  SIXPOINT_CHECK(source.start());

  ReadingsTable table;
  std::vector<Block> blocks;
  std::vector<Eigen::Vector3d> run;
  std::vector<std::pair<double, Eigen::Vector3d>> first;  // until the rate is known
  std::size_t columns = 0;
  std::size_t length = 0;
  double last_s = 0;
  bool follows = false;
  const auto push = [&](double time_s, const Eigen::Vector3d& reading) -> Status {
    if (columns == 4 && table.readings > 0 && std::abs(time_s - last_s) > 3 / table.rate_hz) {
      run.clear();
      follows = false;
    }
    last_s = time_s;
    ++table.readings;
    run.push_back(reading);
    if (run.size() == length) {
      if (blocks.size() == kMostBlocks) {
        return fail(ErrorCode::bad_data, "the table is too long", path, "cut it into parts");
      }
      blocks.push_back(block_of(run, follows));
      run.clear();
      follows = true;
    }
    return {};
  };
  const auto set_rate = [&](double rate_hz) -> Status {
    if (!(rate_hz >= 5 && rate_hz <= 10'000)) {
      return fail(ErrorCode::bad_data,
                  fmt::format("a rate of {:.4g} Hz by the table's first column", rate_hz), path,
                  "the first of four columns must be time in seconds, 5 to 10000 readings in each");
    }
    table.rate_hz = rate_hz;
    length = static_cast<std::size_t>(std::max(10.0, std::round(options.block_s * rate_hz)));
    return {};
  };
  const auto start_timed = [&]() -> Status {
    std::vector<double> steps;
    for (std::size_t i = 1; i < first.size(); ++i) {
      steps.push_back(first[i].first - first[i - 1].first);
    }
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    SIXPOINT_CHECK(set_rate(1 / *middle));
    for (const auto& [time_s, reading] : first) {
      SIXPOINT_CHECK(push(time_s, reading));
    }
    first.clear();
    return {};
  };

  constexpr std::size_t kToKnowTheRate = 100;
  std::string text;
  std::array<double, 5> numbers{};
  for (std::size_t number = 1;; ++number) {
    SIXPOINT_ASSIGN(const bool more, source.line(text));
    if (!more) {
      break;
    }
    if (text.starts_with('#') || text.find_first_not_of(" \t\r") == std::string::npos) {
      continue;
    }
    const auto count = numbers_of(text, numbers);
    if (!count && columns == 0 && number == 1) {
      continue;  // names of the columns
    }
    if (!count || (*count != 3 && *count != 4) || (columns != 0 && *count != columns)) {
      return fail(ErrorCode::bad_data,
                  fmt::format("line {} does not hold {} numbers: '{}'", number,
                              columns == 0 ? std::string("three or four") : std::to_string(columns),
                              printable(text, 60)),
                  path, "give a table: a line holds time and three readings, or three readings");
    }
    if (columns == 0) {
      columns = *count;
      if (columns == 3) {
        if (options.rate_hz == 0) {
          return fail(ErrorCode::usage, "the table has no time column, so its rate must be told",
                      path, "give --rate HZ");
        }
        SIXPOINT_CHECK(set_rate(options.rate_hz));
      }
    }
    const Eigen::Vector3d reading(numbers[columns - 3], numbers[columns - 2], numbers[columns - 1]);
    if (columns == 4 && table.rate_hz == 0) {
      first.emplace_back(numbers[0], reading);
      if (first.size() == kToKnowTheRate) {
        SIXPOINT_CHECK(start_timed());
      }
      continue;
    }
    SIXPOINT_CHECK(push(numbers[0], reading));
  }
  if (first.size() >= 3) {
    SIXPOINT_CHECK(start_timed());
  }
  if (table.readings == 0) {
    return fail(ErrorCode::bad_data, "the table holds no readings", path,
                "give a table: a line holds time and three readings, or three readings");
  }
  table.blocks = blocks.size();
  table.rests = rests_of(blocks, options.still_factor, static_cast<double>(length));
  return table;
}

Result<Diagnosis> diagnose_table(FileSystem& files, const std::string& path,
                                 const DiagnoseOptions& options,
                                 const ReadingsTableOptions& table_options) {
  SIXPOINT_ASSIGN(const ReadingsTable table, read_readings_table(files, path, table_options));
  Diagnosis out;
  out.bundle = path;
  out.protocol = "none";
  out.seed = options.seed;
  out.losses.emplace_back(
      "a table of readings: gain and zero are the sensor's own, only lengths at rest are judged");
  std::vector<Placement> placements = placements_of(table.rests);
  std::vector<Eigen::Vector3d> means = means_of(placements);
  auto fit = fit_lengths(means, 1, CrossAxis::symmetric);
  if (fit) {
    if (const std::size_t strays = leave_out_strays(placements, *fit); strays > 0) {
      out.losses.push_back(fmt::format(
          "{} of {} placements do not fit the others and were left out", strays, means.size()));
      means = means_of(placements);
      fit = fit_lengths(means, 1, CrossAxis::symmetric);
    }
  }
  const auto square = fit_lengths(means, 1, CrossAxis::none);
  const std::size_t directions =
      placements.empty() ? 0 : placements.back().direction + 1 - placements.front().direction;
  const auto held_out = directions >= 16 ? hold_out(placements) : std::nullopt;
  const std::string name = "non_orthogonality";
  bool is_judged = false;
  if (!fit || !square || !held_out) {
    out.inconclusive = true;
    out.losses.push_back(
        fmt::format("{} directions at rest, which do not settle nine constants; rest the sensor "
                    "in sixteen and more, all round",
                    directions));
  } else {
    const auto n = static_cast<double>(means.size());
    double noise_g = 0;
    for (const RestingReading& rest : table.rests) {
      noise_g += (fit->sensitivity.diagonal().cwiseProduct(rest.sd)).norm() / std::sqrt(3.0) /
                 std::sqrt(rest.readings) / static_cast<double>(table.rests.size());
    }
    out.gap.before_mg = rms_mg(held_out->square);
    out.gap.after_mg = out.gap.before_mg;
    out.gap.floor_mg = 1000 * noise_g;
    // Schwarz: three more constants for that much less scatter.
    const double nats =
        n * std::log(square->residual / fit->residual) - 1.5 * std::log(n) + kLogPrior;
    if (options.without.count(name) == 0) {
      is_judged = true;
      EffectFinding f;
      f.name = name;
      f.nats = nats;
      f.probability = 1 / (1 + std::exp(-std::clamp(nats, -40.0, 9.0)));
      f.held_out_gain_nats = held_out->gain_nats;
      // The effect acts on the way to the reading, the fit on the way back.
      NamedValue terms{"yz_xz_xy", {}, {}};
      for (Eigen::Index a = 0; a < 3; ++a) {
        terms.value.push_back(-fit->cross[a]);
        terms.sd.push_back(fit->cross_sd[a]);
      }
      constexpr double kDatasheet = 0.015;
      f.outside_datasheet = fit->cross.cwiseAbs().maxCoeff() > kDatasheet;
      f.parameters.push_back(std::move(terms));
      if (nats > kAccept && held_out->gain_nats > 0) {
        out.gap.after_mg = rms_mg(held_out->cross);
        out.effects.push_back(f);
      }
      out.candidates.push_back(std::move(f));
    } else if (nats > kAccept && held_out->gain_nats > 0) {
      out.unknown.where.emplace_back("mean: lengths at rest depend on pairs of axes");
    }
    if (out.gap.after_mg > kLost_mg) {
      out.unknown.where.emplace_back("mean: lengths at rest fit no linear sensor");
    }
    out.unknown.present = !out.unknown.where.empty();
    const double spread = std::sqrt(2.0 / n);
    out.gap.after_interval_mg = {out.gap.after_mg * (1 - spread), out.gap.after_mg * (1 + spread)};
    out.gap.before_sigma = out.gap.before_mg / out.gap.floor_mg;
    out.gap.after_sigma = out.gap.after_mg / out.gap.floor_mg;
    out.gap.by_feature[0] = {out.gap.before_sigma, out.gap.after_sigma};
    out.gap.closed_fraction =
        out.effects.empty()
            ? 0
            : std::clamp(1 - std::pow(out.gap.after_mg / out.gap.before_mg, 2), 0.0, 1.0);
    for (int axis = 0; axis < 3; ++axis) {
      double sum = 0;
      double weight = 0;
      for (const auto& m : means) {
        const Eigen::Vector3d u = (square->sensitivity * (m - square->zero)).normalized();
        sum += u[axis] * u[axis] * std::pow(length_error(*square, m), 2);
        weight += u[axis] * u[axis];
      }
      const double residual_mg = 1000 * std::sqrt(sum / std::max(weight, 1e-9));
      out.where.push_back({axis, "rest", "pose", residual_mg, residual_mg / out.gap.floor_mg});
    }
    std::stable_sort(out.where.begin(), out.where.end(),
                     [](const Location& a, const Location& b) { return a.sigma > b.sigma; });
  }
  for (const CatalogueEntry& entry : catalogue()) {
    const std::string other(entry.name);
    if (options.without.count(other) == 0 && !(is_judged && other == name)) {
      EffectFinding f;
      f.name = other;
      f.nats = kLogPrior;
      f.probability = 0.03;
      out.candidates.push_back(std::move(f));
      out.not_observable.emplace_back(other,
                                      entry.segment.empty() ? "none" : std::string(entry.segment));
    }
  }
  out.next_segments.push_back(
      {"faces", 1.7, 0.135 * 12, {"misalignment", "second_order", "settling"}});
  out.unknown.probability = out.unknown.present ? 0.95 : 0.1;
  out.verdict = out.unknown.present
                    ? (out.effects.empty() ? Verdict::unexplained : Verdict::partly_explained)
                    : (out.effects.empty() ? Verdict::no_gap : Verdict::explained);
  return out;
}

}  // namespace sixpoint::gap
