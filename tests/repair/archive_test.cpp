// An archive in shards against one `repair` of the same files, and with the power cut at every
// step.
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
#include "made_recording.h"
#include "repair/archive_merge.h"
#include "repair/archive_plan.h"
#include "repair/archive_run.h"
#include "repair/archive_scripts.h"
#include "repair/constants_finder.h"
#include "repair/repair_records.h"

namespace sixpoint::repair {
namespace {

using testing::HasSubstr;
using tests::MadeRecording;

constexpr const char* kConstants = R"({"serial": "MOS2A45130450", "filter": "current",
  "constants": {"sensitivity_g_per_lsb": [0.0042, 0.004, 0.0041], "zero_lsb": [90.5, 50.25, 88]}})";

calib::ConstantsRecord constants() { return calib::parse_constants_record(kConstants).value(); }

// A few seconds; which of the answers it gets is a matter of its serial and firmware.
MadeRecording few_seconds(Random& random) {
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
    options.output_folder = "/mended";
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
               nlohmann::ordered_json("mended by an earlier run"));
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
      const std::string output = "/mended/" + file.relative;
      EXPECT_OK(memory.files.make_folders(folder_of(output)));
      reports.push_back(repair_file(memory.env, file.path, output, finder, {}));
    }
    return outcome_of(memory.files, reports);
  }
};

TEST_F(Archive, EqualsOneRepairForRandomTreesAndShardCounts) {
  std::set<std::string> statuses;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Random random(seed, 1);
    const std::size_t count = 1 + random.below(20);
    MemoryEnv whole;
    fill(whole.files, seed, count);
    const Outcome expected = repaired(whole);
    ASSERT_EQ(expected.reports.size(), count);

    MemoryEnv memory;
    fill(memory.files, seed, count);
    const auto planned = plan(memory, draft(1 + random.below(7)));
    ASSERT_OK(planned);
    const auto read = read_plan(memory.files, "/plan");
    ASSERT_OK(read);
    // Any order of the tasks, some of them twice.
    std::vector<std::size_t> order(read->shards.size());
    std::iota(order.begin(), order.end(), 0);
    for (std::size_t i = order.size(); i > 1; --i) {
      std::swap(order[i - 1], order[random.below(i)]);
    }
    order.push_back(order.front());
    for (const std::size_t number : order) {
      ASSERT_OK(run_shard(memory.env, "/plan", *read, shard(number)));
    }
    const Outcome got = merged(memory.files, *read);
    EXPECT_EQ(got.reports, expected.reports) << "seed " << seed;
    EXPECT_EQ(got.outputs, expected.outputs) << "seed " << seed;
    for (const auto& [input, text] : expected.reports) {
      statuses.insert(nlohmann::json::parse(text)["status"]);
    }
  }
  EXPECT_EQ(statuses,
            (std::set<std::string>{"repaired", "not_affected", "not_repairable", "failed"}))
      << "the trees must hold every kind of file";
}

// The machine of a task dies at every step that changes the disk, and its task starts again.
TEST_F(Archive, APowerCutAtEveryStepOfAShardLosesAndDoublesNothing) {
  MemoryEnv whole;
  fill(whole.files, 11, 4);
  const Outcome expected = repaired(whole);
  ASSERT_GE(expected.outputs.size(), 2U);
  std::size_t cuts = 0;
  for (std::size_t stop = 0;; ++stop) {
    MemoryEnv memory;
    fill(memory.files, 11, 4);
    for (const auto& [input, text] : expected.reports) {  // the archive is on the medium
      if (auto file = memory.files.info(input); file) {
        ASSERT_OK(memory.files.sync_folder(folder_of(input)));
      }
    }
    std::map<std::string, Bytes> originals;
    for (const auto& [input, text] : expected.reports) {
      originals[input] = read_file(memory.files, input).value();
    }
    const auto planned = plan(memory, draft(1));
    ASSERT_OK(planned);
    memory.files.fail_after(stop);
    const auto first = run_shard(memory.env, "/plan", planned->plan, shard(0));
    memory.files.stop_failing();
    const bool survived =
        first && std::none_of(first->files.begin(), first->files.end(), [](const auto& report) {
          return report.error && report.error->code == ErrorCode::io;
        });
    memory.files.lose_power();
    const auto read = read_plan(memory.files, "/plan");
    ASSERT_OK(read);
    if (survived) {
      EXPECT_OK(read_result(memory.files, "/plan", *read, 0)) << "acknowledged, then lost";
    }
    // Broken recordings of the tree were never synced: their bytes are gone with the power.
    for (const auto& [input, bytes] : originals) {
      if (bytes.size() > 6) {
        EXPECT_EQ(read_file(memory.files, input).value(), bytes);
      }
    }
    const auto second = run_shard(memory.env, "/plan", *read, shard(0));
    ASSERT_OK(second);
    const Outcome got = merged(memory.files, *read);
    EXPECT_EQ(got.outputs, expected.outputs) << "stopped at " << stop;
    for (const auto& [input, text] : expected.reports) {
      if (originals[input].size() > 6) {
        EXPECT_EQ(got.reports.at(input), text) << "stopped at " << stop;
      }
    }
    // Nothing half-written is left over, neither beside the outputs nor beside the results.
    EXPECT_TRUE(memory.files.list("/plan/results/00000.parts").value().empty()) << stop;
    for (const std::string folder : {"/mended", "/plan/results"}) {
      const auto names = memory.files.list(folder).value();
      for (const std::string& name : names) {
        EXPECT_FALSE(name.ends_with(".tmp")) << folder << "/" << name << " at " << stop;
      }
    }
    ++cuts;
    if (survived) {
      break;
    }
  }
  EXPECT_GT(cuts, 40U);
}

TEST_F(Archive, APowerCutAtEveryStepOfThePlanLeavesAPlanOrNone) {
  for (std::size_t stop = 0;; ++stop) {
    MemoryEnv memory;
    fill(memory.files, 5, 5);
    memory.files.fail_after(stop);
    const auto planned = plan(memory, draft(2));
    memory.files.stop_failing();
    memory.files.lose_power();
    const auto read = read_plan(memory.files, "/plan");
    if (planned) {
      ASSERT_OK(read);
      EXPECT_EQ(read->id, planned->plan.id);
      EXPECT_GT(stop, 10U);
      break;
    }
    if (read) {  // the last sync failed, the name was there all the same: whole then
      for (std::size_t k = 0; k < read->shards.size(); ++k) {
        EXPECT_OK(read_manifest(memory.files, "/plan", *read, k));
      }
    } else {
      EXPECT_EQ(read.error().code, ErrorCode::no_input) << read.error().brief();
    }
  }
}

TEST_F(Archive, WhatAStoppedRunDidIsNotDoneAgain) {
  MemoryEnv memory;
  fill(memory.files, 4, 12);
  const auto planned = plan(memory, draft(1));
  ASSERT_OK(planned);
  // Stopped while the ninth file is looked at: eight are written down, two by two.
  struct Stop {};
  ShardRunOptions options = shard(0);
  options.progress = [](std::size_t done, std::size_t) {
    if (done == 9) {
      throw Stop{};
    }
  };
  EXPECT_THROW(static_cast<void>(run_shard(memory.env, "/plan", planned->plan, options)), Stop);
  auto standing = standing_of(memory.files, "/plan", planned->plan, 0);
  EXPECT_EQ(standing.state, ShardState::partly);
  EXPECT_EQ(standing.files_done, 8U);
  EXPECT_FAILS(read_result(memory.files, "/plan", planned->plan, 0), ErrorCode::no_input);
  const auto again = run_shard(memory.env, "/plan", planned->plan, shard(0));
  ASSERT_OK(again);
  std::size_t failed = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    failed += again->files[i].status == RepairStatus::failed ? 1 : 0;
  }
  EXPECT_EQ(again->done_before, 8 - failed) << "what failed is tried again";
  standing = standing_of(memory.files, "/plan", planned->plan, 0);
  EXPECT_EQ(standing.state, ShardState::done);
}

TEST_F(Archive, TwoRunsOfOneShardAtATimeAreRefused) {
  MemoryEnv memory;
  fill(memory.files, 6, 4);
  const auto planned = plan(memory, draft(2));
  ASSERT_OK(planned);
  std::size_t refused = 0;
  ShardRunOptions options = shard(0);
  options.progress = [&](std::size_t done, std::size_t) {
    if (done == 0) {
      const auto other = run_shard(memory.env, "/plan", planned->plan, shard(0));
      EXPECT_FAILS(other, ErrorCode::cannot_create);
      EXPECT_EQ(standing_of(memory.files, "/plan", planned->plan, 0).state, ShardState::running);
      EXPECT_OK(run_shard(memory.env, "/plan", planned->plan, shard(1))) << "another shard may";
      ++refused;
    }
  };
  EXPECT_OK(run_shard(memory.env, "/plan", planned->plan, options));
  EXPECT_EQ(refused, 1U);
}

TEST_F(Archive, AFileThatChangedSinceThePlanIsReportedAndNotMended) {
  for (const bool hash : {false, true}) {
    MemoryEnv memory;
    Random random(1);
    ASSERT_OK(memory.files.make_folders("/archive"));
    MadeRecording made = few_seconds(random);
    made.firmware = "1.5.0";
    made.serial = "MOS2A45130450";
    for (const char* name : {"changed", "gone", "same", "touched"}) {
      ASSERT_OK(made.write(memory.files, std::string("/archive/") + name + ".gt3x"));
    }
    ArchiveDraft how = draft(1);
    how.hash = hash;
    const auto planned = plan(memory, how);
    ASSERT_OK(planned);
    made.raw[3][1] += 1;  // the size is the same
    ASSERT_OK(memory.files.remove("/archive/changed.gt3x"));
    ASSERT_OK(made.write(memory.files, "/archive/changed.gt3x"));
    made.raw[3][1] -= 1;
    ASSERT_OK(memory.files.remove("/archive/touched.gt3x"));
    ASSERT_OK(made.write(memory.files, "/archive/touched.gt3x"));  // the same bytes, another time
    ASSERT_OK(memory.files.remove("/archive/gone.gt3x"));
    const auto result = run_shard(memory.env, "/plan", planned->plan, shard(0));
    ASSERT_OK(result);
    EXPECT_EQ(result->files[0].status, RepairStatus::failed);
    EXPECT_EQ(result->files[0].error->code, ErrorCode::bad_data);
    EXPECT_THAT(result->files[0].reasons.front(), HasSubstr("changed"));
    EXPECT_FALSE(memory.files.info("/mended/changed.gt3x"));
    EXPECT_EQ(result->files[1].status, RepairStatus::failed);
    EXPECT_EQ(result->files[1].error->code, ErrorCode::no_input);
    EXPECT_EQ(result->files[2].status, RepairStatus::repaired);
    EXPECT_EQ(result->files[3].status, hash ? RepairStatus::repaired : RepairStatus::failed)
        << "where there is a hash, the hash decides";
  }
}

TEST_F(Archive, CutsShardsAsEvenlyAsTheFilesAllow) {
  Random random(8);
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<std::uint64_t> bytes(1 + random.below(12));
    for (auto& size : bytes) {
      size = random.below(4) == 0 ? random.below(1000) : random.below(20);
    }
    const std::size_t shards = 1 + random.below(bytes.size() + 2);
    const auto ends = cut_into_shards(bytes, shards);
    ASSERT_EQ(ends.size(), std::min(shards, bytes.size()));
    ASSERT_EQ(ends.back(), bytes.size());
    const auto largest = [&](const std::vector<std::size_t>& cuts) {
      std::uint64_t most = 0;
      std::size_t from = 0;
      for (const std::size_t to : cuts) {
        most = std::max(most, std::accumulate(bytes.begin() + static_cast<std::ptrdiff_t>(from),
                                              bytes.begin() + static_cast<std::ptrdiff_t>(to),
                                              std::uint64_t{0}));
        from = to;
      }
      return most;
    };
    for (std::size_t k = 0; k < ends.size(); ++k) {
      EXPECT_LT(k == 0 ? 0 : ends[k - 1], ends[k]) << "no shard is empty";
    }
    // Oracle: every way to cut.
    std::uint64_t best = ~0ULL;
    for (unsigned mask = 0; mask < 1U << (bytes.size() - 1); ++mask) {
      std::vector<std::size_t> cuts;
      for (std::size_t i = 1; i < bytes.size(); ++i) {
        if ((mask >> (i - 1) & 1U) != 0) {
          cuts.push_back(i);
        }
      }
      cuts.push_back(bytes.size());
      if (cuts.size() <= shards) {
        best = std::min(best, largest(cuts));
      }
    }
    EXPECT_EQ(largest(ends), best);
  }
}

TEST_F(Archive, PathsOfAnyBytesComeBack) {
  Random random(2);
  for (int trial = 0; trial < 200; ++trial) {
    std::string path;
    for (std::uint64_t i = random.below(30); i > 0; --i) {
      path += static_cast<char>(random.below(256));
    }
    const std::string text = encode_path(path);
    for (const char c : text) {
      EXPECT_TRUE(c >= 0x20 && c < 0x7f);
    }
    EXPECT_EQ(decode_path(text).value(), path);
  }
  for (const char* damaged : {"%", "%4", "%4g", "a%zz"}) {
    EXPECT_FALSE(decode_path(damaged)) << damaged;
  }
}

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
    ASSERT_OK((*file)->write_at(
        0, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size())));
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
  static std::string hash(const std::string& text) {
    return to_hex(
        sha256(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size())));
  }
  Result<ShardResult> run_first() {
    SIXPOINT_ASSIGN(const auto read, read_plan(memory_.files, "/plan"));
    return run_shard(memory_.env, "/plan", read, shard(0));
  }

  MemoryEnv memory_;
  ArchivePlan plan_;
};

TEST_F(HostilePlan, EditedByHandIsRefused) {
  const std::string good = text("/plan/plan.json");
  replace("/plan/plan.json", edited(good, "\"wide\": false", "\"wide\": true"));
  EXPECT_FAILS(read_plan(memory_.files, "/plan"), ErrorCode::configuration);
  replace("/plan/plan.json", good);
  EXPECT_OK(read_plan(memory_.files, "/plan"));
  const std::string manifest = text("/plan/shards/00000.jsonl");
  replace("/plan/shards/00000.jsonl", manifest + manifest.substr(0, manifest.find('\n') + 1));
  EXPECT_FAILS(run_first(), ErrorCode::configuration);
  EXPECT_FAILS(run_shard(memory_.env, "/plan", plan_, shard(2)), ErrorCode::usage);
}

TEST_F(HostilePlan, NamesThatLeaveTheArchiveAreRefused) {
  for (const char* name : {"../secret.gt3x", "a/../../x.gt3x", "/etc/x.gt3x", "", ".", "a//b",
                           "a/./b", "x%00y", "a/..", "%2E%2E/x.gt3x"}) {
    forge_manifest(std::string(R"({"root":0,"path":")") + name + R"(","size":1,"modified_ns":1})" +
                   "\n");
    SCOPED_TRACE(name);
    EXPECT_FAILS(run_first(), ErrorCode::bad_data);
  }
  forge_manifest(R"({"root":7,"path":"a","size":1,"modified_ns":1})"
                 "\n");
  EXPECT_FAILS(run_first(), ErrorCode::bad_data);
  const std::string twice = R"({"root":0,"path":"a","size":1,"modified_ns":1})"
                            "\n";
  forge_manifest(twice + twice);
  EXPECT_FAILS(run_first(), ErrorCode::bad_data);
  forge_manifest("{}\n");
  EXPECT_FAILS(run_first(), ErrorCode::bad_data);
  forge_manifest("[1,2\n");
  EXPECT_FAILS(run_first(), ErrorCode::bad_data);
  forge_manifest(R"({"root":0,"path":"a","size":-1,"modified_ns":1e300})"
                 "\n");
  const auto odd = run_first();  // numbers that fit nothing: no crash, and no such file
  EXPECT_TRUE(!odd || odd->files.front().status == RepairStatus::failed);
  EXPECT_TRUE(memory_.files.list("/mended").value_or(std::vector<std::string>()).empty());
}

TEST_F(HostilePlan, AnotherVersionAndDamageAreToldApart) {
  const std::string good = text("/plan/plan.json");
  replace("/plan/plan.json", edited(good, "archive-plan/1", "archive-plan/2"));
  EXPECT_FAILS(read_plan(memory_.files, "/plan"), ErrorCode::configuration);
  replace("/plan/plan.json", good.substr(0, good.size() / 2));
  EXPECT_FAILS(read_plan(memory_.files, "/plan"), ErrorCode::bad_data);
  replace("/plan/plan.json", "{\"schema\": 3}");
  EXPECT_FAILS(read_plan(memory_.files, "/plan"), ErrorCode::bad_data);
  // Every key left out in turn, with an id that fits.
  const auto whole = nlohmann::ordered_json::parse(good);
  for (const auto& [key, value] : whole.items()) {
    if (key == "schema" || key == "id" || key == "files" || key == "bytes") {
      continue;  // the last two are for people
    }
    auto json = whole;
    json.erase(key);
    forge_plan(json);
    SCOPED_TRACE(key);
    EXPECT_FAILS(read_plan(memory_.files, "/plan"), ErrorCode::bad_data);
    json[key] = 17;
    forge_plan(json);
    SCOPED_TRACE(key);
    EXPECT_FAILS(read_plan(memory_.files, "/plan"), ErrorCode::bad_data);
  }
  EXPECT_FAILS(read_plan(memory_.files, "/nowhere"), ErrorCode::no_input);
}

TEST_F(HostilePlan, MissingFilesOfThePlanAreNamed) {
  ASSERT_OK(memory_.files.remove("/plan/shards/00001.jsonl"));
  EXPECT_OK(run_first()) << "the other shard is whole";
  const auto lost = run_shard(memory_.env, "/plan", plan_, shard(1));
  EXPECT_FAILS(lost, ErrorCode::no_input);
  const auto merged = merge_archive(memory_.files, "/plan", plan_, {});
  ASSERT_OK(merged);
  EXPECT_FALSE(merged->complete());
  EXPECT_EQ(merged->shards[0].state, ShardState::done);
  EXPECT_EQ(merged->shards[1].state, ShardState::damaged);
  EXPECT_EQ(merged->files_missing(), plan_.shards[1].files);
}

TEST_F(HostilePlan, OutputFoldersThatCannotBe) {
  for (const char* folder : {"/archive", "/archive/mended", "/"}) {
    ShardRunOptions options = shard(0);
    options.output_folder = folder;
    SCOPED_TRACE(folder);
    EXPECT_FAILS(run_shard(memory_.env, "/plan", plan_, options), ErrorCode::usage);
  }
  EXPECT_OK(run_first());
  ShardRunOptions elsewhere = shard(1);
  elsewhere.output_folder = "/elsewhere";
  const auto other = run_shard(memory_.env, "/plan", plan_, elsewhere);
  EXPECT_FAILS(other, ErrorCode::usage);
  EXPECT_THAT(other.error().brief(), HasSubstr("/mended"));
}

TEST_F(HostilePlan, DamagedResultsAreRunAgain) {
  ASSERT_OK(run_first());
  const std::string good = text("/plan/results/00000.jsonl");
  Random random(1);
  for (int trial = 0; trial < 60; ++trial) {
    std::string bad = good;
    if (trial % 2 == 0) {
      bad.resize(random.below(good.size()));
    } else {
      bad[random.below(good.size())] ^= static_cast<char>(1U << random.below(7));
    }
    replace("/plan/results/00000.jsonl", bad);
    const auto read = read_result(memory_.files, "/plan", plan_, 0);
    if (read) {  // only the header's words for people may differ
      EXPECT_EQ(read->files.size(), plan_.shards[0].files);
      continue;
    }
    EXPECT_EQ(standing_of(memory_.files, "/plan", plan_, 0).state, ShardState::damaged);
    ASSERT_OK(run_first());
    EXPECT_OK(read_result(memory_.files, "/plan", plan_, 0)) << "trial " << trial;
  }
}

TEST_F(HostilePlan, VerifyFindsAnOutputThatWasTouched) {
  ASSERT_OK(run_first());
  const auto result = read_result(memory_.files, "/plan", plan_, 0);
  ASSERT_OK(result);
  const auto mended =
      std::find_if(result->files.begin(), result->files.end(),
                   [](const auto& report) { return report.status == RepairStatus::repaired; });
  ASSERT_NE(mended, result->files.end());
  replace(mended->output, "touched");
  MergeOptions options;
  const auto blind = merge_archive(memory_.files, "/plan", plan_, options);
  ASSERT_OK(blind);
  options.verify = true;
  const auto merged = merge_archive(memory_.files, "/plan", plan_, options);
  ASSERT_OK(merged);
  EXPECT_EQ(merged->shards[0].failed, blind->shards[0].failed + 1);
}

TEST_F(Archive, TheSnapshotGivesWhatTheStoreGives) {
  MemoryEnv memory;
  auto store = db::Store::open(memory.env, ":memory:");
  ASSERT_OK(store);
  db::ConstantsRecord record;
  record.serial = "MOS2A45130450";
  record.filter = "current";
  record.method = "jig";
  record.made_at = from_unix_seconds(1'700'000'000);
  record.document = kConstants;
  const auto first = store->add_constants(record, "");
  ASSERT_OK(first);
  record.made_at = from_unix_seconds(1'700'000'001);
  const auto second = store->add_constants(record, "");
  ASSERT_OK(second);
  record.filter = "legacy";
  record.serial = "MOS2A45130451";
  ASSERT_OK(store->add_constants(record, ""));
  ASSERT_OK(store->withdraw_constants(*second, "A. Tester", "wrong jig"));
  const auto taken = ConstantsSnapshot::of_store(*store);
  ASSERT_OK(taken);
  const auto snapshot = ConstantsSnapshot::parse(taken->to_json_lines());
  ASSERT_OK(snapshot);
  EXPECT_EQ(snapshot->size(), 1U);
  ASSERT_NE(snapshot->find("MOS2A45130450"), nullptr);
  EXPECT_EQ(snapshot->find("MOS2A45130450")->id, *first) << "the second one was withdrawn";
  EXPECT_EQ(snapshot->find("MOS2A45130451"), nullptr) << "legacy mends nothing";
  EXPECT_FAILS(ConstantsSnapshot::parse("{\"serial\": 3}\n"), ErrorCode::bad_data);
}

TEST_F(Archive, ScriptsKeepAnyFolderOneWord) {
  EXPECT_EQ(shell_word("/plain/path-1.2"), "/plain/path-1.2");
  EXPECT_EQ(shell_word(""), "''");
  EXPECT_EQ(shell_word("it's; rm -rf $HOME\n"), "'it'\\''s; rm -rf $HOME\n'");
  const std::string script = slurm_script({"/p", "sixpoint", 12, 5});
  EXPECT_THAT(script, HasSubstr("#SBATCH --array=0-11%5\n"));
  EXPECT_THAT(slurm_script({"/p", "sixpoint", 12, 0}), HasSubstr("#SBATCH --array=0-11\n"));
}

}  // namespace
}  // namespace sixpoint::repair
