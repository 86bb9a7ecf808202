// An archive of made recordings in memory, its plan, and what one `repair` of the same files gives.
#pragma once

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "base/random.h"
#include "base/sha256.h"
#include "expect_result.h"
#include "repair/archive/archive_json.h"
#include "repair/archive/archive_merge.h"
#include "repair/archive/archive_plan.h"
#include "repair/archive/archive_run.h"
#include "repair/archive/archive_scripts.h"
#include "repair/jig_constants.h"
#include "repair/made_recording.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/repair_records.h"

namespace sixpoint::repair {
using testing::HasSubstr;
using tests::kConstants;
using tests::MadeRecording;

inline calib::ConstantsRecord constants() {
  return calib::parse_constants_record(kConstants).value();
}

// A few seconds; which of the answers it gets is a matter of its serial and firmware.
inline MadeRecording few_seconds(Random& random) {
  MadeRecording made;
  for (std::size_t i = 0; i < 30 + random.below(90); ++i) {
    PerAxis<int> raw{};
    for (int& value : raw) {
      value = static_cast<int>(random.below(700)) - 300;
    }
    made.raw.push_back(raw);
  }
  switch (random.below(5)) {
    case 0:
      made.firmware = "1.8.0";  // not affected
      break;
    case 1:
      made.serial = "MOS2A45130999";  // not repairable by these constants
      break;
    default:
      break;
  }
  return made;
}

class Archive : public testing::Test {
 protected:
  static void fill(MemoryFiles& files, std::uint64_t seed, std::size_t count) {
    Random random(seed);
    for (std::size_t i = 0; i < count; ++i) {
      std::string folder = "/archive";
      for (std::uint64_t depth = random.below(3); depth > 0; --depth) {
        folder += "/d" + std::to_string(random.below(3));
      }
      ASSERT_OK(files.make_folders(folder));
      // Names are bytes: a line end, no UTF-8, the plan's own escape.
      const std::string odd[] = {"plain", "line\nend", "\xff\xfe", "100%41", "quote'\""};
      const std::string path = folder + "/" + odd[random.below(5)] + std::to_string(i) + ".gt3x";
      if (random.below(8) == 0) {
        auto broken = files.create(path);
        ASSERT_OK(broken);
        ASSERT_OK((*broken)->write_at(0, Bytes{'n', 'o', ' ', 'z', 'i', 'p'}));
      } else {
        ASSERT_OK(few_seconds(random).write(files, path));
      }
    }
  }

  static ArchiveDraft draft(std::size_t shards) {
    ArchiveDraft draft;
    draft.paths = {"/archive"};
    draft.shards = shards;
    draft.repair.given = constants();
    draft.software = "test";
    return draft;
  }

  static Result<PlannedArchive> plan(MemoryEnv& memory, const ArchiveDraft& draft) {
    SIXPOINT_ASSIGN(auto planned, plan_archive(memory.env, draft));
    SIXPOINT_CHECK(write_plan(memory.env, "/plan", draft, planned));
    return planned;
  }

  static ShardRunOptions shard(std::size_t number) {
    ShardRunOptions options;
    options.shard = number;
    options.output_folder = "/repaired";
    options.checkpoint_files = 2;
    return options;
  }

  // {status of every input}, and the bytes of every output, of the merged archive.
  struct Outcome {
    std::map<std::string, std::string> reports;  // input -> JSON without what only a rerun says
    std::map<std::string, Bytes> outputs;
    bool operator==(const Outcome&) const = default;
  };
  static std::map<std::string, Bytes> outputs_of(MemoryFiles& files,
                                                 const std::vector<RepairReport>& reports) {
    std::map<std::string, Bytes> outputs;
    for (const RepairReport& report : reports) {
      if (!report.output.empty()) {
        outputs[report.output] = read_file(files, report.output).value_or(Bytes{});
      }
    }
    return outputs;
  }
  static std::string text_of(const RepairReport& report) {
    auto json = report.to_json();
    std::erase(json["reasons"].get_ref<nlohmann::ordered_json::array_t&>(),
               nlohmann::ordered_json("repaired by an earlier run"));
    return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  }
  static Outcome outcome_of(MemoryFiles& files, const std::vector<RepairReport>& reports) {
    Outcome outcome;
    for (const RepairReport& report : reports) {
      outcome.reports[report.input] = text_of(report);
    }
    outcome.outputs = outputs_of(files, reports);
    return outcome;
  }

  static Outcome merged(MemoryFiles& files, const ArchivePlan& plan) {
    std::vector<RepairReport> reports;
    MergeOptions options;
    options.verify = true;
    options.visit = [&](const ShardResult& result) -> Status {
      reports.insert(reports.end(), result.files.begin(), result.files.end());
      return {};
    };
    const auto answer = merge_archive(files, "/plan", plan, options);
    EXPECT_OK(answer);
    EXPECT_TRUE(answer && answer->complete());
    return outcome_of(files, reports);
  }

  // What one repair of the same tree gives.
  static Outcome repaired(MemoryEnv& memory) {
    ConstantsFinderOptions options;
    options.given = constants();
    ConstantsFinder finder(memory.env, options);
    std::vector<RepairReport> reports;
    const auto tree = find_files(memory.files, "/archive", {{".gt3x"}});
    EXPECT_OK(tree);
    for (const FoundFile& file : tree->files) {
      const std::string output = "/repaired/" + file.relative;
      EXPECT_OK(memory.files.make_folders(folder_of(output)));
      reports.push_back(repair_file(memory.env, file.path, output, finder, {}));
    }
    return outcome_of(memory.files, reports);
  }
};

// A plan that someone edited, with and without the hashes to match.
class HostilePlan : public Archive {
 protected:
  HostilePlan() {
    fill(memory_.files, 9, 6);
    const auto planned = plan(memory_, draft(2));
    EXPECT_OK(planned);
    plan_ = planned->plan;
  }
  void replace(const std::string& path, const std::string& text) {
    if (memory_.files.info(path)) {
      ASSERT_OK(memory_.files.remove(path));
    }
    auto file = memory_.files.create(path);
    ASSERT_OK(file);
    ASSERT_OK((*file)->write_at(0, as_bytes(text)));
  }
  std::string text(const std::string& path) {
    const Bytes bytes = read_file(memory_.files, path).value();
    return {bytes.begin(), bytes.end()};
  }
  static std::string edited(std::string text, const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
  }
  // plan.json with another manifest for shard 0, and an id that fits.
  void forge_manifest(const std::string& manifest) {
    replace("/plan/shards/00000.jsonl", manifest);
    auto json = nlohmann::ordered_json::parse(text("/plan/plan.json"));
    json["shards"][0]["files"] = std::count(manifest.begin(), manifest.end(), '\n');
    json["shards"][0]["sha256"] = hash(manifest);
    forge_plan(json);
  }
  void forge_plan(nlohmann::ordered_json json) {
    json.erase("id");
    json["id"] = hash(json.dump(1));
    replace("/plan/plan.json", json.dump(1));
  }
  static std::string hash(const std::string& text) { return to_hex(sha256(as_bytes(text))); }
  Result<ShardResult> run_first() {
    SIXPOINT_ASSIGN(const auto read, read_plan(memory_.files, "/plan"));
    return run_shard(memory_.env, "/plan", read, shard(0));
  }

  MemoryEnv memory_;
  ArchivePlan plan_;
};

}  // namespace sixpoint::repair
