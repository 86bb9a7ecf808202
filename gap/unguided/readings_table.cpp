#include "gap/unguided/readings_table.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include <fmt/format.h>
#include <zlib.h>

#include "gap/unguided/block_line.h"

namespace sixpoint::gap {
namespace {

constexpr std::size_t kMostBlocks = 500'000;
constexpr std::size_t kLongestLine = 4096;
constexpr std::size_t kToKnowTheRate = 100;  // lines
constexpr double kLongestStep = 3;           // of the rate's; beyond it there is a gap
// Half of the paper's still periods: a sensor that is turned through forty directions rests for
// about three seconds in each.
constexpr double kBlock_s = 2;
// Blocks of more than this many times the scatter of the stillest tenth are no rest.
constexpr double kStillFactor = 2.5;
constexpr const char* kHint =
    "give a table: a line holds time and three readings, or three readings";

// The lines of a file, unpacked where it is gzip.
class TextLines {
 public:
  TextLines(std::unique_ptr<ReadableFile> file, std::string path)
      : file_(std::move(file)), path_(std::move(path)), packed_(1 << 16), plain_(1 << 16) {}
  TextLines(const TextLines&) = delete;
  TextLines& operator=(const TextLines&) = delete;
  ~TextLines() {
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

  Result<bool> next(std::string& text) {
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
    while (ready_ == 0) {
      if (member_ended_) {
        SIXPOINT_ASSIGN(const bool is_next, begin_next_member());
        if (!is_next) {
          return false;
        }
      }
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
      member_ended_ = result == Z_STREAM_END;
    }
    return true;
  }

  // A gzip file is one member behind the other (RFC 1952, 2.2); bgzip and 'cat a.gz b.gz' make
  // many. Zeros may stand behind the last one (gzip(1): they fill a tape's block). False at the
  // end.
  Result<bool> begin_next_member() {
    bool is_padded = false;
    for (;; ++used_) {
      if (used_ == have_) {
        SIXPOINT_CHECK(fill());
        if (have_ == 0) {
          return false;
        }
      }
      if (packed_[used_] != 0) {
        break;
      }
      is_padded = true;
    }
    if (is_padded || inflateReset(&stream_) != Z_OK) {
      return fail(ErrorCode::bad_data, "the gzip file is damaged", path_, "copy it again");
    }
    member_ended_ = false;
    return true;
  }

  std::unique_ptr<ReadableFile> file_;
  std::string path_;
  Bytes packed_;
  Bytes plain_;
  std::uint64_t offset_ = 0;
  std::size_t have_ = 0, used_ = 0;  // of packed_
  std::size_t ready_ = 0, at_ = 0;   // of plain_
  bool is_gzip_ = false;
  bool member_ended_ = false;
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
  const BlockLine line = line_through(readings);
  const auto n = static_cast<double>(readings.size());
  return {line.mean, (line.square / (n - 2)).cwiseSqrt(), line.slope.cwiseAbs().maxCoeff() * n,
          follows};
}

// Stretches of still blocks of one direction. What is still is measured on the table itself, since
// its unit is not known.
std::vector<RestingReading> rests_of(const std::vector<Block>& blocks, double per_block) {
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
  const double most = kStillFactor * *tenth;
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

// Takes lines, gives blocks. The rate of a table with times is known after some lines only.
class TableReader {
 public:
  TableReader(const std::string& path, const ReadingsTableOptions& options)
      : path_(path), options_(options) {}

  Status read(TextLines& lines) {
    std::string text;
    for (std::size_t number = 1;; ++number) {
      SIXPOINT_ASSIGN(const bool more, lines.next(text));
      if (!more) {
        return end();
      }
      if (!text.starts_with('#') && text.find_first_not_of(" \t\r") != std::string::npos) {
        SIXPOINT_CHECK(take(text, number));
      }
    }
  }

  ReadingsTable table() {
    table_.blocks = blocks_.size();
    table_.rests = rests_of(blocks_, static_cast<double>(length_));
    return std::move(table_);
  }

 private:
  tl::unexpected<Error> bad(std::string what, const char* hint = kHint) const {
    return fail(ErrorCode::bad_data, std::move(what), path_, hint);
  }

  Status take(const std::string& text, std::size_t number) {
    std::array<double, 5> numbers{};
    const auto count = numbers_of(text, numbers);
    if (!count && columns_ == 0 && number == 1) {
      return {};  // names of the columns
    }
    if (!count || (*count != 3 && *count != 4) || (columns_ != 0 && *count != columns_)) {
      return bad(
          fmt::format("line {} does not hold {} numbers: '{}'", number,
                      columns_ == 0 ? std::string("three or four") : std::to_string(columns_),
                      printable(text, 60)));
    }
    if (columns_ == 0) {
      columns_ = *count;
      SIXPOINT_CHECK(start_untimed());
    }
    const Eigen::Vector3d reading(numbers[columns_ - 3], numbers[columns_ - 2],
                                  numbers[columns_ - 1]);
    if (table_.rate_hz != 0) {
      return push(numbers[0], reading);
    }
    first_.emplace_back(numbers[0], reading);
    return first_.size() == kToKnowTheRate ? start_timed() : Status();
  }

  Status end() {
    if (first_.size() >= 3) {
      SIXPOINT_CHECK(start_timed());
    }
    return table_.readings == 0 ? Status(bad("the table holds no readings")) : Status();
  }

  Status set_rate(double rate_hz) {
    if (!(rate_hz >= 5 && rate_hz <= 10'000)) {
      return bad(fmt::format("a rate of {:.4g} Hz by the table's first column", rate_hz),
                 "the first of four columns must be time in seconds, 5 to 10000 readings in each");
    }
    table_.rate_hz = rate_hz;
    length_ = static_cast<std::size_t>(std::max(10.0, std::round(kBlock_s * rate_hz)));
    return {};
  }

  // Without a time column the rate is the caller's.
  Status start_untimed() {
    if (columns_ == 4) {
      return {};
    }
    if (options_.rate_hz == 0) {
      return fail(ErrorCode::usage, "the table has no time column, so its rate must be given",
                  path_, "give --rate HZ");
    }
    return set_rate(options_.rate_hz);
  }

  // The rate from the median step of the first lines.
  Status start_timed() {
    std::vector<double> steps;
    for (std::size_t i = 1; i < first_.size(); ++i) {
      steps.push_back(first_[i].first - first_[i - 1].first);
    }
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    SIXPOINT_CHECK(set_rate(1 / *middle));
    for (const auto& [time_s, reading] : first_) {
      SIXPOINT_CHECK(push(time_s, reading));
    }
    first_.clear();
    return {};
  }

  Status push(double time_s, const Eigen::Vector3d& reading) {
    if (columns_ == 4 && table_.readings > 0 &&
        std::abs(time_s - last_s_) > kLongestStep / table_.rate_hz) {
      run_.clear();
      follows_ = false;
    }
    last_s_ = time_s;
    ++table_.readings;
    run_.push_back(reading);
    if (run_.size() == length_) {
      if (blocks_.size() == kMostBlocks) {
        return bad("the table is too long", "cut it into parts");
      }
      blocks_.push_back(block_of(run_, follows_));
      run_.clear();
      follows_ = true;
    }
    return {};
  }

  const std::string& path_;
  const ReadingsTableOptions& options_;
  ReadingsTable table_;
  std::vector<Block> blocks_;
  std::vector<Eigen::Vector3d> run_;
  std::vector<std::pair<double, Eigen::Vector3d>> first_;  // until the rate is known
  std::size_t columns_ = 0;
  std::size_t length_ = 0;  // of a block, in readings
  double last_s_ = 0;
  bool follows_ = false;
};

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
  TextLines lines(std::move(file), path);
  SIXPOINT_CHECK(lines.start());
  TableReader reader(path, options);
  SIXPOINT_CHECK(reader.read(lines));
  return reader.table();
}

}  // namespace sixpoint::gap
