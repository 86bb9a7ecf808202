#include "repair/archive/plan_folder.h"

#include "repair/archive/archive_fixture.h"

namespace sixpoint::repair {
namespace {

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
  EXPECT_TRUE(memory_.files.list("/repaired").value_or(std::vector<std::string>()).empty());
}

TEST_F(HostilePlan, AnotherVersionAndDamageAreDistinguished) {
  const std::string good = text("/plan/plan.json");
  replace("/plan/plan.json", edited(good, "archive-plan/3", "archive-plan/4"));
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
    // A plan for other rules of repair is whole, and not for this program.
    EXPECT_FAILS(read_plan(memory_.files, "/plan"),
                 key == "rules" ? ErrorCode::configuration : ErrorCode::bad_data);
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

}  // namespace
}  // namespace sixpoint::repair
