// How long does a diagnosis take, and how much memory? Baseline: reading the bundle, which every
// diagnosis has to do first.
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>

#include <sys/resource.h>

#include "base/memory_env.h"
#include "gap/judge/diagnose.h"
#include "gap/recording/bundle.h"
#include "gap/report/report_html.h"
#include "gap/report/report_sheet.h"
#include "sim/bundle_writer.h"
#include "sim/scenario.h"

namespace {

double seconds_of(const std::function<void()>& work) {
  double best = 1e9;
  for (int i = 0; i < 3; ++i) {
    const auto start = std::chrono::steady_clock::now();
    work();
    best = std::min(
        best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return best;
}

double peak_mib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

}  // namespace

int main() {
  using namespace sixpoint;
  const char* const effects[] = {
      "",
      R"({"name": "seating", "parameters": {"sd_deg": 0.1}})",
      R"({"name": "tilt"}, {"name": "offset_tempco"}, {"name": "settling"})",
      R"({"name": "truncation"})",
      R"({"name": "random_walk"})",
      R"({"name": "flicker"}, {"name": "truncation"})"};
  std::printf("%-14s %-52s %8s %8s %7s %9s\n", "protocol", "effects", "read s", "total s", "ratio",
              "peak MiB");
  for (const char* protocol : {"production", "engineering"}) {
    for (const char* list : effects) {
      MemoryEnv memory;
      const auto scenario = sim::parse_scenario(
          std::string(R"({"schema": "sixpoint/scenario/1", "seed": 5, "protocol": ")") + protocol +
          R"(", "effects": [)" + list + "]}");
      if (!scenario || !sim::write_bundle(memory.files, "b", *scenario)) {
        std::fprintf(stderr, "the bundle could not be made\n");
        return 1;
      }
      const double reading = seconds_of([&] { (void)gap::read_bundle(memory.files, "b"); });
      const double total = seconds_of([&] {
        const auto bundle = gap::read_bundle(memory.files, "b");
        (void)gap::diagnose(*bundle);
      });
      std::printf("%-14s %-52.52s %8.3f %8.3f %7.1f %9.0f\n", protocol, list, reading, total,
                  total / reading, peak_mib());
    }
  }
  return 0;
}
