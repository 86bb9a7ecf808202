// A disk that is full from the n-th write on, for every n until the work is done before that: the
// program as a process, with full_disk_preload.cpp in it. Under the sanitizers, where each start of
// it takes a second, for every fifth n.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>

#include <sys/wait.h>

#include "base/random.h"
#include "base/sha256.h"
#include "cli/command_fixture.h"
#include "cli/store_option.h"
#include "repair/jig_constants.h"
#include "repair/made_recording.h"
#include "sanitized.h"

namespace sixpoint::cli {
namespace {

constexpr int kMostWrites = 3000;
constexpr int kStep = tests::kSanitized ? 5 : 1;

class FullDisk : public tests::StoreTest {
 protected:
  FullDisk() {
    std::filesystem::create_directory(disk());
    ::setenv("XDG_DATA_HOME", path("data").c_str(), 1);
  }
  ~FullDisk() override { ::unsetenv("XDG_DATA_HOME"); }

  std::string disk() const { return path("disk"); }
  bool disk_was_full() const { return std::filesystem::exists(path("said")); }

  // The exit code of the program on a disk that is full from write `from` on.
  int run_full(int from, const std::string& arguments) const {
    std::filesystem::remove(path("said"));
    const std::string line = "LD_PRELOAD=" SIXPOINT_FULL_DISK_PRELOAD
                             " ASAN_OPTIONS=verify_asan_link_order=0 SIXPOINT_FULL_UNDER=" +
                             disk() + " SIXPOINT_FULL_SAID=" + path("said") +
                             " SIXPOINT_FULL_FROM=" + std::to_string(from) +
                             " " SIXPOINT_PROGRAM " " + arguments + " >" + path("out") + " 2>" +
                             path("people");
    const int status = std::system(line.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string people() const { return text_of("people"); }
  std::string text_of(const std::string& name) const {
    std::ifstream in(path(name));
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void empty_disk() const {
    std::filesystem::remove_all(disk());
    std::filesystem::create_directory(disk());
  }
  std::size_t files_on_disk() const {
    const auto all = std::filesystem::directory_iterator(disk());
    return static_cast<std::size_t>(std::distance(begin(all), end(all)));
  }
  // After a full disk got space again: the store opens, its chain holds. Its rows.
  std::int64_t verified_rows(const std::string& store) {
    const auto audit = run({"audit", "verify", "--store", store, "--json"});
    EXPECT_EQ(audit.exit_code, 0) << audit.people << audit.out;
    return audit.json().value("rows", std::int64_t{-1});
  }
};

const char* const kSign = "station-lock sign --operator Ada --reason checked --station A --store ";

TEST_F(FullDisk, AStoreKeepsWhatItAcknowledged) {
  fill("base.db");
  const std::int64_t before = verified_rows(path("base.db"));
  const std::string store = disk() + "/s.db";
  int refused = 0;
  for (int from = 1; from < kMostWrites; from += kStep) {
    SCOPED_TRACE(from);
    empty_disk();
    std::filesystem::copy_file(path("base.db"), store);
    const int exit_code = run_full(from, kSign + store);
    const bool was_full = disk_was_full();
    const std::int64_t rows = verified_rows(store);
    if (exit_code == 0) {
      EXPECT_EQ(rows, before + 1) << "acknowledged, so it is there";
    } else {
      ++refused;
      EXPECT_EQ(exit_code, 74) << people();
      EXPECT_TRUE(rows == before || rows == before + 1) << rows;
    }
    if (!was_full) {
      EXPECT_EQ(exit_code, 0) << people();
      EXPECT_GE(refused, 3) << "a commit writes the log more than once";
      return;
    }
  }
  FAIL() << "the work never ended before the disk was full";
}

TEST_F(FullDisk, AStoreThatCouldNotBeMadeIsMadeAtTheNextTry) {
  const std::string store = disk() + "/new.db";
  for (int from = 1; from < kMostWrites; from += kStep) {
    SCOPED_TRACE(from);
    empty_disk();
    const int exit_code = run_full(from, kSign + store);
    if (!disk_was_full()) {
      EXPECT_EQ(exit_code, 0) << people();
      EXPECT_GE(from, 5);
      return;
    }
    EXPECT_TRUE(exit_code == 0 || exit_code == 74) << exit_code << people();
    const std::string space_again = std::string(SIXPOINT_PROGRAM) + " " + kSign + store + " >" +
                                    path("out") + " 2>" + path("people");
    ASSERT_EQ(std::system(space_again.c_str()), 0) << people();
    EXPECT_EQ(verified_rows(store), exit_code == 0 ? 2 : 1);
  }
  FAIL() << "the work never ended before the disk was full";
}

TEST_F(FullDisk, AnOutputIsWholeOrIsNotThere) {
  fill("s.db");
  std::ofstream(path("s.json"))
      << R"({"seed": 3, "motions": [{"kind": "free_living", "duration_s": 30}]})";
  ASSERT_EQ(run({"simulate", "--scenario", path("s.json"), "-o", path("rec.gt3x")}).exit_code, 0);
  const std::string target = disk() + "/out";
  for (const std::string& work : {"export " + path("rec.gt3x") + " --csv " + target,
                                  "simulate --scenario " + path("s.json") + " -o " + target,
                                  "store export --store " + path("s.db") + " -o " + target,
                                  "store backup --store " + path("s.db") + " -o " + target,
                                  "statistics --store " + path("s.db") + " --html " + target}) {
    SCOPED_TRACE(work);
    bool done = false;
    for (int from = 1; from < kMostWrites && !done; from += kStep) {
      SCOPED_TRACE(from);
      empty_disk();
      const int exit_code = run_full(from, work);
      done = !disk_was_full();
      EXPECT_EQ(exit_code, done ? 0 : 74) << people();
      EXPECT_EQ(files_on_disk(), done ? 1U : 0U) << "neither a part nor a temporary file";
    }
    EXPECT_TRUE(done);
  }
}

// The run is journalled whatever the store's disk does.
TEST_F(FullDisk, LosesNoJigRun) {
  const std::string store = disk() + "/a.db";
  for (const int from : {1, 2, 5, 20, 60}) {
    SCOPED_TRACE(from);
    empty_disk();
    std::filesystem::remove_all(path("data"));
    const int exit_code = run_full(
        from, std::string("jig --device ") + tests::kUnitInJig + " --json --store " + store);
    std::ifstream out(path("out"));
    const auto json = nlohmann::json::parse(out, nullptr, false);
    ASSERT_TRUE(json.is_object()) << people();
    EXPECT_EQ(json["verdict"], "pass");
    if (!disk_was_full()) {
      EXPECT_EQ(exit_code, 0);
      EXPECT_EQ(json["kept"]["in"], "store");
    } else if (exit_code != 0) {
      EXPECT_EQ(exit_code, 74) << people();
      EXPECT_EQ(json["kept"]["in"], "journal");
      EXPECT_EQ(json["kept"]["folder"], journal_folder(store));
    }
    // With space again everything is in the store.
    ASSERT_EQ(run({"store", "catch-up", "--store", store}).exit_code, 0);
    EXPECT_GT(verified_rows(store), 0);
    EXPECT_EQ(run({"history", "MOS2A45130007", "--store", store, "--json"}).json()["runs"].size(),
              1U);
  }
}

class FullDiskOfAnArchive : public FullDisk {
 protected:
  static constexpr std::size_t kFiles = 4;

  FullDiskOfAnArchive() {
    std::filesystem::create_directory(path("archive"));
    std::ofstream(path("c.json")) << tests::kConstants;
    Random random(1);
    for (std::size_t i = 0; i < kFiles; ++i) {
      tests::MadeRecording made;
      for (int k = 0; k < 1800; ++k) {
        made.raw.push_back({static_cast<int>(random.below(700)) - 300,
                            static_cast<int>(random.below(700)) - 300,
                            static_cast<int>(random.below(700)) - 300});
      }
      EXPECT_TRUE(made.write(posix_env().files, path("archive/") + std::to_string(i) + ".gt3x"));
    }
  }
  // Hashes of the recordings on the disk; nothing may be there that was not put in place.
  std::map<std::string, std::string> recordings() const {
    std::map<std::string, std::string> found;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(disk())) {
      EXPECT_NE(entry.path().extension(), ".tmp") << entry.path();
      if (entry.path().extension() == ".gt3x") {
        found[entry.path()] = file_sha256(posix_env().files, entry.path()).value();
      }
    }
    return found;
  }
  // `work` on a disk that becomes full in its midst, and once more with space; `begin` comes first.
  void fill_up(const std::string& work, const std::function<void()>& begin) {
    int in_its_midst = 0;
    for (int from = 1; from < kMostWrites; from += 2 + kStep) {
      SCOPED_TRACE(from);
      empty_disk();
      begin();
      const int exit_code = run_full(from, work);
      if (!disk_was_full()) {
        EXPECT_EQ(exit_code, 0) << people();
        EXPECT_GE(in_its_midst, 3);
        return;
      }
      EXPECT_EQ(exit_code, 74) << people();
      const std::string said = text_of("out") + people();
      EXPECT_NE(said.find("No space left on device"), std::string::npos) << said;
      const auto before = recordings();
      in_its_midst += !before.empty() && before.size() < kFiles ? 1 : 0;
      for (const auto& [name, digest] : before) {
        EXPECT_EQ(run({"inspect", name}).exit_code, 0) << "every file that is there is whole";
      }
      const std::string again =
          std::string(SIXPOINT_PROGRAM) + " " + work + " >" + path("out") + " 2>" + path("people");
      ASSERT_EQ(std::system(again.c_str()), 0) << people();
      const auto after = recordings();
      EXPECT_EQ(after.size(), kFiles);
      for (const auto& [name, digest] : before) {
        EXPECT_EQ(after.at(name), digest) << "what was done is not done again";
      }
    }
    FAIL() << "the work never ended before the disk was full";
  }
};

TEST_F(FullDiskOfAnArchive, ARepairGoesOnWhenThereIsSpace) {
  fill_up("repair " + path("archive") + " -o " + disk() + "/out --jobs 1 --resume --constants " +
              path("c.json"),
          [] {});
}

TEST_F(FullDiskOfAnArchive, AShardGoesOnWhenThereIsSpace) {
  fill_up("archive run " + path("plan") + " --shard 0 -o " + disk() + "/out", [&] {
    std::filesystem::remove_all(path("plan"));
    ASSERT_EQ(run({"archive", "plan", path("archive"), "-o", path("plan"), "--constants",
                   path("c.json"), "--shards", "1"})
                  .exit_code,
              0);
  });
}

// The plan's own disk: what was repaired is known by its mark.
TEST_F(FullDiskOfAnArchive, AShardWhoseResultCannotBeWrittenGoesOn) {
  fill_up("archive run " + disk() + "/plan --shard 0 -o " + disk() + "/out", [&] {
    ASSERT_EQ(run({"archive", "plan", path("archive"), "-o", disk() + "/plan", "--constants",
                   path("c.json"), "--shards", "1"})
                  .exit_code,
              0);
  });
}

}  // namespace
}  // namespace sixpoint::cli
