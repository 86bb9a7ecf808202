// An archive of a few files, its plan and its folders, on the real disk.
#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/random.h"
#include "cli/command_fixture.h"
#include "expect_result.h"
#include "repair/jig_constants.h"
#include "repair/made_recording.h"

namespace sixpoint::tests {

using Json = nlohmann::ordered_json;

inline MadeRecording some_minutes(std::uint64_t seed, std::size_t samples) {
  MadeRecording made;
  Random random(seed);
  for (std::size_t i = 0; i < samples; ++i) {
    PerAxis<int> raw{};
    for (int& value : raw) {
      value = static_cast<int>(random.below(700)) - 300;
    }
    made.raw.push_back(raw);
  }
  return made;
}

class ArchiveCommand : public CommandTest {
 protected:
  ArchiveCommand() {
    std::filesystem::create_directories(archive_ + "/sub");
    std::ofstream(constants_) << kConstants;
  }
  void fill() {
    const std::string odd[] = {"plain", "line\nend", "\xff\xfe", "it's 100%", "$(touch X)"};
    std::uint64_t seed = 0;
    for (const std::string& name : odd) {
      EXPECT_OK(some_minutes(++seed, 3000).write(files_, archive_ + "/" + name + ".gt3x"));
    }
    MadeRecording sound = some_minutes(6, 900);
    sound.firmware = "1.8.0";
    EXPECT_OK(sound.write(files_, archive_ + "/sub/sound.gt3x"));
    MadeRecording stranger = some_minutes(7, 900);
    stranger.serial = "MOS2A45130451";
    EXPECT_OK(stranger.write(files_, archive_ + "/sub/stranger.gt3x"));
    std::ofstream(archive_ + "/sub/broken.gt3x") << "this is no zip";
  }
  Answer plan(std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {"archive", "plan",        archive_,   "-o",
                                          plan_,     "--constants", constants_, "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  Answer run_shard(std::size_t shard, std::size_t jobs = 1) {
    return run({"archive", "run", plan_, "--shard", std::to_string(shard), "-o", out_, "--jobs",
                std::to_string(jobs), "--json"});
  }
  Answer merge(std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {"archive", "merge", plan_, "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  // {input: [status, reasons, still errors, ...]} without what differs between two runs.
  static std::map<std::string, Json> comparable(const Json& json) {
    std::map<std::string, Json> files;
    for (Json file : json["files"]) {
      file.erase("output");
      file.erase("output_sha256");  // the mark holds the time of the repair
      std::erase(file["reasons"].get_ref<Json::array_t&>(), Json("repaired by an earlier run"));
      files[file["input"]] = file;
    }
    return files;
  }
  static std::size_t shard_of(const Json& plan, const std::string& name) {
    for (const Json& file : plan["files"]) {
      if (file["input"].get<std::string>().ends_with(name)) {
        return file["shard"];
      }
    }
    ADD_FAILURE() << name << " is in no shard";
    return 0;
  }
  static std::vector<std::string> tree_of(const std::string& folder) {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
      // A repair leaves its manifest too.
      if (entry.is_regular_file() && entry.path().extension() == ".gt3x") {
        names.push_back(entry.path().string().substr(folder.size()));
      }
    }
    std::sort(names.begin(), names.end());
    return names;
  }
  void expect_same_outputs(const std::string& expected, const std::string& got) {
    const auto names = tree_of(expected);
    ASSERT_EQ(tree_of(got), names);
    ASSERT_FALSE(names.empty());
    for (const std::string& name : names) {
      for (const char* entry : {"log.bin", "info.txt", "extra.bin"}) {
        EXPECT_EQ(entry_of(files_, got + name, entry), entry_of(files_, expected + name, entry))
            << name << " " << entry;
      }
    }
  }

  std::string archive_ = folder_ / "archive";
  std::string plan_ = folder_ / "plan";
  std::string out_ = folder_ / "out";
  std::string constants_ = folder_ / "constants.json";
  FileSystem& files_ = posix_env().files;
};

}  // namespace sixpoint::tests
