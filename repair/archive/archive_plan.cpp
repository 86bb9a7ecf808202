#include "repair/archive/archive_plan.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include <fmt/format.h>

#include "base/sha256.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/output_place.h"

namespace sixpoint::repair {
namespace {

constexpr std::uint64_t kUsualShardBytes = 4ULL << 30;
// What a file costs beside its bytes: opening, the mark, two syncs.
constexpr std::uint64_t kBytesPerFile = 64ULL << 10;
// Sizes above this count as this: a million sparse files must not overflow a sum.
constexpr std::uint64_t kLargestFile = 1ULL << 40;

// How many shards a list of files makes when none may hold more than `most` (but for one file).
std::size_t shards_within(const std::vector<std::uint64_t>& bytes, std::uint64_t most) {
  std::size_t shards = 0;
  std::uint64_t left = 0;
  for (const std::uint64_t size : bytes) {
    if (shards == 0 || size > left) {
      ++shards;
      left = std::max(most, size);
    }
    left -= size;
  }
  return shards;
}

class Planner {
 public:
  Planner(Env& env, const ArchiveDraft& draft) : env_(env), draft_(draft) {}

  Result<PlannedArchive> make() {
    ArchivePlan& plan = made_.plan;
    plan.made_at = env_.clock.now();
    plan.software = draft_.software;
    plan.repair = draft_.repair;
    plan.store = draft_.store;
    for (const std::string& path : draft_.paths) {
      SIXPOINT_CHECK(add(path));
    }
    if (made_.files.empty()) {
      return nothing_to_repair();
    }
    if (draft_.hash) {
      SIXPOINT_CHECK(hash());
    }
    SIXPOINT_CHECK(cut());
    return std::move(made_);
  }

 private:
  tl::unexpected<Error> nothing_to_repair() const {
    const auto& links = made_.not_followed;
    if (links.empty()) {
      return fail(ErrorCode::no_input, "there is no .gt3x file to repair", draft_.paths.front(),
                  "name the folder with your recordings");
    }
    return fail(
        ErrorCode::no_input,
        fmt::format("there is no .gt3x file to repair; {}{} leads out of the tree and is not "
                    "followed",
                    printable(links.front()),
                    links.size() == 1 ? std::string()
                                      : fmt::format(" (and {} links more)", links.size() - 1)),
        draft_.paths.front(), "name the folder to which the link leads");
  }

  Status add(const std::string& path) {
    SIXPOINT_ASSIGN(const auto info, env_.files.info(path));
    SIXPOINT_ASSIGN(auto tree, find_files(env_.files, path, {{".gt3x"}, /*follow_out=*/false}));
    made_.not_followed.insert(made_.not_followed.end(), tree.not_followed.begin(),
                              tree.not_followed.end());
    for (RefusedPath& refused : tree.refused) {
      if (places_.insert(place_of(env_.files, refused.path)).second) {
        made_.plan.refused.push_back(std::move(refused));
      }
    }
    const std::size_t root = root_of({info.is_folder ? path : folder_of(path), info.is_folder});
    for (FoundFile& file : tree.files) {
      if (!places_.insert(place_of(env_.files, file.path)).second) {
        continue;  // named twice, also by folders that lie in one another
      }
      const auto [other, fresh] = taken_.emplace(file.relative, file.path);
      if (!fresh) {
        made_.plan.refused.push_back(
            {file.path,
             Error{ErrorCode::cannot_create,
                   fmt::format("{} would have the same name in the output folder",
                               printable(other->second)),
                   file.path, "make separate plans of the two, with separate output folders"}});
        continue;
      }
      made_.files.push_back({root, std::move(file.relative), file.size, file.modified_ns, ""});
    }
    return {};
  }

  std::size_t root_of(ArchiveRoot root) {
    const auto [known, fresh] =
        roots_.emplace(std::pair(root.path, root.whole), made_.plan.roots.size());
    if (fresh) {
      made_.plan.roots.push_back(std::move(root));
    }
    return known->second;
  }

  Status hash() {
    std::size_t done = 0;
    std::vector<ArchiveFile> readable;
    for (ArchiveFile& file : made_.files) {
      draft_.progress(done++, made_.files.size());
      auto digest = file_sha256(env_.files, made_.plan.input_of(file));
      if (!digest) {
        made_.plan.refused.push_back({made_.plan.input_of(file), digest.error()});
        continue;
      }
      file.sha256 = *std::move(digest);
      readable.push_back(std::move(file));
    }
    made_.files = std::move(readable);
    if (made_.files.empty()) {
      return fail(made_.plan.refused.front().error);
    }
    return {};
  }

  Status cut() {
    std::vector<std::uint64_t> bytes;
    bytes.reserve(made_.files.size());
    for (const ArchiveFile& file : made_.files) {
      bytes.push_back(std::min(file.size, kLargestFile) + kBytesPerFile);
    }
    std::size_t shards = draft_.shards;
    if (shards == 0) {
      const std::uint64_t most = draft_.shard_bytes > 0 ? draft_.shard_bytes : kUsualShardBytes;
      shards = shards_within(bytes, most);
      if (draft_.shard_bytes == 0) {
        shards = std::min(shards, kUsualMostShards);
      }
    }
    shards = std::min(shards, made_.files.size());
    if (shards > kMostShards) {
      return fail(
          ErrorCode::usage,
          fmt::format("{} shards are more than the {} that a plan may have", shards, kMostShards),
          {}, "choose fewer or larger ones");
    }
    std::size_t from = 0;
    for (const std::size_t to : cut_into_shards(bytes, shards)) {
      const auto shard_files = std::span(made_.files).subspan(from, to - from);
      ArchiveShard shard;
      shard.files = shard_files.size();
      for (const ArchiveFile& file : shard_files) {
        shard.bytes += file.size;
      }
      made_.plan.shards.push_back(shard);
      from = to;
    }
    return {};
  }

  Env& env_;
  const ArchiveDraft& draft_;
  PlannedArchive made_;
  std::map<std::pair<std::string, bool>, std::size_t> roots_;
  std::set<std::string> places_;              // of all files so far, by place_of()
  std::map<std::string, std::string> taken_;  // output -> input
};

}  // namespace

std::size_t ArchivePlan::files() const {
  return std::accumulate(
      shards.begin(), shards.end(), std::size_t{0},
      [](std::size_t sum, const ArchiveShard& shard) { return sum + shard.files; });
}

std::uint64_t ArchivePlan::bytes() const {
  return std::accumulate(
      shards.begin(), shards.end(), std::uint64_t{0},
      [](std::uint64_t sum, const ArchiveShard& shard) { return sum + shard.bytes; });
}

std::vector<std::size_t> cut_into_shards(const std::vector<std::uint64_t>& bytes,
                                         std::size_t shards) {
  shards = std::min(shards, bytes.size());
  std::vector<std::size_t> ends;
  if (shards == 0) {
    return ends;
  }
  // The smallest size of the largest shard, by bisection.
  std::uint64_t low = *std::max_element(bytes.begin(), bytes.end());
  std::uint64_t high = std::accumulate(bytes.begin(), bytes.end(), std::uint64_t{0});
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    if (shards_within(bytes, middle) <= shards) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const bool full = sum + bytes[i] > low;
    // As many files left as shards: one each, so that none is empty.
    const bool spread = bytes.size() - i <= shards - ends.size() - 1;
    if ((full || spread) && i > (ends.empty() ? 0 : ends.back())) {
      ends.push_back(i);
      sum = 0;
    }
    sum += bytes[i];
  }
  ends.push_back(bytes.size());
  return ends;
}

Result<PlannedArchive> plan_archive(Env& env, const ArchiveDraft& draft) {
  return Planner(env, draft).make();
}

ConstantsFinderOptions finder_options(const ArchiveRepair& repair,
                                      const ConstantsSnapshot* snapshot) {
  ConstantsFinderOptions options;
  options.given = repair.given;
  options.snapshot = snapshot;
  options.scan = repair.scan;
  options.store_named = repair.store_named;
  options.or_scan = repair.or_scan;
  options.allow_prior = repair.options.allow_prior;
  if (repair.calibration_file) {
    options.calibration_file = repair.calibration_file->path;
  }
  return options;
}

bool asks_units(const ArchiveRepair& repair, const ConstantsSnapshot* snapshot) {
  ConstantsFinderOptions options = finder_options(repair, snapshot);
  UnitPool pool;
  options.unit = repair.no_pool ? nullptr : &pool;
  return sources_in_order(options).back() == SourceKind::unit_files;
}

void ask_units(Env& env, const ConstantsSnapshot* snapshot, const ForEach& for_each,
               PlannedArchive& planned) {
  const ArchiveRepair& repair = planned.plan.repair;
  UnitPool pool;
  ConstantsFinderOptions options = finder_options(repair, snapshot);
  options.unit = &pool;
  ConstantsFinder finder(env, std::move(options));
  const auto input = [&](std::size_t i) { return planned.plan.input_of(planned.files[i]); };
  std::vector<std::string> may_help(planned.files.size());  // serial numbers
  for_each(planned.files.size(), [&](std::size_t i) {
    may_help[i] = collect(env.files, input(i), finder, repair.options.still);
  });
  std::vector<std::size_t> helpers;
  const auto units = pool.units_that_lack();
  for (std::size_t i = 0; i < may_help.size(); ++i) {
    if (units.contains(may_help[i])) {
      helpers.push_back(i);
    }
  }
  if (!helpers.empty()) {
    for_each(helpers.size(), [&](std::size_t k) {
      collect_helper(env.files, input(helpers[k]), pool, repair.options.still);
    });
  }
  pool.close(env.clock.now());
  planned.units = pool.answers();
}

}  // namespace sixpoint::repair
