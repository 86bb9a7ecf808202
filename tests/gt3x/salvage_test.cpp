// What is read of damaged files, and how it is said: recording.h, salvaged_info.h,
// salvage_losses.h.
#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/made_archive.h"
#include "gt3x/salvage_losses.h"
#include "gt3x/sample_reader.h"
#include "gt3x_made_log.h"
#include "shared_data.h"

namespace sixpoint::gt3x {
namespace {

using testing::Contains;
using testing::Field;
using testing::HasSubstr;
using tests::kStart;
using tests::made_info;
using tests::made_log;
using tests::MadeArchive;
using tests::samples_of;

constexpr std::uint32_t kSeconds = 3;

Bytes text_bytes(const std::string& text) { return {text.begin(), text.end()}; }

MadeArchive small_file(bool deflated, bool described_behind = false) {
  return MadeArchive({{"info.txt", text_bytes(made_info()), deflated, described_behind},
                      {"log.bin", made_log(kSeconds), deflated, described_behind},
                      {"notes/extra.bin", text_bytes("some text"), deflated, described_behind}});
}

// What a reader makes of a file.
struct Delivered {
  std::string info;
  std::map<std::uint32_t, std::vector<Counts>> seconds;  // by their time
  std::vector<SalvageLoss> losses;
  std::uint64_t gaps_s = 0;

  bool said(const std::string& entry) const {
    return std::ranges::any_of(losses,
                               [&](const SalvageLoss& loss) { return loss.entry == entry; });
  }
  // Every second is one of the truth.
  bool all_true() const {
    return std::ranges::all_of(seconds, [](const auto& second) {
      return second.first >= kStart && second.first < kStart + kSeconds &&
             second.second == samples_of(second.first - kStart);
    });
  }
};

Result<Delivered> read_recording(FileSystem& files, const std::string& path, bool salvage) {
  SIXPOINT_ASSIGN(auto recording, Recording::open(files, path, {salvage, {}}));
  Delivered out;
  out.info = recording.info().serialise();
  SampleReader samples(recording);
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, samples.next());
    if (!item) {
      break;
    }
    if (item->kind == SampleItem::Kind::recorded) {
      out.seconds[item->unix_time].assign(item->counts.begin(), item->counts.end());
    } else {
      out.gaps_s += item->seconds;
    }
  }
  SIXPOINT_ASSIGN(out.losses, salvage_losses(recording, samples.statistics()));
  return out;
}

Result<Delivered> read_bytes(const Bytes& bytes, bool salvage) {
  MemoryEnv memory;
  SIXPOINT_CHECK(write_file(memory.files, "f", as_text(bytes)));
  return read_recording(memory.files, "f", salvage);
}

Bytes cut(const Bytes& bytes, std::size_t size) {
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size)};
}

TEST(Salvage, AWholeFileIsReadAsEver) {
  for (const bool deflated : {false, true}) {
    for (const bool behind : {false, true}) {
      const auto read = read_bytes(small_file(deflated, behind).bytes, true);
      ASSERT_OK(read);
      EXPECT_TRUE(read->losses.empty());
      EXPECT_EQ(read->seconds.size(), kSeconds);
      EXPECT_TRUE(read->all_true());
      EXPECT_EQ(read->info, made_info());
    }
  }
}

// Oracle: the file before it was cut. Every length of it, without and with the option: without, it
// is refused; with it, what comes out is the beginning of the truth, and the loss is said.
TEST(Salvage, EveryTruncationGivesTheBeginningOfTheTruthAndSaysSo) {
  for (const bool deflated : {false, true}) {
    for (const bool behind : {false, true}) {
      const MadeArchive made = small_file(deflated, behind);
      std::size_t salvaged = 0;
      std::size_t most = 0;
      for (std::size_t size = 0; size < made.bytes.size(); ++size) {
        SCOPED_TRACE(size);
        const Bytes bytes = cut(made.bytes, size);
        const auto refused = read_bytes(bytes, false);
        ASSERT_FALSE(refused);
        ASSERT_EQ(refused.error().code, ErrorCode::bad_data);
        ASSERT_FALSE(refused.error().hint.empty());
        const auto read = read_bytes(bytes, true);
        if (!read) {
          ASSERT_EQ(read.error().code, ErrorCode::bad_data);
          // Once the header of log.bin is there, something is read.
          ASSERT_LE(size, made.data_offsets[1]);
          continue;
        }
        ++salvaged;
        ASSERT_FALSE(read->losses.empty());
        ASSERT_TRUE(read->all_true());
        // Later cuts never give fewer seconds.
        ASSERT_GE(read->seconds.size(), most);
        most = read->seconds.size();
        if (!read->said("log.bin")) {
          ASSERT_EQ(read->seconds.size(), kSeconds);
        }
        if (!read->said("info.txt")) {
          ASSERT_EQ(read->info, made_info());
        }
      }
      EXPECT_EQ(most, kSeconds);
      EXPECT_GT(salvaged, made.bytes.size() / 3);
    }
  }
}

// Oracle: the file before it was damaged. Every byte of it changed, in two ways.
TEST(Salvage, NoFlippedByteGivesAWrongSampleThatIsCalledGood) {
  for (const bool deflated : {false, true}) {
    for (const bool behind : {false, true}) {
      const MadeArchive made = small_file(deflated, behind);
      std::size_t salvaged = 0;
      for (std::size_t at = 0; at < made.bytes.size(); ++at) {
        for (const unsigned flip : {0x01U, 0xFFU}) {
          SCOPED_TRACE(at);
          Bytes bytes = made.bytes;
          bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ flip);
          const auto strict = read_bytes(bytes, false);
          if (strict) {
            ASSERT_TRUE(strict->all_true());
            ASSERT_EQ(strict->seconds.size(), kSeconds);
            ASSERT_EQ(strict->info, made_info());
          } else {
            ASSERT_EQ(strict.error().code, ErrorCode::bad_data);
          }
          const auto read = read_bytes(bytes, true);
          if (!read) {
            ASSERT_EQ(read.error().code, ErrorCode::bad_data);
            continue;
          }
          ++salvaged;
          ASSERT_TRUE(read->said("log.bin") || read->all_true());
          ASSERT_TRUE(read->said("log.bin") || read->seconds.size() == kSeconds);
          ASSERT_TRUE(read->said("info.txt") || read->info == made_info());
          if (!strict && !deflated && at >= made.data_offsets[1] &&
              at < made.data_offsets[1] + made_log(kSeconds).size()) {
            // In stored bytes the damage costs the record that it is in.
            ASSERT_GE(read->seconds.size(), kSeconds - 1);
            ASSERT_TRUE(read->all_true());
          }
        }
      }
      EXPECT_GT(salvaged, made.bytes.size());
    }
  }
}

TEST(Salvage, TheRefusalNamesTheOption) {
  const Bytes bytes = small_file(true).bytes;
  const auto refused = read_bytes(cut(bytes, bytes.size() - 30), false);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().hint, HasSubstr("--salvage"));
}

TEST(Salvage, AWrongCrcIsDeliveredAndSaidWithItsTimes) {
  MadeArchive made = small_file(false);
  made.bytes[made.data_offsets[1] + made_log(kSeconds).size() - 40] ^= 0x10U;  // in the last second
  const auto read = read_bytes(made.bytes, true);
  ASSERT_OK(read);
  ASSERT_EQ(read->seconds.size(), kSeconds - 1);
  EXPECT_TRUE(read->all_true());
  ASSERT_EQ(read->losses.size(), 2U);
  EXPECT_EQ(read->losses[0].kind, SalvageLoss::Kind::doubtful);
  EXPECT_THAT(read->losses[0].why, HasSubstr("CRC"));
  EXPECT_EQ(read->losses[0].from, kStart - 70);
  EXPECT_EQ(read->losses[0].to, kStart + 2);
  EXPECT_EQ(read->losses[1].kind, SalvageLoss::Kind::missing);
  EXPECT_EQ(read->losses[1].from, kStart + 2);
  EXPECT_THAT(read->losses[1].why, HasSubstr("ACTIVITY"));
}

TEST(Salvage, ALostInfoIsMadeOfWhatTheLogSaysAndNothingElse) {
  MemoryEnv memory;
  const MadeArchive made({{"log.bin", made_log(kSeconds)}});
  ASSERT_OK(write_file(memory.files, "MOS2A45130450.gt3x", as_text(made.bytes)));
  const auto refused = Recording::open(memory.files, "MOS2A45130450.gt3x");
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  auto recording = Recording::open(memory.files, "MOS2A45130450.gt3x", {true, {}});
  ASSERT_OK(recording);
  const Info& info = recording->info();
  EXPECT_EQ(info.serial(), "");
  EXPECT_EQ(info.firmware(), "1.5.0");
  EXPECT_EQ(info.sample_rate_hz(), 30);
  EXPECT_EQ(info.accel_scale_lsb_per_g(), 256);
  EXPECT_EQ(info.start(), from_unix_seconds(kStart));
  ASSERT_EQ(recording->damage().size(), 1U);
  EXPECT_THAT(recording->damage()[0].why, HasSubstr("not known: Serial Number"));
}

TEST(Salvage, ALineOfInfoThatWasCutIsNotTaken) {
  // "Sample Rate: 30" cut to "Sample Rate: 3" would be a rate.
  const std::string info = made_info();
  MadeArchive made({{"log.bin", made_log(kSeconds)}, {"info.txt", text_bytes(info)}});
  const std::size_t at = info.find("Sample Rate: 3") + 14;
  const auto read = read_bytes(cut(made.bytes, made.data_offsets[1] + at), true);
  ASSERT_OK(read);
  EXPECT_THAT(read->info, HasSubstr("Sample Rate: 30\r\n"));  // as the log's seconds say
  EXPECT_THAT(read->info, HasSubstr("Serial Number: MOS2A45130450\r\n"));
  EXPECT_TRUE(read->said("info.txt"));
}

TEST(Salvage, TheOldFormIsReadAsFarAsItIsThere) {
  Bytes activity;
  append_activity(activity, samples_of(0));
  append_activity(activity, samples_of(1));
  const std::string info = made_info() + "Last Sample Time: 635641850650000000\r\n";
  const MadeArchive made({{"info.txt", text_bytes(info)}, {"activity.bin", activity}});
  const auto read = read_bytes(cut(made.bytes, made.data_offsets[1] + activity.size() - 9), true);
  ASSERT_OK(read);
  ASSERT_EQ(read->seconds.size(), 2U);
  EXPECT_EQ(read->seconds.begin()->second, samples_of(0));
  EXPECT_EQ(read->seconds.rbegin()->second.size(), 28U);
  EXPECT_TRUE(read->said("activity.bin"));
  EXPECT_EQ(read->gaps_s, 0U) << "what the unit did behind the damage is not known";
}

TEST(Salvage, OtherEntriesAreReadAsFarAsTheyGo) {
  MadeArchive made = small_file(false);
  made.bytes[made.data_offsets[2]] ^= 1U;
  const auto read = read_bytes(made.bytes, true);
  ASSERT_OK(read);
  EXPECT_EQ(read->seconds.size(), kSeconds);
  EXPECT_FALSE(read->said("log.bin"));
  EXPECT_TRUE(read->said("notes/extra.bin"));
}

TEST(Salvage, WhatIsRefusedStaysRefused) {
  struct Refused {
    std::vector<tests::MadeEntry> more;
    const char* why;
  };
  const tests::MadeEntry info{"info.txt", text_bytes(made_info())};
  const std::vector<Refused> kRefused = {
      {{{"log.bin", made_log(1), false, false, 1}}, "encrypted"},
      {{{"log.bin", made_log(1), true, false, 0, 9}}, "deflate64"},
      {{{"log.bin", made_log(1), true, false, 0, 12}}, "bzip2"},
      {{{"log.bin", made_log(1)}, {"log.bin", made_log(2)}}, "two entries named log.bin"},
      {{{"log.bin", made_log(1)}, {"../x", Bytes{1}}}, "path"},
      {{{"log.bin", made_log(1)}, {"/etc/x", Bytes{1}}}, "path"},
      {{{"other.bin", made_log(1)}}, "holds no log.bin"}};
  for (const Refused& refused : kRefused) {
    std::vector<tests::MadeEntry> entries = refused.more;
    entries.insert(entries.begin(), info);
    const MadeArchive made(entries);
    for (const bool salvage : {false, true}) {
      const auto read = read_bytes(made.bytes, salvage);
      ASSERT_FALSE(read) << refused.why;
      EXPECT_EQ(read.error().code, ErrorCode::bad_data);
      EXPECT_THAT(read.error().what, HasSubstr(refused.why));
      EXPECT_FALSE(read.error().hint.empty());
    }
    // Without the list of entries too.
    const auto headers_only = read_bytes(cut(made.bytes, made.list_offset), true);
    ASSERT_FALSE(headers_only) << refused.why;
  }
}

// 199 names for 50 MB would be 10 GB of output. The entries' own headers have it once.
TEST(Salvage, EntriesOfTheSameBytesAreRefused) {
  std::vector<tests::MadeEntry> entries = {{"info.txt", text_bytes(made_info())},
                                           {"log.bin", made_log(kSeconds)}};
  for (const char* name : {"a", "b"}) {
    entries.push_back({name, made_log(kSeconds)});
    entries.back().listed_only = true;
  }
  const MadeArchive made(entries);
  const auto refused = read_bytes(made.bytes, false);
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_THAT(refused.error().what, HasSubstr("overlap"));
  const auto read = read_bytes(made.bytes, true);
  ASSERT_OK(read);
  EXPECT_EQ(read->seconds.size(), kSeconds);
  EXPECT_TRUE(read->said("")) << "the list of entries";
}

TEST(Salvage, ASymbolicLinkIsRefused) {
  MadeArchive made({{"info.txt", text_bytes(made_info())},
                    {"log.bin", text_bytes("/etc/passwd"), false, false, 0, -1, 0120777U << 16U}});
  const auto read = read_bytes(made.bytes, false);
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().what, HasSubstr("log.bin is a symbolic link"));
}

// A stream that grows without end where nothing says how long it is: the limits end it.
TEST(Salvage, ABombWithoutASizeIsStopped) {
  MemoryEnv memory;
  const MadeArchive made({{"log.bin", Bytes(3'000'000, 0), true, true}});
  ASSERT_OK(write_file(memory.files, "f", as_text(cut(made.bytes, made.list_offset - 20))));
  RecordingOptions options{true, {}};
  options.limits.ratio_matters_from_bytes = 100'000;
  const auto recording = Recording::open(memory.files, "f", options);
  ASSERT_FALSE(recording);
  EXPECT_THAT(recording.error().what, HasSubstr("more bytes than a recording can have"));
}

TEST(Salvage, MoreEntriesThanTheLimitAreRefused) {
  std::vector<tests::MadeEntry> many = {{"info.txt", text_bytes(made_info())},
                                        {"log.bin", made_log(1)}};
  for (int i = 0; i < 20; ++i) {
    many.push_back({"e" + std::to_string(i), Bytes{1}});
  }
  MemoryEnv memory;
  ASSERT_OK(write_file(memory.files, "f", as_text(MadeArchive(many).bytes)));
  RecordingOptions options;
  options.limits.entries = 21;
  const auto refused = Recording::open(memory.files, "f", options);
  EXPECT_FAILS(refused, ErrorCode::bad_data);
  EXPECT_THAT(refused.error().what, HasSubstr("more than 21 entries"));
  options.limits.entries = 22;
  EXPECT_OK(Recording::open(memory.files, "f", options));
}

TEST(Salvage, FoldersAreNoEntriesAndTheirFilesAre) {
  MemoryEnv memory;
  const MadeArchive made({{"info.txt", text_bytes(made_info())},
                          {"notes/", {}},
                          {"notes/extra.bin", Bytes{7}},
                          {"log.bin", made_log(1)}});
  ASSERT_OK(write_file(memory.files, "f", as_text(made.bytes)));
  auto recording = Recording::open(memory.files, "f");
  ASSERT_OK(recording);
  ASSERT_EQ(recording->entries().size(), 3U);
  EXPECT_EQ(recording->entries()[1].name, "notes/extra.bin");
  EXPECT_EQ(read_all(**recording->open_entry("notes/extra.bin"), 10).value(), Bytes{7});
}

TEST(Salvage, BytesBehindTheArchiveAreCounted) {
  MemoryEnv memory;
  Bytes bytes = small_file(true).bytes;
  bytes.insert(bytes.end(), 70'000, 0);
  ASSERT_OK(write_file(memory.files, "f", as_text(bytes)));
  const auto recording = Recording::open(memory.files, "f");
  ASSERT_OK(recording);
  EXPECT_EQ(recording->bytes_behind(), 70'000U);
}

// Oracle: the real recording before it was cut.
TEST(Salvage, ARealFileCutInTheMiddle) {
  SIXPOINT_NEED_SHARED("data/wgt3x-bt-affected/MOS2A45130451.gt3x");
  const std::string path =
      sixpoint::tests::shared_file("data/wgt3x-bt-affected/MOS2A45130451.gt3x");
  const auto whole = read_recording(posix_env().files, path, false);
  ASSERT_OK(whole);
  const Bytes bytes = read_file(posix_env().files, path).value();
  const auto half = read_bytes(cut(bytes, bytes.size() / 2), true);
  ASSERT_OK(half);
  EXPECT_GT(half->seconds.size(), whole->seconds.size() / 3);
  for (const auto& [time, samples] : half->seconds) {
    ASSERT_EQ(samples, whole->seconds.at(time));
  }
  EXPECT_TRUE(half->said("log.bin"));
}

}  // namespace
}  // namespace sixpoint::gt3x
