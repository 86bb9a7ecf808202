// How fast recordings are read, written and repaired.
//
//     gt3x_bench                       a made day at 100 Hz, in memory, without repair
//     gt3x_bench FILE CONSTANTS.json   a recording, and repair by these constants
//
// Every line has its ratios, of seconds and of seconds of processor (of all threads), against what
// libraries and the disk alone need for the same bytes in the same run, on one thread: libdeflate
// inflates log.bin; for a stored repair also the bytes are written, synced and renamed; for a
// deflated one libdeflate packs them at the level and in the pieces that are written.
#include <chrono>
#include <cstdio>
#include <cstring>

#include <libdeflate.h>
#include <sys/resource.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "base/random.h"
#include "calib/constants.h"
#include "gt3x/container/piece_packer.h"
#include "gt3x/recording.h"
#include "gt3x/recording_writer.h"
#include "gt3x/rows/raw_csv.h"
#include "gt3x/sample_reader.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/repair_file.h"
#include "repair/triage/survey.h"

namespace {

using namespace sixpoint;
using Clock = std::chrono::steady_clock;

constexpr int kPackLevel = 6;

Bytes made_log() {
  constexpr std::uint32_t kSeconds = 86'400;
  constexpr std::size_t kRate = 100;
  Random random(1);
  Bytes log;
  std::vector<gt3x::Counts> samples(kRate);
  for (std::uint32_t second = 0; second < kSeconds; ++second) {
    for (auto& sample : samples) {
      for (auto& value : sample) {
        value = static_cast<std::int16_t>(static_cast<int>(random.below(12)) - 6);
      }
    }
    Bytes payload;
    gt3x::append_activity(payload, samples);
    gt3x::append_record(log, gt3x::RecordType::activity, 1'428'588'240 + second, payload);
  }
  return log;
}

struct Taken {
  double seconds = 1e9;
  double processor_s = 1e9;
};

double processor_s() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(used.ru_utime) + seconds(used.ru_stime);
}

// The best of three, of each.
template <class Work>
Taken taken_by(Work work) {
  Taken best;
  for (int round = 0; round < 3; ++round) {
    const auto start = Clock::now();
    const double before = processor_s();
    work();
    best.seconds =
        std::min(best.seconds, std::chrono::duration<double>(Clock::now() - start).count());
    best.processor_s = std::min(best.processor_s, processor_s() - before);
  }
  return best;
}

Bytes log_of(FileSystem& files, const std::string& path) {
  auto recording = gt3x::Recording::open(files, path);
  auto source = recording ? recording->open_entry("log.bin")
                          : Result<std::unique_ptr<gt3x::ByteSource>>(fail(recording.error()));
  return source ? gt3x::read_all(**source, 16ULL << 30).value_or(Bytes{}) : Bytes{};
}

class Table {
 public:
  void baseline(const Taken& copy, const Taken& inflate, const Taken& write, const Taken& deflate) {
    inflate_ = inflate;
    write_ = sum(inflate, write);
    deflate_ = sum(inflate, deflate);
    std::printf("%-34s %8s %10s %8s %10s\n", "", "seconds", "processor", "ratio", "of proc.");
    print("memcpy", copy, copy);
    print("libdeflate inflates", inflate, inflate);
    print("libdeflate inflates, write", write_, write_);
    print("libdeflate inflates, packs", deflate_, deflate_);
  }
  void reads(const char* name, const Taken& taken) const { print(name, taken, inflate_); }
  void stores(const char* name, const Taken& taken) const { print(name, taken, write_); }
  void packs(const char* name, const Taken& taken) const { print(name, taken, deflate_); }

 private:
  static Taken sum(const Taken& one, const Taken& other) {
    return {one.seconds + other.seconds, one.processor_s + other.processor_s};
  }
  static void print(const char* name, const Taken& taken, const Taken& against) {
    std::printf("%-34s %8.3f %10.3f %8.2f %10.2f\n", name, taken.seconds, taken.processor_s,
                taken.seconds / against.seconds, taken.processor_s / against.processor_s);
  }
  Taken inflate_;
  Taken write_;
  Taken deflate_;
};

// The bytes as a file, in pieces as an archive is written, whole and synced.
void write_whole(FileSystem& files, const std::string& path, const Bytes& bytes) {
  static_cast<void>(files.remove(path));
  auto out = AtomicFile::create(files, path);
  for (std::size_t at = 0; out && at < bytes.size(); at += gt3x::kPackedPieceSize) {
    static_cast<void>(out->append(
        std::span(bytes).subspan(at, std::min(gt3x::kPackedPieceSize, bytes.size() - at))));
  }
  if (!out || !out->commit()) {
    std::puts("the bytes could not be written");
  }
}

void measure_repair(Env& env, const std::string& path, const calib::ConstantsRecord& constants,
                    const Table& table) {
  repair::ConstantsFinderOptions how;
  how.given = constants;
  repair::ConstantsFinder finder(env, how);
  const std::string output = path + ".bench.gt3x";
  for (const unsigned jobs : {0U, 1U, 2U}) {
    repair::RepairOptions options;
    options.store_only = jobs == 0;
    options.jobs = std::max(1U, jobs);
    repair::RepairReport report;
    const Taken taken = taken_by([&] {
      static_cast<void>(env.files.remove(output));
      report = repair::repair_file(env, path, output, finder, options);
    });
    if (report.status != repair::RepairStatus::repaired) {
      std::puts(report.brief().c_str());
    } else if (jobs == 0) {
      table.stores("repair, stored, --jobs 1", taken);
    } else {
      table.packs(jobs == 1 ? "repair, deflated, --jobs 1" : "repair, deflated, --jobs 2", taken);
    }
  }
  static_cast<void>(env.files.remove(output));
}

}  // namespace

int main(int count, char** arguments) {
  MemoryEnv memory;
  Env& env = count > 1 ? posix_env() : memory.env;
  const std::string path = count > 1 ? arguments[1] : "f";
  if (count == 1) {
    auto out = gt3x::RecordingWriter::create(memory.files, path);
    if (!out || !out->add("log.bin", made_log()) ||
        !out->add("info.txt", std::string_view("Serial Number: MOS2A1\r\nSample Rate: 100\r\n")) ||
        !out->commit()) {
      std::puts("the recording could not be made");
      return 1;
    }
  }
  Table table;
  {
    const Bytes log = log_of(env.files, path);
    if (log.empty()) {
      std::puts("there is no log.bin to read");
      return 1;
    }
    libdeflate_compressor* packer = libdeflate_alloc_compressor(kPackLevel);
    libdeflate_decompressor* unpacker = libdeflate_alloc_decompressor();
    Bytes whole(libdeflate_deflate_compress_bound(packer, log.size()));
    whole.resize(
        libdeflate_deflate_compress(packer, log.data(), log.size(), whole.data(), whole.size()));
    Bytes out(log.size());
    const Taken copy = taken_by([&] { std::memcpy(out.data(), log.data(), log.size()); });
    const Taken inflate = taken_by([&] {
      libdeflate_deflate_decompress(unpacker, whole.data(), whole.size(), out.data(), out.size(),
                                    nullptr);
    });
    const Taken deflate = taken_by([&] {
      for (std::size_t at = 0; at < log.size(); at += gt3x::kPackedPieceSize) {
        libdeflate_deflate_compress(packer, log.data() + at,
                                    std::min(gt3x::kPackedPieceSize, log.size() - at), out.data(),
                                    out.size());
      }
    });
    const std::string written = path + ".bench.log";
    const Taken write = taken_by([&] { write_whole(env.files, written, log); });
    static_cast<void>(env.files.remove(written));
    libdeflate_free_compressor(packer);
    libdeflate_free_decompressor(unpacker);
    std::printf("log.bin: %.1f MB, packed %.1f MB\n", 1e-6 * static_cast<double>(log.size()),
                1e-6 * static_cast<double>(whole.size()));
    table.baseline(copy, inflate, write, deflate);
  }
  auto recording = gt3x::Recording::open(env.files, path);
  if (!recording) {
    std::puts(recording.error().brief().c_str());
    return 1;
  }
  table.reads("bytes", taken_by([&] {
                auto source = recording->open_entry("log.bin");
                Bytes piece(1 << 16);
                while (source && (*source)->read(piece).value_or(0) > 0) {
                }
              }));
  table.reads("records", taken_by([&] {
                auto log = recording->open_log();
                for (auto item = log->next(); item && *item; item = log->next()) {
                }
              }));
  table.reads("samples", taken_by([&] {
                gt3x::SampleReader samples(*recording);
                for (auto item = samples.next(); item && *item; item = samples.next()) {
                }
              }));
  table.reads("survey (scan)",
              taken_by([&] { static_cast<void>(repair::survey(env.files, path)); }));
  for (const auto time : {gt3x::RawCsvOptions::Time::none, gt3x::RawCsvOptions::Time::iso}) {
    gt3x::RawCsvOptions how;
    how.time = time;
    const bool timed = time != gt3x::RawCsvOptions::Time::none;
    table.reads(timed ? "CSV with times" : "CSV", taken_by([&] {
                  static_cast<void>(gt3x::write_raw_csv(
                      *recording, how, [](std::string_view) -> Status { return {}; }));
                }));
  }
  if (count > 2) {
    const auto text = read_file(env.files, arguments[2]);
    const auto constants = text ? calib::parse_constants_record(as_text(*text))
                                : Result<calib::ConstantsRecord>(fail(text.error()));
    if (!constants) {
      std::puts(constants.error().brief().c_str());
      return 1;
    }
    measure_repair(env, path, *constants, table);
  }
  return 0;
}
