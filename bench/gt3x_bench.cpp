// How fast recordings are read, on a made recording of a day at 100 Hz, in memory.
//
// Baseline of every ratio: pulling the same entry's bytes out of the archive and looking at none of
// them (what libzip alone costs, CRC included).
#include <chrono>
#include <cstdio>

#include "base/memory_env.h"
#include "base/random.h"
#include "gt3x/raw_csv.h"
#include "gt3x/recording.h"
#include "gt3x/recording_writer.h"
#include "gt3x/sample_reader.h"

namespace {

using namespace sixpoint;
using Clock = std::chrono::steady_clock;

constexpr std::uint32_t kSeconds = 86'400;
constexpr std::size_t kRate = 100;

Bytes made_log() {
  Random random(1);
  Bytes log;
  std::vector<gt3x::Counts> samples(kRate);
  for (std::uint32_t second = 0; second < kSeconds; ++second) {
    for (auto& sample : samples) {
      for (auto& value : sample) {
        value = static_cast<std::int16_t>(static_cast<int>(random.below(600)) - 300);
      }
    }
    Bytes payload;
    gt3x::append_activity(payload, samples);
    gt3x::append_record(log, gt3x::RecordType::activity, 1'428'588'240 + second, payload);
  }
  return log;
}

template <class Work>
double seconds_of(Work work) {
  double best = 1e9;
  for (int round = 0; round < 3; ++round) {
    const auto start = Clock::now();
    work();
    best = std::min(best, std::chrono::duration<double>(Clock::now() - start).count());
  }
  return best;
}

}  // namespace

int main() {
  MemoryEnv memory;
  {
    auto out = gt3x::RecordingWriter::create(memory.files, "f");
    if (!out || !out->add("log.bin", made_log()) ||
        !out->add("info.txt", std::string_view("Serial Number: MOS2A1\r\nSample Rate: 100\r\n")) ||
        !out->commit()) {
      std::puts("the recording could not be made");
      return 1;
    }
  }
  auto recording = gt3x::Recording::open(memory.files, "f");
  if (!recording) {
    std::puts(recording.error().brief().c_str());
    return 1;
  }
  const double bytes_s = seconds_of([&] {
    auto source = recording->open_entry("log.bin");
    Bytes piece(1 << 16);
    while (source && (*source)->read(piece).value_or(0) > 0) {
    }
  });
  const double records_s = seconds_of([&] {
    auto log = recording->open_log();
    for (auto item = log->next(); item && *item; item = log->next()) {
    }
  });
  const double samples_s = seconds_of([&] {
    gt3x::SampleReader samples(*recording);
    for (auto item = samples.next(); item && *item; item = samples.next()) {
    }
  });
  const double csv_s = seconds_of([&] {
    static_cast<void>(
        gt3x::write_raw_csv(*recording, {}, [](std::string_view) -> Status { return {}; }));
  });
  const double millions = static_cast<double>(kSeconds) * kRate / 1e6;
  std::printf("%-28s %8s %18s %8s\n", "a day at 100 Hz", "seconds", "million samples/s", "ratio");
  const auto line = [&](const char* name, double seconds) {
    std::printf("%-28s %8.3f %18.1f %8.2f\n", name, seconds, millions / seconds, seconds / bytes_s);
  };
  line("bytes alone (baseline)", bytes_s);
  line("records", records_s);
  line("samples", samples_s);
  line("raw CSV", csv_s);
  return 0;
}
