// gap challenge --export: bundles that do not tell what is in them, and labels that are sealed.
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include "base/sha256.h"
#include "cli/command_fixture.h"

namespace sixpoint::cli {
namespace {

class GapExport : public tests::CommandTest {
 protected:
  tests::Answer challenge(const std::string& folder, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {
        "gap",        "challenge",  "--export", path(folder), "--trials", "6",      "--seed", "11",
        "--protocol", "production", "--json",   "--outside",  "0.4",      "--none", "0.2"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  static std::string text_of(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  // Every file below a folder, by its name there.
  std::map<std::string, std::string> files_of(const std::string& folder) {
    std::map<std::string, std::string> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path(folder))) {
      if (entry.is_regular_file()) {
        files[std::filesystem::relative(entry.path(), path(folder))] = text_of(entry.path());
      }
    }
    return files;
  }
};

TEST_F(GapExport, TheSameSeedWritesTheSameBytes) {
  const auto first = challenge("a");
  ASSERT_EQ(first.exit_code, 0) << first.people;
  ASSERT_EQ(challenge("b", {"--jobs", "2"}).exit_code, 0);
  const auto files = files_of("a");
  EXPECT_EQ(files, files_of("b"));
  EXPECT_EQ(files.size(), 6 * 4U + 2);
  const auto json = first.json();
  EXPECT_EQ(json["schema"], "sixpoint/gap-challenge-export/1");
  EXPECT_EQ(json["bundles"], 6);
  // The seal: the labels can't be changed afterwards.
  EXPECT_EQ(json["labels_sha256"], text_sha256(files.at("labels.jsonl")));
  const auto list = nlohmann::ordered_json::parse(files.at("challenge.json"));
  EXPECT_EQ(list["labels_sha256"], json["labels_sha256"]);
  EXPECT_EQ(list["bundles"].size(), 6U);
}

// `--realistic` without a number is all of them (gap.md: `gap challenge --realistic --rates
// --export DIR`).
TEST_F(GapExport, RealisticWithoutANumberIsAll) {
  const auto made = [&](const std::vector<std::string>& share, const std::string& folder) {
    std::vector<std::string> arguments = {"gap", "challenge", "--realistic"};
    arguments.insert(arguments.end(), share.begin(), share.end());
    arguments.insert(arguments.end(),
                     {"--rates", "--export", path(folder), "--trials", "2", "--seed", "5",
                      "--protocol", "production", "--none", "0", "--outside", "0", "--pairs", "0"});
    return run(arguments).exit_code;
  };
  ASSERT_EQ(made({}, "a"), 0);
  ASSERT_EQ(made({"1"}, "b"), 0);
  EXPECT_EQ(files_of("a"), files_of("b"));
  EXPECT_EQ(made({"1.5"}, "c"), 64);
}

TEST_F(GapExport, NothingButTheSamplesTellsWhatIsInABundle) {
  ASSERT_EQ(challenge("a", {"--labels", path("labels.jsonl")}).exit_code, 0);
  const auto files = files_of("a");
  EXPECT_FALSE(files.contains("labels.jsonl"));
  EXPECT_EQ(files.at("challenge.json").find("seed"), std::string::npos);
  std::ifstream labels(path("labels.jsonl"));
  std::string line;
  std::getline(labels, line);
  std::set<std::string> words = {"seed"};
  std::vector<std::string> order;
  while (std::getline(labels, line)) {
    const auto label = nlohmann::json::parse(line);
    order.push_back(label["bundle"]);
    for (const auto& effect : label["effects"]) {
      words.insert(effect["name"].get<std::string>());
    }
  }
  EXPECT_TRUE(std::ranges::is_sorted(order));
  for (const auto& [name, text] : files) {
    for (const std::string& word : words) {
      EXPECT_EQ(text.find(word), std::string::npos) << name << " says " << word;
    }
  }
  // All files of all bundles have one time.
  std::set<std::filesystem::file_time_type> times;
  for (const std::string& bundle : order) {
    times.insert(std::filesystem::last_write_time(path("a/" + bundle)));
    for (const auto& file : std::filesystem::directory_iterator(path("a/" + bundle))) {
      times.insert(file.last_write_time());
    }
  }
  EXPECT_EQ(times.size(), 1U);
  // What others must not read is its owner's alone.
  EXPECT_EQ(std::filesystem::status(path("labels.jsonl")).permissions(),
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
}

// A bundle with an effect and the one without differ in their samples and in nothing of the header.
TEST_F(GapExport, ADiagnosisReadsTheBundles) {
  ASSERT_EQ(challenge("a").exit_code, 0);
  const auto list = nlohmann::json::parse(text_of(path("a/challenge.json")));
  const auto answer =
      run({"gap", "diagnose", path("a/" + list["bundles"][0].get<std::string>()), "--json"});
  EXPECT_LE(answer.exit_code, 2) << answer.people;
  EXPECT_TRUE(answer.json().contains("effects"));
}

TEST_F(GapExport, RefusalsAndDryRun) {
  const auto dry = challenge("a", {"--dry-run"});
  EXPECT_EQ(dry.exit_code, 0);
  const auto said = dry.json();
  EXPECT_TRUE(said["dry_run"].get<bool>());
  EXPECT_EQ(said["labels_sha256"], nullptr);
  EXPECT_FALSE(std::filesystem::exists(path("a")));
  std::size_t drawn = 0;
  for (const auto& [kind, number] : said["kinds"].items()) {
    drawn += number.get<std::size_t>();
  }
  EXPECT_EQ(drawn, 6U);

  std::filesystem::create_directories(path("full"));
  std::ofstream(path("full/file")) << "kept";
  EXPECT_EQ(challenge("full").exit_code, 73);
  EXPECT_EQ(challenge("full", {"--force"}).exit_code, 73);
  EXPECT_EQ(text_of(path("full/file")), "kept");
  std::ofstream(path("labels.jsonl")) << "kept";
  EXPECT_EQ(challenge("a", {"--labels", path("labels.jsonl")}).exit_code, 73);
  EXPECT_FALSE(std::filesystem::exists(path("a")));
  EXPECT_EQ(challenge("a", {"--strip"}).exit_code, 64);
  EXPECT_EQ(challenge("a", {"--keep", path("k")}).exit_code, 64);
  EXPECT_EQ(run({"gap", "challenge", "--dry-run", "--trials", "1"}).exit_code, 64);
  EXPECT_EQ(run({"gap", "challenge", "--labels", path("l"), "--trials", "1"}).exit_code, 64);
}

}  // namespace
}  // namespace sixpoint::cli
