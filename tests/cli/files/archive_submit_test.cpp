// archive beside Slurm and on disks that refuse: what it hands to sbatch, and trees that are read
// only.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>

#include <gmock/gmock.h>
#include <unistd.h>

#include "base/sha256.h"
#include "cli/files/archive_fixture.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;
using tests::Answer;
using tests::ArchiveCommand;

// All that lies below, with bytes and times of change.
std::map<std::string, std::string> everything_below(const std::string& folder) {
  std::map<std::string, std::string> all;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const auto changed = entry.last_write_time().time_since_epoch().count();
    all[entry.path()] =
        std::to_string(changed) +
        (entry.is_regular_file() ? file_sha256(posix_env().files, entry.path()).value() : "");
  }
  return all;
}

TEST_F(ArchiveCommand, AReadOnlyTreeIsReadAndStaysAsItIs) {
  fill();
  const std::string work = folder_ / "work";
  const std::string locked = folder_ / "locked";
  std::filesystem::create_directory(work);
  std::filesystem::create_directory(locked);
  using std::filesystem::perms;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(archive_)) {
    std::filesystem::permissions(entry.path(), entry.is_directory() ? perms(0555) : perms(0444));
  }
  for (const auto& [name, rights] :
       {std::pair(archive_, 0555), {locked, 0555}, {folder_.path(), 0755}}) {
    std::filesystem::permissions(name, perms(rights));
  }
  const auto before = everything_below(archive_);
  if (::geteuid() == 0) {
    ASSERT_EQ(::chown(work.c_str(), 65534, 65534), 0);
  }
  const auto as_other_user = [&](const std::vector<std::string>& words) {
    return tests::exit_code_as_other_user(words, work);
  };
  // 65: one file of fill() is no recording.
  EXPECT_EQ(as_other_user({"repair", archive_, "-o", work + "/one", "--constants", constants_}),
            65);
  EXPECT_EQ(as_other_user({"archive", "plan", archive_, "-o", work + "/plan", "--constants",
                           constants_, "--shards", "1"}),
            0);
  EXPECT_EQ(as_other_user({"archive", "run", work + "/plan", "--shard", "0", "-o", work + "/two"}),
            65);
  expect_same_outputs(work + "/one", work + "/two");
  EXPECT_EQ(everything_below(archive_), before);
  // Nothing can be written where nothing may be.
  EXPECT_EQ(as_other_user({"repair", archive_, "-o", locked + "/out", "--constants", constants_}),
            77);
  EXPECT_EQ(as_other_user({"archive", "plan", archive_, "-o", locked + "/plan"}), 77);
  EXPECT_TRUE(std::filesystem::is_empty(locked));
  for (const auto& name : {archive_, archive_ + "/sub", locked}) {
    std::filesystem::permissions(name, perms(0755));  // so that it can be removed
  }
}

// What stands between the program and Slurm: a program of the name sbatch in the path.
class SubmitCommand : public ArchiveCommand {
 protected:
  SubmitCommand() {
    fill();
    EXPECT_EQ(run({"archive", "plan", archive_, "-o", plan_, "--constants", constants_}).exit_code,
              0);
    std::filesystem::create_directories(bin_);
  }
  ~SubmitCommand() override { ::setenv("PATH", path_.c_str(), 1); }
  // `script` stands for sbatch; without one there is none.
  void sbatch(const std::string& script) {
    if (!script.empty()) {
      std::ofstream(bin_ + "/sbatch") << "#!/bin/sh\n" << script;
      std::filesystem::permissions(bin_ + "/sbatch", std::filesystem::perms::owner_all);
    }
    ::setenv("PATH", (script.empty() ? bin_ : bin_ + ":" + path_).c_str(), 1);
  }
  std::string calls() {
    const auto bytes = read_file(files_, folder_ / "calls");
    return bytes ? std::string(bytes->begin(), bytes->end()) : std::string();
  }
  // Writes its arguments down and counts jobs from 7.
  std::string writes_down() const {
    const std::string file = folder_ / "calls";
    return "printf '%s|' \"$@\" >>'" + file + "'; echo >>'" + file + "'; echo $((6 + $(wc -l <'" +
           file + "')))\n";
  }

  std::string bin_ = folder_ / "bin";
  std::string path_ = ::getenv("PATH");
};

TEST_F(SubmitCommand, TheMergeWaitsForTheArray) {
  sbatch(writes_down());
  const Answer words = run({"archive", "submit", plan_, "-o", out_, "--sbatch=--partition=long"});
  EXPECT_EQ(words.exit_code, 0) << words.people;
  EXPECT_EQ(words.out, "array 7\nmerge 8\n");
  EXPECT_EQ(calls(), "--parsable|--output=" + plan_ + "/results/slurm-%A-%a.log|--partition=long|" +
                         plan_ + "/run.sbatch|" + out_ + "|\n" +
                         "--parsable|--dependency=afterany:7|--output=" + plan_ +
                         "/merge.log|--partition=long|" + plan_ + "/merge.sbatch|\n");
  const auto json = run({"archive", "submit", plan_, "-o", out_, "--json"}).json();
  EXPECT_EQ(json["array"], "9");
  EXPECT_EQ(json["merge"], "10");
}

TEST_F(SubmitCommand, ADryRunPrintsCommandsThatAShellCanRun) {
  sbatch("");
  const Answer dry = run({"archive", "submit", plan_, "-o", out_, "--dry-run"});
  EXPECT_EQ(dry.exit_code, 0) << dry.people << "it needs no sbatch";
  sbatch(writes_down());
  EXPECT_EQ(calls(), "");
  std::ofstream(folder_ / "by_hand.sh") << dry.out;
  EXPECT_EQ(std::system(("sh " + (folder_ / "by_hand.sh") + " >/dev/null").c_str()), 0);
  const std::string by_hand = calls();
  std::filesystem::remove(folder_ / "calls");
  EXPECT_EQ(run({"archive", "submit", plan_, "-o", out_}).exit_code, 0);
  EXPECT_EQ(calls(), by_hand);
}

TEST_F(SubmitCommand, SaysWhatIsWrongWithSbatch) {
  sbatch("");
  const Answer none = run({"archive", "submit", plan_, "-o", out_});
  EXPECT_EQ(none.exit_code, 69);
  EXPECT_THAT(none.people, HasSubstr("there is no sbatch on this machine"));
  sbatch("exit 3\n");
  const Answer failed = run({"archive", "submit", plan_, "-o", out_});
  EXPECT_EQ(failed.exit_code, 74);
  EXPECT_THAT(failed.people, HasSubstr("it ended with 3"));
  sbatch("echo hello\n");
  EXPECT_EQ(run({"archive", "submit", plan_, "-o", out_}).exit_code, 74) << "no job number";
  sbatch("case \"$*\" in *dependency*) exit 1;; esac; echo '12;cluster'\n");
  const Answer half = run({"archive", "submit", plan_, "-o", out_});
  EXPECT_EQ(half.exit_code, 74);
  EXPECT_THAT(half.people, HasSubstr("the array was submitted as job 12, the merge was not"));
  EXPECT_THAT(half.people, HasSubstr("sbatch --parsable --dependency=afterany:12"));
}

TEST_F(SubmitCommand, ThePlanAndItsFolderAreCheckedFirst) {
  sbatch(writes_down());
  EXPECT_EQ(run({"archive", "submit", archive_, "-o", out_}).exit_code, 66) << "no plan";
  run({"archive", "run", plan_, "--shard", "0", "-o", out_});
  const Answer other = run({"archive", "submit", plan_, "-o", folder_ / "other"});
  EXPECT_EQ(other.exit_code, 64);
  EXPECT_THAT(other.people, HasSubstr("are repaired into"));
  EXPECT_EQ(calls(), "");
}

TEST_F(SubmitCommand, StatusSaysBytesAndFailures) {
  const auto before = run({"archive", "status", plan_, "--json"}).json()["summary"];
  EXPECT_EQ(before["bytes_done"], 0);
  EXPECT_GT(before["bytes"], 10'000);
  run({"archive", "run", plan_, "--shard", "0", "-o", out_});
  const auto after = run({"archive", "status", plan_, "--json"}).json();
  EXPECT_EQ(after["summary"]["bytes_done"], before["bytes"]);
  EXPECT_EQ(after["shards"][0]["bytes_done"], after["shards"][0]["bytes"]);
  EXPECT_THAT(run({"archive", "status", plan_}).people, HasSubstr(" done, 1 failed"))
      << "sub/broken.gt3x";
}

}  // namespace
}  // namespace sixpoint::cli
