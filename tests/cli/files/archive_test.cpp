// archive by its contract, on the real disk: against one repair, through its scripts, with kill -9.
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <thread>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>
#include <unistd.h>

#include "base/random.h"
#include "cli/files/archive_fixture.h"
#include "cli/files/file_stream.h"
#include "db/store.h"
#include "shared_data.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using tests::Answer;
using tests::ArchiveCommand;
using tests::kConstants;
using tests::MadeRecording;
using tests::some_minutes;

TEST_F(ArchiveCommand, AnswersAsOneRepairWould) {
  fill();
  const Answer expected =
      run({"repair", archive_, "-o", folder_ / "whole", "--constants", constants_, "--json"});
  const Answer planned = plan({"--shards", "3"});
  EXPECT_EQ(planned.exit_code, 0) << planned.people;
  EXPECT_EQ(planned.json()["schema"], "sixpoint/archive/1");
  EXPECT_EQ(planned.json()["shards"].size(), 3U);
  EXPECT_EQ(planned.json()["files"].size(), 8U);
  EXPECT_EQ(planned.json()["summary"]["files"], 8);
  for (std::size_t shard = 0; shard < 3; ++shard) {
    const Answer done = run_shard(shard, shard + 1);  // with any number of threads
    EXPECT_EQ(done.json()["shards"][0]["shard"], shard) << done.people;
    EXPECT_EQ(done.json()["summary"]["files"], done.json()["files"].size());
  }
  const Answer merged = merge();
  EXPECT_EQ(merged.exit_code, expected.exit_code) << merged.people;
  EXPECT_EQ(merged.exit_code, 65) << "one file is no zip";
  EXPECT_EQ(merged.json()["schema"], "sixpoint/archive/1");
  EXPECT_EQ(merged.json()["summary"], expected.json()["summary"]);
  EXPECT_EQ(comparable(merged.json()), comparable(expected.json()));
  EXPECT_EQ(merged.json()["complete"], true);
  expect_same_outputs(folder_ / "whole", out_);
  const auto manifest_of = [&](const std::string& folder) {
    const Bytes text = read_file(files_, folder + "/manifest.json", 1U << 20U).value();
    std::map<std::string, std::string> lines;
    const Json manifest = Json::parse(text.begin(), text.end());
    for (const Json& file : manifest["files"]) {
      lines[file["input"]] = file["status"].dump() + file["source"].dump() +
                             file["still_error_mg"].dump() + file["input_sha256"].dump();
    }
    EXPECT_EQ(lines.size(), 8U);
    return lines;
  };
  EXPECT_EQ(manifest_of(out_), manifest_of(folder_ / "whole"));
  // For people the two say the same, line by line.
  const Answer words = run({"archive", "merge", plan_});
  const Answer as_repair =
      run({"repair", archive_, "-o", folder_ / "whole", "--constants", constants_, "--resume"});
  EXPECT_EQ(words.out,
            std::regex_replace(as_repair.out, std::regex(" *repaired by an earlier run\n"), ""));
}

TEST_F(ArchiveCommand, MissingAndFailedShardsAreNamedWithTheirCommand) {
  fill();
  const std::size_t broken = shard_of(plan({"--shards", "4"}).json(), "broken.gt3x");
  ASSERT_NE(broken, 1U);
  EXPECT_EQ(merge().exit_code, 2) << "nothing ran yet";
  EXPECT_THAT(merge().json()["shards"][0]["rerun"].get<std::string>(), HasSubstr("-o OUTDIR"));
  const Answer before = run({"archive", "status", plan_, "--json"});
  EXPECT_EQ(before.exit_code, 2);
  EXPECT_EQ(before.json()["summary"]["missing"], 4);
  run_shard(0);
  run_shard(2);
  run_shard(3);
  const Answer merged = merge();
  const Json shard = merged.json()["shards"][1];
  EXPECT_EQ(shard["state"], "missing");
  EXPECT_EQ(merged.json()["complete"], false);
  EXPECT_EQ(merged.json()["files_missing"], shard["files"]);
  const std::string command = shard["rerun"];
  EXPECT_EQ(command, "sixpoint archive run " + plan_ + " --shard 1 -o " + out_);
  EXPECT_THAT(run({"archive", "merge", plan_}).people, HasSubstr(command));
  // The command as it is printed.
  const std::string line = std::string(SIXPOINT_PROGRAM) + command.substr(8) + " >/dev/null 2>&1";
  EXPECT_EQ(std::system(line.c_str()), 0);
  EXPECT_EQ(merge().json()["complete"], true);
  // The shard with the file that is no zip is named, too; remove the cause, and it is done.
  std::string again;
  const Json shards = merge().json()["shards"];
  for (const Json& one : shards) {
    if (!one["rerun"].is_null()) {
      EXPECT_EQ(one["failed"], 1);
      EXPECT_TRUE(again.empty());
      again = one["rerun"];
    }
  }
  EXPECT_THAT(again, HasSubstr(" --shard " + std::to_string(broken) + " "));
  EXPECT_EQ(run({"archive", "status", plan_, "--json"}).json()["summary"]["failed"], 1);
}

TEST_F(ArchiveCommand, AnArchiveThatIsNotCompleteIsNeverDone) {
  EXPECT_OK(some_minutes(1, 900).write(files_, archive_ + "/a.gt3x"));
  MadeRecording stranger = some_minutes(2, 900);
  stranger.serial = "MOS2A45130451";
  EXPECT_OK(stranger.write(files_, archive_ + "/b.gt3x"));
  const Json planned = plan({"--shards", "2"}).json();
  const std::size_t of_stranger = shard_of(planned, "b.gt3x");
  EXPECT_EQ(run_shard(of_stranger).exit_code, 1) << "the constants are those of another unit";
  const Answer merged = merge();
  EXPECT_EQ(merged.json()["summary"]["not_repairable"], 1);
  EXPECT_EQ(merged.json()["complete"], false);
  EXPECT_EQ(merged.exit_code, 2) << "the other shard never ran";
  run_shard(1 - of_stranger);
  EXPECT_EQ(merge().exit_code, 1) << "now all is known";
  std::ofstream(plan_ + "/results/0000" + std::to_string(1 - of_stranger) + ".jsonl", std::ios::app)
      << "x";
  const Answer damaged = merge();
  EXPECT_EQ(damaged.json()["complete"], false);
  EXPECT_EQ(damaged.exit_code, 2) << "what is damaged is not known";
}

// So one that is stopped, or fails, on its way leaves no half of a document.
TEST(FileStreamOfAnArchive, WritesItsDocumentAtTheEnd) {
  std::ostringstream out;
  std::ostringstream people;
  std::istringstream in;
  Context context{posix_env(), out, people, in};
  FileStream files(context, /*json=*/true);
  files.add(Json{{"input", "a.gt3x"}});
  files.add(Json{{"input", "b.gt3x"}});
  EXPECT_EQ(out.str(), "");
  files.end({{"complete", false}});
  EXPECT_EQ(Json::parse(out.str()), Json::parse(R"({"schema": "sixpoint/archive/1",
      "files": [{"input": "a.gt3x"}, {"input": "b.gt3x"}], "complete": false})"));
}

TEST_F(ArchiveCommand, WhereOnlyAnotherPlanHelpsNoRunIsAdvised) {
  fill();
  std::filesystem::remove(archive_ + "/sub/broken.gt3x");
  plan({"--shards", "2"});
  std::ofstream(archive_ + "/plain.gt3x", std::ios::app) << "x";
  run_shard(0);
  run_shard(1);
  const Answer changed = run({"archive", "merge", plan_});
  EXPECT_EQ(changed.exit_code, 65);
  EXPECT_THAT(changed.people, HasSubstr("1 of its "));
  EXPECT_THAT(changed.people, HasSubstr("changed since the plan was made"));
  EXPECT_THAT(changed.people, HasSubstr("make another plan"));
  EXPECT_THAT(changed.people, testing::Not(HasSubstr("archive run")));
  const Json shards = merge().json()["shards"];
  for (const Json& shard : shards) {
    EXPECT_TRUE(shard["rerun"].is_null()) << shard;
  }
  // A result that is damaged is another matter.
  std::ofstream(plan_ + "/results/00000.jsonl", std::ios::app) << "x";
  EXPECT_THAT(run({"archive", "merge", plan_}).people,
              HasSubstr("archive run " + plan_ + " --shard 0"));
  std::ofstream(plan_ + "/shards/00000.jsonl", std::ios::app) << "x";
  const Answer damaged = run({"archive", "merge", plan_});
  EXPECT_EQ(damaged.exit_code, 65);
  EXPECT_THAT(damaged.people, HasSubstr("shard 0: its list of "));
  EXPECT_THAT(damaged.people, HasSubstr("make another plan"));
  EXPECT_THAT(damaged.people, testing::Not(HasSubstr("archive run")));
}

// A run fails again as long as the file is gone; the plan of what is there does not name it.
TEST_F(ArchiveCommand, WhereAFileIsGoneAnotherPlanIsAskedFor) {
  EXPECT_OK(some_minutes(1, 900).write(files_, archive_ + "/a.gt3x"));
  EXPECT_OK(some_minutes(2, 900).write(files_, archive_ + "/b.gt3x"));
  ASSERT_EQ(plan().exit_code, 0);
  std::filesystem::remove(archive_ + "/b.gt3x");
  run_shard(0);
  const Answer gone = run({"archive", "merge", plan_});
  EXPECT_EQ(gone.exit_code, 66);
  EXPECT_THAT(gone.people,
              HasSubstr("1 of its 2 files changed since the plan was made, or are gone"));
  EXPECT_THAT(gone.people, HasSubstr("make another plan"));
  EXPECT_THAT(gone.people, testing::Not(HasSubstr("archive run")));
  EXPECT_TRUE(merge().json()["shards"][0]["rerun"].is_null());
}

// The command that runs it would be refused (73) as long as it runs.
TEST_F(ArchiveCommand, ForAShardThatIsRunningTheMergeSaysToWait) {
  fill();
  plan({"--shards", "3"});
  const Json before = merge().json()["shards"];
  std::filesystem::create_directories(plan_ + "/results");
  const auto held = files_.lock(plan_ + "/results/00000.lock");
  ASSERT_OK(held);
  const Answer words = run({"archive", "merge", plan_});
  EXPECT_EQ(words.exit_code, 2);
  EXPECT_THAT(words.people, HasSubstr("shard 0 is running (0 of "));
  EXPECT_THAT(words.people, HasSubstr("files): wait for it\n"));
  EXPECT_THAT(words.people, testing::Not(HasSubstr("--shard 0 ")));
  EXPECT_THAT(words.people, HasSubstr("or all of them: sbatch --array=1,2 "));
  const Json shards = merge().json()["shards"];
  EXPECT_FALSE(before[0]["rerun"].is_null());
  EXPECT_TRUE(shards[0]["rerun"].is_null());
}

TEST_F(ArchiveCommand, AnOutputThatWasTouchedIsRemovedBeforeTheRunIsAdvised) {
  EXPECT_OK(some_minutes(1, 900).write(files_, archive_ + "/a.gt3x"));
  ASSERT_EQ(plan().exit_code, 0);
  run_shard(0);
  const std::string output = out_ + "/a.gt3x";
  const Bytes whole = read_file(files_, output).value();
  Bytes touched = whole;
  touched[touched.size() / 2] ^= 1U;
  std::ofstream(output, std::ios::binary | std::ios::trunc)
      << std::string(touched.begin(), touched.end());
  const std::string command = "sixpoint archive run " + plan_ + " --shard 0 -o " + out_;
  const Answer found = run({"archive", "merge", plan_, "--verify"});
  EXPECT_EQ(found.exit_code, 65);
  EXPECT_THAT(found.people, HasSubstr("look at them, remove what is wrong, then: " + command));
  EXPECT_THAT(found.people, testing::Not(HasSubstr("try them again")));
  EXPECT_TRUE(merge({"--verify"}).json()["shards"][0]["rerun"].is_null());
  std::filesystem::remove(output);
  EXPECT_THAT(run({"archive", "merge", plan_, "--verify"}).people,
              HasSubstr("1 of its 1 files failed; try them again: " + command));
  EXPECT_EQ(run_shard(0).exit_code, 0);
  EXPECT_EQ(merge({"--verify"}).exit_code, 0);
}

// Slurm kills what takes more memory than it asked for.
TEST_F(ArchiveCommand, AMergeThatIsKilledLeavesTheEarlierAnswer) {
  fill();
  ASSERT_EQ(plan({"--shards", "1"}).exit_code, 0);
  run_shard(0);
  const auto job = [&](const std::string& program) {
    const std::string line = "env SIXPOINT=" + program + " bash " + plan_ + "/merge.sbatch 2>&1";
    const int status = std::system((line + " >/dev/null").c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  };
  const auto answer = [&] { return Json::parse(std::ifstream(plan_ + "/merge.json")); };
  EXPECT_EQ(job(SIXPOINT_PROGRAM), 65) << "one file is no zip";
  const Json whole = answer();
  EXPECT_EQ(whole["complete"], true);
  for (const char* printed : {"", "{\n\"schema\": 1,\n\"files\": [\n"}) {
    std::ofstream(folder_ / "killed") << "#!/bin/sh\nprintf '" << printed << "'\nkill -9 $$\n";
    std::filesystem::permissions(folder_ / "killed", std::filesystem::perms::owner_all);
    EXPECT_EQ(job(folder_ / "killed"), 137);
    EXPECT_EQ(answer(), whole);
  }
  std::filesystem::remove(plan_ + "/results/00000.jsonl");
  EXPECT_EQ(job(SIXPOINT_PROGRAM), 2);
  EXPECT_EQ(answer()["complete"], false) << "a whole answer takes its place";
}

TEST_F(ArchiveCommand, TheSlurmScriptRunsOneShardPerTask) {
  plan_ = folder_ / "it's a\nplan; exit 9";
  out_ = folder_ / "out put";
  fill();
  const Answer planned = plan({"--shards", "3", "--at-once", "2"});
  ASSERT_EQ(planned.exit_code, 0) << planned.people;
  const std::size_t broken = shard_of(planned.json(), "broken.gt3x");
  const Bytes bytes = read_file(files_, plan_ + "/run.sbatch").value();
  const std::string script(bytes.begin(), bytes.end());
  EXPECT_TRUE(script.starts_with("#!/bin/bash\n"));
  EXPECT_THAT(script, HasSubstr("\n#SBATCH --array=0-2%2\n"));
  // Slurm runs a copy of the script, somewhere else.
  std::filesystem::create_directories(folder_ / "spool");
  std::filesystem::copy(plan_ + "/run.sbatch", folder_ / "spool/slurm_script");
  const auto task = [&](const std::string& environment) {
    const std::string line = "cd " + (folder_ / "spool") + " && env " + environment +
                             " SIXPOINT=" SIXPOINT_PROGRAM " bash ./slurm_script '" + out_ +
                             "' >/dev/null 2>&1";
    const int status = std::system(line.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  };
  EXPECT_NE(task("-u SLURM_ARRAY_TASK_ID"), 0) << "without sbatch it says what to do";
  for (std::size_t shard = 0; shard < 3; ++shard) {
    EXPECT_EQ(task("SLURM_ARRAY_TASK_ID=" + std::to_string(shard)), shard == broken ? 65 : 0)
        << "the file that is no zip makes its task fail; one that cannot be repaired does not";
  }
  EXPECT_EQ(task("SLURM_ARRAY_TASK_ID=3"), 64) << "no such shard";
  EXPECT_EQ(merge().json()["complete"], true);
  EXPECT_EQ(merge().json()["summary"]["repaired"], 5);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "spool/X")) << "a file name was run as a command";
}

TEST_F(ArchiveCommand, ThePlainScriptRunsAllAndMerges) {
  fill();
  std::filesystem::remove(archive_ + "/sub/broken.gt3x");
  ASSERT_EQ(plan({"--shards", "3"}).exit_code, 0);
  const auto run_all = [&](const std::string& output) {
    const std::string line = "env SIXPOINT=" SIXPOINT_PROGRAM " JOBS=2 bash " + plan_ +
                             "/run_all.sh " + output + " >/dev/null 2>&1";
    const int status = std::system(line.c_str());
    return WEXITSTATUS(status);
  };
  EXPECT_EQ(run_all(out_), 1) << "one file cannot be repaired";
  EXPECT_EQ(run_all(folder_ / "other"), 2) << "the plan is repaired into another folder: refused";
  EXPECT_EQ(merge().json()["complete"], true);
  EXPECT_THAT(next_of(run({"archive", "merge", plan_})),
              testing::ElementsAre("archive", "report", plan_, "-o", "report.html"));
}

// The real program, killed again and again at any moment; what it leaves is what one repair leaves.
TEST_F(ArchiveCommand, SurvivesKillNine) {
  for (int i = 0; i < 24; ++i) {
    ASSERT_OK(some_minutes(static_cast<std::uint64_t>(i), 20'000)
                  .write(files_, archive_ + "/" + std::to_string(i) + ".gt3x"));
  }
  const Answer expected =
      run({"repair", archive_, "-o", folder_ / "whole", "--constants", constants_, "--json"});
  ASSERT_EQ(expected.exit_code, 0);
  ASSERT_EQ(plan({"--shards", "1"}).exit_code, 0);
  Random random(1);
  int killed = 0;
  for (int round = 0; round < 60; ++round) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      std::freopen("/dev/null", "w", stdout);
      std::freopen("/dev/null", "w", stderr);
      ::execl(SIXPOINT_PROGRAM, "sixpoint", "archive", "run", plan_.c_str(), "--shard", "0", "-o",
              out_.c_str(), nullptr);
      ::_exit(127);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2 + random.below(60)));
    ::kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    if (WIFEXITED(status)) {
      EXPECT_EQ(WEXITSTATUS(status), 0);
      break;
    }
    ++killed;
  }
  EXPECT_GT(killed, 0);
  const Answer last = run_shard(0);
  EXPECT_EQ(last.exit_code, 0) << last.people;
  const Answer merged = merge({"--verify"});
  EXPECT_EQ(merged.exit_code, 0) << merged.people;
  EXPECT_EQ(merged.json()["summary"], expected.json()["summary"]);
  expect_same_outputs(folder_ / "whole", out_);
  EXPECT_EQ(run_shard(0).json()["shards"][0]["done_before"], 24) << "nothing is left to do";
}

TEST_F(ArchiveCommand, TheMergeAddsToTheStoreOnce) {
  fill();
  const std::string store = folder_ / "store.db";
  {
    auto made = db::Store::open(posix_env(), store);
    ASSERT_OK(made);
    ASSERT_OK(made->add_constants(tests::jig_constants(), "wGT3X-BT"));
  }
  ASSERT_EQ(
      run({"archive", "plan", archive_, "-o", plan_, "--store", store, "--shards", "2"}).exit_code,
      0);
  const auto rows = [&] {
    return run({"audit", "verify", "--store", store, "--json"}).json()["rows"];
  };
  const Json before = rows();
  run_shard(0);
  run_shard(1);
  EXPECT_EQ(rows(), before) << "no shard touches the store";
  const Answer dry = merge({"--dry-run"});
  EXPECT_EQ(rows(), before);
  const Answer merged = merge();
  EXPECT_EQ(merged.json()["kept"]["in"], "store") << merged.people;
  EXPECT_EQ(rows(), before.get<int>() + 5);
  EXPECT_EQ(merged.json()["files"][0]["method"], "store");
  merge();
  // A shard that is lost and run again made nothing new: the outputs are there.
  std::filesystem::remove(plan_ + "/results/00000.jsonl");
  run_shard(0);
  merge({"--store", store});
  EXPECT_EQ(rows(), before.get<int>() + 5) << "each repair is in the store once";
  {
    auto opened = db::Store::open(posix_env(), store);
    ASSERT_OK(opened);
    const auto history = opened->unit_history("MOS2A45130450");
    ASSERT_OK(history);
    ASSERT_EQ(history->repairs.size(), 5U);
    for (const db::RepairRecord& repair : history->repairs) {
      EXPECT_EQ(repair.constants_id, history->constants.front().id);
      EXPECT_FALSE(repair.software.empty());
      const Json document = Json::parse(repair.document);
      EXPECT_EQ(document["status"], "repaired");
    }
  }
  EXPECT_TRUE(merge().json()["withdrawn"].empty());
  const Json history = run({"history", "MOS2A45130450", "--store", store, "--json"}).json();
  const std::string id = history["constants"][0]["id"];
  ASSERT_EQ(run({"store", "withdraw", id, "--why", "out of level", "--store", store}).exit_code, 0);
  const Answer late = merge();
  const Json withdrawn = late.json()["withdrawn"];
  ASSERT_EQ(withdrawn.size(), 1U);
  EXPECT_EQ(withdrawn[0]["constants"], id);
  EXPECT_EQ(withdrawn[0]["files"], 5);
  EXPECT_EQ(withdrawn[0]["reason"], "out of level");
  EXPECT_THAT(late.people, HasSubstr("constants " + id.substr(0, 12) + " were withdrawn"));
  EXPECT_THAT(late.people, HasSubstr("5 files were repaired with them"));
  // Another store may be told; constants that it does not have are not named.
  const std::string other = folder_ / "other.db";
  ASSERT_OK(db::Store::open(posix_env(), other));
  EXPECT_EQ(merge({"--store", other}).json()["kept"]["in"], "store");
  EXPECT_EQ(merge({"--store", folder_ / "none.db"}).exit_code, 66);
}

TEST_F(ArchiveCommand, TwoInputsOfOneNameAndLinksOut) {
  fill();
  std::filesystem::remove(archive_ + "/sub/broken.gt3x");
  std::filesystem::create_directories(folder_ / "second");
  EXPECT_OK(some_minutes(1, 300).write(files_, folder_ / "second/plain.gt3x"));
  EXPECT_OK(some_minutes(2, 300).write(files_, folder_ / "second/other.gt3x"));
  std::filesystem::create_symlink(folder_ / "second/other.gt3x", archive_ + "/link.gt3x");
  const Answer planned = plan({folder_ / "second"});
  EXPECT_EQ(planned.exit_code, 73) << planned.people;
  EXPECT_EQ(planned.json()["summary"]["refused"], 1);
  EXPECT_EQ(planned.json()["summary"]["links_not_followed"], 1);
  EXPECT_THAT(planned.people, HasSubstr("link.gt3x"));
  EXPECT_EQ(run_shard(0).exit_code, 1);
  const Answer merged = merge();
  EXPECT_EQ(merged.exit_code, 73);
  EXPECT_EQ(merged.json()["summary"]["failed"], 1);
  EXPECT_EQ(merged.json()["summary"]["repaired"], 6);
}

TEST_F(ArchiveCommand, ALinkThatIsNotFollowedIsNamedAlsoWhereNoFileIsLeft) {
  std::filesystem::create_directories(folder_ / "second");
  EXPECT_OK(some_minutes(2, 300).write(files_, folder_ / "second/other.gt3x"));
  std::filesystem::create_symlink(folder_ / "second", archive_ + "/sub/link");
  const Answer planned = plan();
  EXPECT_EQ(planned.exit_code, 66);
  EXPECT_THAT(planned.people, HasSubstr("sub/link leads out of the tree"));
}

TEST_F(ArchiveCommand, ALinkInTheOutputFolderLeadsNoFileOut) {
  std::filesystem::create_directories(archive_ + "/b");
  EXPECT_OK(some_minutes(2, 300).write(files_, archive_ + "/b/a.gt3x"));
  std::filesystem::create_directories(out_);
  std::filesystem::create_symlink(archive_ + "/sub", out_ + "/b");
  ASSERT_EQ(plan().exit_code, 0);
  const Answer ran = run_shard(0);
  EXPECT_EQ(ran.exit_code, 73) << ran.people;
  EXPECT_THAT(ran.out, HasSubstr("leads out of it"));
  EXPECT_TRUE(std::filesystem::is_empty(archive_ + "/sub"));
}

TEST_F(ArchiveCommand, WrongCommandsHaveTheirExitCodes) {
  fill();
  EXPECT_EQ(run({"archive"}).exit_code, 64);
  EXPECT_EQ(run({"archive", "plan", archive_}).exit_code, 64);
  EXPECT_EQ(run({"archive", "plan", folder_ / "none", "-o", plan_}).exit_code, 66);
  std::filesystem::create_directories(folder_ / "empty");
  EXPECT_EQ(run({"archive", "plan", folder_ / "empty", "-o", plan_}).exit_code, 66);
  EXPECT_EQ(plan({"--shards", "0"}).exit_code, 64);
  EXPECT_EQ(plan({"--shards", "2", "--shard-bytes", "1MB"}).exit_code, 64);
  EXPECT_EQ(plan({"--shard-bytes", "0"}).exit_code, 64);
  EXPECT_EQ(plan({"--at-once", "4294967297"}).exit_code, 64);
  EXPECT_EQ(plan({"--dry-run"}).exit_code, 0);
  EXPECT_FALSE(std::filesystem::exists(plan_));
  EXPECT_EQ(plan({"--shard-bytes", "100kB"}).exit_code, 0);
  EXPECT_GT(run({"archive", "status", plan_, "--json"}).json()["shards"].size(), 2U);
  EXPECT_EQ(plan().exit_code, 73) << "a plan is never changed";
  EXPECT_EQ(run_shard(999).exit_code, 64);
  EXPECT_EQ(run({"archive", "run", plan_, "--shard", "-1", "-o", out_}).exit_code, 64);
  EXPECT_EQ(run({"archive", "run", folder_ / "empty", "--shard", "0", "-o", out_}).exit_code, 66);
  EXPECT_EQ(run({"archive", "run", plan_, "--shard", "0", "-o", archive_ + "/out"}).exit_code, 64);
  EXPECT_EQ(run({"archive", "run", plan_, "--shard", "0", "-o", out_, "--dry-run"}).exit_code, 0);
  EXPECT_FALSE(std::filesystem::exists(out_));
  EXPECT_EQ(merge().exit_code, 2);
  std::ofstream(folder_ / "file") << "x";
  EXPECT_EQ(run({"archive", "run", plan_, "--shard", "0", "-o", folder_ / "file"}).exit_code, 73);
}

TEST_F(ArchiveCommand, RealRecordings) {
  SIXPOINT_NEED_SHARED("data/wgt3x-bt-affected");
  const std::string real = tests::shared_file("data/wgt3x-bt-affected");
  const Answer expected = run({"repair", real, "-o", folder_ / "whole", "--scan", "--json"});
  ASSERT_GE(expected.json()["files"].size(), 2U);
  ASSERT_EQ(
      run({"archive", "plan", real, "-o", plan_, "--scan", "--shards", "2", "--hash"}).exit_code,
      0);
  run_shard(0);
  run_shard(1);
  const Answer merged = merge({"--verify"});
  EXPECT_EQ(merged.exit_code, expected.exit_code);
  EXPECT_EQ(merged.json()["summary"], expected.json()["summary"]);
  EXPECT_EQ(comparable(merged.json()).size(), comparable(expected.json()).size());
}

// The recordings' own still periods do not suffice; with constants that are named, and forced
// because they are not these units', all of them are repaired.
TEST_F(ArchiveCommand, RealRecordingsRepaired) {
  SIXPOINT_NEED_SHARED("data/wgt3x-bt-affected");
  const std::string real = tests::shared_file("data/wgt3x-bt-affected");
  const Json scanned = run({"scan", real, "--json"}).json();
  for (const Json& file : scanned["files"]) {
    if (file["verdict"] != "affected") {
      continue;
    }
    const std::string serial = file["serial"];
    std::string constants = kConstants;
    constants.replace(constants.find("MOS2A45130450"), 13, serial);
    std::ofstream(constants_, std::ios::trunc) << constants;
    const std::string path = file["path"];
    const Answer expected = run({"repair", path, "-o", folder_ / ("whole" + serial), "--constants",
                                 constants_, "--force", "--json"});
    ASSERT_EQ(expected.json()["summary"]["repaired"], 1) << expected.people;
    const std::string its_plan = folder_ / ("plan" + serial);
    const std::string its_out = folder_ / ("out" + serial);
    ASSERT_EQ(run({"archive", "plan", path, "-o", its_plan, "--constants", constants_, "--force"})
                  .exit_code,
              0);
    ASSERT_EQ(run({"archive", "run", its_plan, "--shard", "0", "-o", its_out}).exit_code, 0);
    const Answer merged = run({"archive", "merge", its_plan, "--json"});
    EXPECT_EQ(merged.json()["summary"], expected.json()["summary"]);
    const std::string repaired = merged.json()["files"][0]["output"];
    const std::string whole = expected.json()["files"][0]["output"];
    EXPECT_FALSE(tests::entry_of(files_, repaired, "log.bin").empty());
    EXPECT_EQ(tests::entry_of(files_, repaired, "log.bin"),
              tests::entry_of(files_, whole, "log.bin"));
  }
}

}  // namespace
}  // namespace sixpoint::cli
