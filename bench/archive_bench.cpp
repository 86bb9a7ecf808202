// What an archive in shards costs beyond `repair --jobs 1` of the same files.
//
//   archive_bench [FILES [SAMPLES]]        default: 60 files of 100000 samples
//
// The whole program in process, on the real disk, one shard after the other. Printed: seconds, and
// the ratio to the baseline, which is `repair --jobs 1`; then the same for runs that find
// everything done. Files of both sides are in the page cache.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "base/random.h"
#include "repair/made_recording.h"
#include "run_command.h"
#include "temporary_folder.h"

namespace sixpoint {
namespace {

constexpr const char* kConstants = R"({"serial": "MOS2A45130450", "filter": "current",
  "constants": {"sensitivity_g_per_lsb": [0.0042, 0.004, 0.0041], "zero_lsb": [90.5, 50.25, 88]}})";

double seconds(const std::vector<std::vector<std::string>>& commands) {
  const auto start = std::chrono::steady_clock::now();
  for (const auto& arguments : commands) {
    const tests::Answer answer = tests::run_command(posix_env(), arguments);
    if (answer.exit_code != 0) {
      std::fprintf(stderr, "%s ended with %d: %s\n", arguments[0].c_str(), answer.exit_code,
                   answer.people.c_str());
      std::exit(1);
    }
  }
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void run(std::size_t count, std::size_t samples) {
  const tests::TemporaryFolder folder;
  const std::string archive = folder / "archive";
  std::filesystem::create_directories(archive);
  std::ofstream(folder / "c.json") << kConstants;
  Random random(1);
  for (std::size_t i = 0; i < count; ++i) {
    tests::MadeRecording made;
    for (std::size_t k = 0; k < samples; ++k) {
      made.raw.push_back({static_cast<int>(random.below(700)) - 300,
                          static_cast<int>(random.below(700)) - 300,
                          static_cast<int>(random.below(700)) - 300});
    }
    if (!made.write(posix_env().files, archive + "/" + std::to_string(i) + ".gt3x")) {
      std::exit(1);
    }
  }
  const std::string constants = folder / "c.json";
  // The first pass of either kind warms the cache.
  seconds({{"repair", archive, "-o", folder / "warm", "--constants", constants, "--jobs", "1"}});
  const double whole = seconds(
      {{"repair", archive, "-o", folder / "whole", "--constants", constants, "--jobs", "1"}});
  std::printf("%zu files of %zu samples\nrepair --jobs 1            %7.3f s  ratio 1 (baseline)\n",
              count, samples, whole);
  for (const std::size_t shards : {std::size_t{1}, std::size_t{8}, count}) {
    const std::string plan = folder / ("plan" + std::to_string(shards));
    const std::string out = folder / ("out" + std::to_string(shards));
    std::vector<std::vector<std::string>> commands = {{"archive", "plan", archive, "-o", plan,
                                                       "--constants", constants, "--shards",
                                                       std::to_string(shards)}};
    for (std::size_t k = 0; k < shards && k < count; ++k) {
      commands.push_back({"archive", "run", plan, "--shard", std::to_string(k), "-o", out});
    }
    commands.push_back({"archive", "merge", plan});
    const double first = seconds(commands);
    commands.erase(commands.begin());
    const double again = seconds(commands);
    std::printf("plan, %4zu shards, merge   %7.3f s  ratio %.3f;  again %7.3f s  ratio %.3f\n",
                shards, first, first / whole, again, again / whole);
  }
}

}  // namespace
}  // namespace sixpoint

int main(int argc, char** argv) {
  sixpoint::run(argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 60,
                argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 100'000);
  return 0;
}
