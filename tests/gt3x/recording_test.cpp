#include "gt3x/recording.h"

#include <algorithm>

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/forwarding_files.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/made_archive.h"
#include "gt3x/recording_writer.h"
#include "gt3x_made_log.h"
#include "shared_data.h"

namespace sixpoint::gt3x {
namespace {

using tests::made_info;
using tests::made_log;

Status put(FileSystem& files, const std::string& path, const Bytes& bytes) {
  return write_file(files, path,
                    std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

Bytes made_archive(Packing packing = Packing::store) {
  MemoryEnv memory;
  auto out = RecordingWriter::create(memory.files, "f", {packing, 1});
  EXPECT_OK(out->add("log.bin", made_log(3)));
  EXPECT_OK(out->add("info.txt", std::string_view(made_info())));
  EXPECT_OK(out->add("calibration.json", std::string_view("{}")));
  EXPECT_OK(out->commit());
  return *read_file(memory.files, "f");
}

Result<Bytes> log_of(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(auto recording, Recording::open(files, path));
  SIXPOINT_ASSIGN(const auto source, recording.open_entry("log.bin"));
  return read_all(*source, 1 << 20);
}

TEST(Recording, ReadsWhatTheWriterWrote) {
  for (const auto packing : {Packing::store, Packing::deflate}) {
    MemoryEnv memory;
    ASSERT_OK(put(memory.files, "f", made_archive(packing)));
    auto recording = Recording::open(memory.files, "f");
    ASSERT_OK(recording);
    EXPECT_EQ(recording->info().serial(), "MOS2A45130450");
    EXPECT_EQ(recording->entries().size(), 3U);
    EXPECT_TRUE(recording->has_log());
    EXPECT_TRUE(recording->has_entry("calibration.json"));
    EXPECT_EQ(log_of(memory.files, "f").value(), made_log(3));
    EXPECT_FAILS(recording->open_entry("none"), ErrorCode::bad_data);
  }
}

TEST(Recording, RefusesWhatIsNoRecording) {
  MemoryEnv memory;
  EXPECT_FAILS(Recording::open(memory.files, "none"), ErrorCode::no_input);
  ASSERT_OK(write_file(memory.files, "empty", ""));
  EXPECT_FAILS(Recording::open(memory.files, "empty"), ErrorCode::bad_data);
  ASSERT_OK(write_file(memory.files, "text", "not a zip at all, and long enough to be looked at"));
  const auto text = Recording::open(memory.files, "text");
  EXPECT_FAILS(text, ErrorCode::bad_data);
  EXPECT_THAT(text.error().what, testing::HasSubstr("not a zip"));
  ASSERT_OK(write_file(memory.files, "day.agd", "SQLite format 3, and its pages"));
  EXPECT_THAT(Recording::open(memory.files, "day.agd").error().hint, testing::HasSubstr(".gt3x"));
}

TEST(Recording, RefusesAnArchiveWithoutLogOrInfo) {
  MemoryEnv memory;
  auto no_log = RecordingWriter::create(memory.files, "no_log");
  ASSERT_OK(no_log->add("info.txt", std::string_view(made_info())));
  ASSERT_OK(no_log->commit());
  const auto opened = Recording::open(memory.files, "no_log");
  EXPECT_FAILS(opened, ErrorCode::bad_data);
  EXPECT_THAT(opened.error().what, testing::HasSubstr("log.bin"));
  auto no_info = RecordingWriter::create(memory.files, "no_info");
  ASSERT_OK(no_info->add("log.bin", made_log(1)));
  ASSERT_OK(no_info->commit());
  EXPECT_FAILS(Recording::open(memory.files, "no_info"), ErrorCode::bad_data);
}

// Names inside the archive are replaced by others of the same length, in both headers: what a
// hostile archive would hold. (The CRC covers contents, not names.)
Bytes renamed(Bytes archive, const std::string& from, const std::string& to) {
  EXPECT_EQ(from.size(), to.size());
  auto at = archive.begin();
  while ((at = std::search(at, archive.end(), from.begin(), from.end())) != archive.end()) {
    std::copy(to.begin(), to.end(), at);
    at += static_cast<std::ptrdiff_t>(to.size());
  }
  return archive;
}

TEST(Recording, RefusesPathsAndDuplicates) {
  for (const char* name : {"../calibratio.js", "a/../ration.json", "..\\calibratio.js",
                           "/alibration.json", "C:libration.json", "calibration.jso/"}) {
    MemoryEnv memory;
    ASSERT_OK(put(memory.files, "f", renamed(made_archive(), "calibration.json", name)));
    const auto opened = Recording::open(memory.files, "f");
    EXPECT_FAILS(opened, ErrorCode::bad_data);
    EXPECT_THAT(opened.error().what, testing::HasSubstr("path")) << name;
  }
  MemoryEnv memory;
  auto out = RecordingWriter::create(memory.files, "f");
  ASSERT_OK(out->add("log.bin", made_log(1)));
  ASSERT_OK(out->add("LOG.BIN", made_log(2)));
  ASSERT_OK(out->add("info.txt", std::string_view(made_info())));
  ASSERT_OK(out->commit());
  ASSERT_OK(put(memory.files, "g", renamed(*read_file(memory.files, "f"), "LOG.BIN", "log.bin")));
  const auto opened = Recording::open(memory.files, "g");
  EXPECT_FAILS(opened, ErrorCode::bad_data);
  EXPECT_THAT(opened.error().what, testing::HasSubstr("two entries"));
}

TEST(Recording, TruncatedAtEveryByteIsAnError) {
  const Bytes archive = made_archive();
  for (std::size_t size = 0; size < archive.size(); ++size) {
    MemoryEnv memory;
    ASSERT_OK(put(memory.files, "f",
                  Bytes(archive.begin(), archive.begin() + static_cast<std::ptrdiff_t>(size))));
    const auto log = log_of(memory.files, "f");
    ASSERT_FALSE(log) << size;
    EXPECT_EQ(log.error().code, ErrorCode::bad_data) << size;
    EXPECT_FALSE(log.error().hint.empty());
  }
}

// Every byte of the archive damaged in turn, stored and deflated: log.bin comes out as it went in,
// or not at all. Never other bytes.
TEST(Recording, ADamagedArchiveNeverDeliversOtherBytes) {
  const Bytes wanted = made_log(3);
  for (const auto packing : {Packing::store, Packing::deflate}) {
    const Bytes archive = made_archive(packing);
    std::size_t refused = 0;
    for (std::size_t at = 0; at < archive.size(); ++at) {
      for (const unsigned flip : {0x01U, 0xFFU}) {
        Bytes damaged = archive;
        damaged[at] = static_cast<std::uint8_t>(damaged[at] ^ flip);
        MemoryEnv memory;
        ASSERT_OK(put(memory.files, "f", damaged));
        const auto log = log_of(memory.files, "f");
        if (log) {
          ASSERT_EQ(*log, wanted) << "byte " << at;
        } else {
          ASSERT_EQ(log.error().code, ErrorCode::bad_data) << log.error().brief();
          ++refused;
        }
      }
    }
    EXPECT_GT(refused, archive.size() / 2);
  }
}

TEST(Recording, RefusesABomb) {
  // Two gigabytes claimed by an entry of a few bytes: the size field of the central directory.
  MemoryEnv memory;
  Bytes archive = made_archive(Packing::deflate);
  const std::string signature = "PK\x01\x02";
  const auto central =
      std::search(archive.begin(), archive.end(), signature.begin(), signature.end());
  ASSERT_NE(central, archive.end());
  constexpr std::ptrdiff_t kUncompressedSize = 24;
  *(central + kUncompressedSize + 3) = 0x7F;
  ASSERT_OK(put(memory.files, "f", archive));
  const auto opened = Recording::open(memory.files, "f");
  EXPECT_FAILS(opened, ErrorCode::bad_data);
  EXPECT_THAT(opened.error().what, testing::HasSubstr("claims"));
}

class FailingFile final : public ReadableFile {
 public:
  explicit FailingFile(std::unique_ptr<ReadableFile> inner, std::uint64_t limit)
      : inner_(std::move(inner)), limit_(limit) {}
  std::uint64_t size() const override { return inner_->size(); }
  Result<std::size_t> read_at(std::uint64_t offset, std::span<std::uint8_t> out) const override {
    if (offset < limit_) {
      return fail(ErrorCode::io, "the disk fails", "f", "check the disk");
    }
    return inner_->read_at(offset, out);
  }

 private:
  std::unique_ptr<ReadableFile> inner_;
  std::uint64_t limit_;
};

class FailingFiles final : public sixpoint::ForwardingFiles {
 public:
  FailingFiles(FileSystem& inner, std::uint64_t limit) : ForwardingFiles(inner), limit_(limit) {}
  Result<std::unique_ptr<ReadableFile>> open(const std::string& path) override {
    SIXPOINT_ASSIGN(auto file, ForwardingFiles::open(path));
    return std::make_unique<FailingFile>(std::move(file), limit_);
  }

 private:
  std::uint64_t limit_;
};

TEST(Recording, ADiskThatFailsIsNoDamage) {
  MemoryEnv memory;
  ASSERT_OK(put(memory.files, "f", made_archive()));
  FailingFiles everywhere(memory.files, UINT64_MAX);
  EXPECT_FAILS(Recording::open(everywhere, "f"), ErrorCode::io);
  FailingFiles at_start(memory.files, 200);  // the list of entries can be read, log.bin cannot
  EXPECT_FAILS(log_of(at_start, "f"), ErrorCode::io);
}

TEST(RecordingWriter, CopiesEntriesUntouched) {
  MemoryEnv memory;
  ASSERT_OK(put(memory.files, "f", made_archive(Packing::deflate)));
  auto from = Recording::open(memory.files, "f");
  ASSERT_OK(from);
  auto out = RecordingWriter::create(memory.files, "g");
  ASSERT_OK(out);
  for (const EntryInfo& entry : from->entries()) {
    ASSERT_OK(out->copy(*from, entry.name));
  }
  ASSERT_OK(out->commit());
  auto copy = Recording::open(memory.files, "g");
  ASSERT_OK(copy);
  ASSERT_EQ(copy->entries().size(), from->entries().size());
  for (std::size_t i = 0; i < copy->entries().size(); ++i) {
    EXPECT_EQ(copy->entries()[i].name, from->entries()[i].name);
    EXPECT_EQ(copy->entries()[i].compressed_size, from->entries()[i].compressed_size);
  }
  EXPECT_EQ(log_of(memory.files, "g").value(), made_log(3));
  EXPECT_FAILS(out->copy(*from, "none"), ErrorCode::bad_data);
}

TEST(RecordingWriter, CopiesANameThatIsNoUtf8) {
  const std::string info = made_info();
  const std::string name = "\x99l.txt";
  const tests::MadeArchive made(
      {{"log.bin", made_log(1)}, {"info.txt", Bytes(info.begin(), info.end())}, {name, Bytes{1}}});
  MemoryEnv memory;
  ASSERT_OK(put(memory.files, "f", made.bytes));
  auto from = Recording::open(memory.files, "f");
  ASSERT_OK(from);
  auto out = RecordingWriter::create(memory.files, "g");
  for (const EntryInfo& entry : from->entries()) {
    ASSERT_OK(out->copy(*from, entry.name));
  }
  ASSERT_OK(out->commit());
  const auto copy = Recording::open(memory.files, "g");
  ASSERT_OK(copy);
  EXPECT_TRUE(copy->has_entry(name));
}

TEST(RecordingWriter, UnknownSizesMakeReadableEntries) {
  class Unsized final : public ByteSource {
   public:
    Result<std::size_t> read(std::span<std::uint8_t> out) override { return inner.read(out); }
    MemorySource inner{made_log(3)};
  };
  MemoryEnv memory;
  auto out = RecordingWriter::create(memory.files, "f");
  Unsized source;
  ASSERT_OK(out->add("log.bin", source));
  ASSERT_OK(out->add("info.txt", std::string_view(made_info())));
  ASSERT_OK(out->commit());
  EXPECT_EQ(log_of(memory.files, "f").value(), made_log(3));
}

// The table of holds_raw_counts(), and what agdc_calibration() says of each row.
TEST(Recording, WhetherAnAgdcHoldsRawCounts) {
  std::string raw = R"({"isCalibrated":false,"calibrationMethod":2)";
  for (const char* key : {"offsetX", "offsetY", "offsetZ", "sensitivityXX", "sensitivityYY",
                          "sensitivityZZ", "sensitivityXY", "sensitivityXZ", "sensitivityYZ"}) {
    raw += std::string(",\"") + key + "_32\":25000";
  }
  raw += '}';
  struct Case {
    const char* calibration;
    const char* scale;
    bool fits;
    bool raw_counts;
  };
  for (const Case& one :
       {Case{R"({"isCalibrated":true})", "256", true, false},
        Case{R"({"isCalibrated":true})", "16", true, false},
        Case{R"({"isCalibrated":true})", "1", false, true}, Case{raw.c_str(), "1", true, true},
        Case{R"({"isCalibrated":false})", "256", false, true}, Case{"no JSON", "256", false, true},
        Case{nullptr, "256", false, true}}) {
    MemoryEnv memory;
    auto out = RecordingWriter::create(memory.files, "a.agdc").value();
    ASSERT_OK(out.add("log.bin", made_log(1)));
    const std::string info =
        std::string("Sample Rate: 32\r\nAcceleration Scale: ") + one.scale + "\r\n";
    ASSERT_OK(out.add("info.txt", std::string_view(info)));
    if (one.calibration != nullptr) {
      ASSERT_OK(out.add("calibration.json", std::string_view(one.calibration)));
    }
    ASSERT_OK(out.commit());
    auto recording = Recording::open(memory.files, "a.agdc").value();
    EXPECT_EQ(holds_raw_counts(recording, 32), one.raw_counts) << one.scale;
    EXPECT_EQ(agdc_calibration(recording, 32).has_value(), one.fits) << one.scale;
  }
}

// Oracle: the real recording itself; a copy made entry by entry holds the same bytes.
TEST(Recording, RealFileCopied) {
  SIXPOINT_NEED_SHARED("data/gt9x/TAS1H52220588.gt3x");
  auto from = Recording::open(posix_env().files,
                              sixpoint::tests::shared_file("data/gt9x/TAS1H52220588.gt3x"));
  ASSERT_OK(from);
  MemoryEnv memory;
  auto out = RecordingWriter::create(memory.files, "g");
  for (const EntryInfo& entry : from->entries()) {
    ASSERT_OK(out->copy(*from, entry.name));
  }
  ASSERT_OK(out->commit());
  const auto original = from->open_entry("log.bin");
  EXPECT_EQ(log_of(memory.files, "g").value(), read_all(**original, 1 << 20).value());
}

}  // namespace
}  // namespace sixpoint::gt3x
