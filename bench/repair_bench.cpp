// Does repair ever make a file worse, or refuse a good repair?
//
//   repair_bench [ARCHIVES [SEED...]]        default: 300 archives with the seeds 1, 2, 1000, 2000
//
// Made units, true motion, and the constants that people might apply by mistake
// (tests/repair/trial_files.h). Printed for each kind: files, written, refused, worse by more than
// 1 mg RMS against the true motion. Ends with 1 when a file is worse or a good repair was refused.
// Then the same for files with one to three still periods, which cannot show every wrong constant:
// for comparison, and without a limit.
#include <cstdio>
#include <cstdlib>

#include "repair/trial_run.h"

namespace {

void print(const char* about, std::uint64_t seed, const sixpoint::tests::TrialResult& result) {
  std::printf("seed %llu, %s\n", static_cast<unsigned long long>(seed), about);
  for (const auto& [kind, of] : result.kinds) {
    std::printf(
        "%-34s %5d files %5d written %5d refused %4d worse, most %+.1f mg, %.1f mg left\n%s",
        kind.c_str(), of.files, of.written, of.refused, of.worse, of.worst_mg, of.most_left_mg,
        of.examples.c_str());
  }
}

}  // namespace

int main(int count, char** arguments) {
  const std::uint64_t archives = count > 1 ? std::strtoull(arguments[1], nullptr, 10) : 300;
  std::vector<std::uint64_t> seeds = {1, 2, 1000, 2000};
  if (count > 2) {
    seeds.clear();
    for (int i = 2; i < count; ++i) {
      seeds.push_back(std::strtoull(arguments[i], nullptr, 10));
    }
  }
  bool passed = true;
  for (const std::uint64_t seed : seeds) {
    const auto result = sixpoint::tests::run_trials(seed, archives);
    print("four still periods and more", seed, result);
    print("one to three still periods", seed, sixpoint::tests::run_trials(seed, archives, true));
    passed = passed && result.worse() == 0 && result.of("good").refused == 0;
  }
  return passed ? 0 : 1;
}
