// Reads limits from TOML. The only file that includes toml++.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/sha256.h"
#include "station/limits/limits.h"

// A file can break what toml++ 3.3 asserts ("[*b"): in a release build the compiler would be told
// to take it for true. Without these assertions its own checks behind them say what is wrong.
#undef NDEBUG
#define TOML_ASSERT(expr) static_assert(true)
#define TOML_EXCEPTIONS 0
#define TOML_ENABLE_FORMATTERS 0
#include <toml++/toml.h>

namespace sixpoint::station {

namespace {

constexpr std::uint64_t kLargestFile = 1ULL << 20;
constexpr double kLargestCoverage = 4;

class Reader {
 public:
  Reader(const std::string& source, Limits& limits) : source_(source), limits_(limits) {}

  Status read(const toml::table& document) {
    for (const auto& [key, node] : document) {
      const std::string name(key.str());
      const toml::table* table = node.as_table();
      if (table == nullptr) {
        return wrong(key.source(), fmt::format("'{}' is no table", printable(name, 60)),
                     "limits stand in tables such as [zero_offset_mg]");
      }
      SIXPOINT_CHECK(read_table(name, *table, key.source()));
    }
    return {};
  }

 private:
  tl::unexpected<Error> wrong(
      const toml::source_region& place, std::string what,
      std::string hint = "'sixpoint limits print' shows what there is and in which units") const {
    return fail(ErrorCode::configuration, std::move(what),
                fmt::format("{}:{}", source_, place.begin.line), std::move(hint));
  }

  Result<double> number(const toml::node& node, std::string_view key, double least,
                        double most) const {
    // Also whole numbers that a double does not hold exactly.
    const auto whole = node.value_exact<std::int64_t>();
    const auto value = whole              ? std::optional(static_cast<double>(*whole))
                       : node.is_number() ? node.value<double>()
                                          : std::nullopt;
    if (!value) {
      return wrong(node.source(), fmt::format("{} is no number", key));
    }
    // Written so that NaN does not pass.
    if (!(*value >= least && *value <= most)) {
      return wrong(node.source(),
                   fmt::format("{} = {} is outside {} to {}", key, *value, least, most));
    }
    // -0 becomes 0: what is printed of it would be read as another number.
    return *value + 0.0;
  }

  Result<int> integer(const toml::node& node, std::string_view key, int least, int most) const {
    if (!node.is_integer()) {
      return wrong(node.source(), fmt::format("{} is no whole number", key));
    }
    SIXPOINT_ASSIGN(const double value, number(node, key, least, most));
    return static_cast<int>(value);
  }

  Status read_table(const std::string& name, const toml::table& table,
                    const toml::source_region& place) {
    for (const auto& [key, node] : table) {
      const std::string_view entry = key.str();
      if (name == "decision") {
        SIXPOINT_CHECK(read_decision(entry, node));
      } else if (name == "retest") {
        SIXPOINT_CHECK(read_retest(entry, node));
      } else if (name == "check_unit") {
        SIXPOINT_CHECK(read_check_unit(entry, node));
      } else if (find_quantity(name) != nullptr) {
        SIXPOINT_CHECK(read_limit(name, entry, node));
      }
    }
    const QuantityInfo* info = find_quantity(name);
    if (info != nullptr) {
      return check_limit(*info, table, place);
    }
    if (name != "decision" && name != "retest" && name != "check_unit") {
      return wrong(place, fmt::format("'{}' is nothing that can be limited", printable(name, 60)));
    }
    return {};
  }

  tl::unexpected<Error> unknown(std::string_view key, const toml::node& node) const {
    return wrong(node.source(), fmt::format("unknown key '{}'", printable(key, 60)));
  }

  Status read_decision(std::string_view key, const toml::node& node) {
    if (key == "coverage_factor") {
      SIXPOINT_ASSIGN(limits_.decision.coverage_factor, number(node, key, 1, kLargestCoverage));
    } else if (key == "guard_factor") {
      SIXPOINT_ASSIGN(limits_.decision.guard_factor, number(node, key, 0, kLargestCoverage));
    } else {
      return unknown(key, node);
    }
    return {};
  }

  Status read_retest(std::string_view key, const toml::node& node) {
    if (key == "most_failures") {
      SIXPOINT_ASSIGN(limits_.retest.most_failures, integer(node, key, 1, 100));
    } else if (key == "passes_after_failure") {
      SIXPOINT_ASSIGN(limits_.retest.passes_after_failure, integer(node, key, 1, 100));
    } else {
      return unknown(key, node);
    }
    return {};
  }

  Status read_check_unit(std::string_view key, const toml::node& node) {
    CheckUnitPolicy& policy = limits_.check_unit;
    if (key == "baseline_runs") {
      // Two would have one moving range only.
      SIXPOINT_ASSIGN(policy.baseline_runs, integer(node, key, 3, 1000));
    } else if (key == "least_sigma_zero_mg") {
      SIXPOINT_ASSIGN(policy.least_sigma_zero_mg, number(node, key, 0, 100));
    } else if (key == "least_sigma_sensitivity_percent") {
      SIXPOINT_ASSIGN(policy.least_sigma_sensitivity_percent, number(node, key, 0, 100));
    } else if (key == "locking_rules") {
      const toml::array* rules = node.as_array();
      if (rules == nullptr) {
        return wrong(node.source(), "locking_rules is no list");
      }
      policy.locking_rules.clear();
      for (const toml::node& rule : *rules) {
        SIXPOINT_ASSIGN(const int number_of_rule, integer(rule, "a rule", 1, 8));
        policy.locking_rules.push_back(number_of_rule);
      }
    } else {
      return unknown(key, node);
    }
    return {};
  }

  Status read_limit(const std::string& name, std::string_view key, const toml::node& node) {
    const QuantityInfo& info = *find_quantity(name);
    const auto limit = std::find_if(limits_.limits.begin(), limits_.limits.end(),
                                    [&](const Limit& other) { return other.name == name; });
    if (key == "low" && info.low) {
      SIXPOINT_ASSIGN(limit->low, number(node, key, info.least, info.most));
    } else if (key == "high" && info.high) {
      SIXPOINT_ASSIGN(limit->high, number(node, key, info.least, info.most));
    } else if (key == "guard_band") {
      SIXPOINT_ASSIGN(limit->guard_band, number(node, key, 0, info.most - info.least));
    } else if (key == "low" || key == "high") {
      return wrong(node.source(), fmt::format("{} has no '{}' limit", name, key));
    } else {
      return unknown(key, node);
    }
    return {};
  }

  Status check_limit(const QuantityInfo& info, const toml::table& table,
                     const toml::source_region& place) const {
    const Limit& limit = limits_.of(info.name);
    const auto line_of = [&](const char* key) {
      const toml::node* node = table.get(key);
      return node != nullptr ? node->source() : place;
    };
    const double low = limit.low.value_or(info.least);
    const double high = limit.high.value_or(info.most);
    if (low >= high) {
      return wrong(line_of(table.contains("low") ? "low" : "high"),
                   fmt::format("{}: low {} is not below high {}", info.name, low, high));
    }
    const double room = limit.low && limit.high ? (high - low) / 2 : high - low;
    if (limit.guard_band > 0 && limit.guard_band >= room) {
      return wrong(line_of("guard_band"),
                   fmt::format("{}: a guard band of {} leaves nothing between {} and {} to pass",
                               info.name, limit.guard_band, low, high),
                   "make it smaller, or leave it out: the uncertainty is kept as one anyway");
    }
    return {};
  }

  const std::string& source_;
  Limits& limits_;
};

// Everything in a limits file but its comments is ASCII. toml++ 3.3 looks letters from U+00A1 to
// U+0499 outside of quotes up in a table that has no row for them (undefined behaviour), so that
// nothing beyond ASCII is given to it; a byte order mark is no part of the text.
std::string ascii_of(std::string_view text) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text.starts_with(kByteOrderMark)) {
    text.remove_prefix(kByteOrderMark.size());
  }
  std::string ascii(text);
  std::replace_if(
      ascii.begin(), ascii.end(), [](char c) { return static_cast<unsigned char>(c) > 0x7F; }, '?');
  return ascii;
}

}  // namespace

Result<Limits> parse_limits(std::string_view text, const std::string& source) {
  const toml::parse_result parsed = toml::parse(ascii_of(text));
  if (!parsed) {
    return fail(ErrorCode::configuration,
                fmt::format("no TOML: {}", printable(parsed.error().description(), 200)),
                fmt::format("{}:{}", source, parsed.error().source().begin.line),
                "'sixpoint limits print' shows the form");
  }
  Limits limits = default_limits();
  limits.source = source;
  limits.sha256 = text_sha256(text);
  SIXPOINT_CHECK(Reader(source, limits).read(parsed.table()));
  return limits;
}

Result<Limits> read_limits(FileSystem& files, const std::string& path) {
  if (path.empty()) {
    return default_limits();
  }
  SIXPOINT_ASSIGN(const FileInfo info, files.info(path));
  if (info.size > kLargestFile) {
    return fail(ErrorCode::configuration, fmt::format("{} bytes are no limits file", info.size),
                path, "a limits file has a few kilobytes");
  }
  SIXPOINT_ASSIGN(const Bytes bytes, read_file(files, path, kLargestFile));
  // The name alone: the same file gives the same certificate from every folder.
  return parse_limits(as_text(bytes), file_name_of(path));
}

}  // namespace sixpoint::station
