// Entries and places beyond 4 GiB, on the real disk: the file has holes where its bytes are zero,
// so that it takes little of the disk.
#include <algorithm>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <zip.h>

#include "expect_result.h"
#include "gt3x/container/archive_end.h"
#include "gt3x/container/local_headers.h"
#include "gt3x/container/zip_writer.h"
#include "gt3x/recording.h"
#include "temporary_folder.h"

namespace sixpoint::gt3x {
namespace {

constexpr std::uint64_t kBeyond = (std::uint64_t{1} << 32) + 4321;
constexpr std::uint8_t kLast = 0x5A;
constexpr const char* kInfo =
    "Serial Number: MOS2A01234567\r\nFirmware: 1.9.2\r\nSample Rate: 30\r\n"
    "Start Date: 636000000000000000\r\nAcceleration Scale: 256.0\r\n";

// Zeros, and kLast as the last byte.
class LongSource final : public ByteSource {
 public:
  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(out.size(), kBeyond - at_));
    std::fill_n(out.begin(), count, std::uint8_t{0});
    at_ += count;
    if (count > 0 && at_ == kBeyond) {
      out[count - 1] = kLast;
    }
    return count;
  }
  std::optional<std::uint64_t> size() const override { return kBeyond; }

 private:
  std::uint64_t at_ = 0;
};

// Writes an archive with holes.
class HoleyFile {
 public:
  explicit HoleyFile(const std::string& path)
      : file_(::open(path.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600)) {}
  HoleyFile(const HoleyFile&) = delete;
  HoleyFile& operator=(const HoleyFile&) = delete;
  ~HoleyFile() { ::close(file_); }

  Status put(std::span<const std::uint8_t> bytes) {
    const bool zeros = std::ranges::all_of(bytes, [](std::uint8_t b) { return b == 0; });
    if (!zeros) {
      const auto written = ::pwrite(file_, bytes.data(), bytes.size(), static_cast<off_t>(size_));
      EXPECT_EQ(written, static_cast<ssize_t>(bytes.size()));
    }
    size_ += bytes.size();
    return {};
  }

 private:
  int file_;
  std::uint64_t size_ = 0;
};

void write_long(const std::string& path, Packing packing) {
  HoleyFile file(path);
  ZipWriter zip([&](std::span<const std::uint8_t> bytes) { return file.put(bytes); }, 2);
  LongSource source;
  ASSERT_OK(zip.add("log.bin", source, packing));
  const std::string_view text = kInfo;
  MemorySource info(Bytes(text.begin(), text.end()));
  ASSERT_OK(zip.add("info.txt", info, Packing::store));
  ASSERT_OK(zip.finish());
}

// What both readers are asked for: the number of bytes, and the last one.
struct Ends {
  std::uint64_t size = 0;
  std::uint8_t last = 0;
};

// Oracle: libzip, which also compares the CRC at the end.
Ends read_by_libzip(const std::string& path) {
  int error = 0;
  zip_t* zip = zip_open(path.c_str(), ZIP_RDONLY | ZIP_CHECKCONS, &error);
  EXPECT_NE(zip, nullptr) << error;
  Ends ends;
  if (zip == nullptr) {
    return ends;
  }
  EXPECT_EQ(zip_get_num_entries(zip, 0), 2);
  zip_file_t* file = zip_fopen(zip, "log.bin", 0);
  Bytes piece(1 << 20);
  for (zip_int64_t count = 0; (count = zip_fread(file, piece.data(), piece.size())) != 0;) {
    EXPECT_GT(count, 0) << zip_file_strerror(file);
    if (count < 0) {
      break;
    }
    ends.size += static_cast<std::uint64_t>(count);
    ends.last = piece[static_cast<std::size_t>(count) - 1];
  }
  EXPECT_EQ(zip_fclose(file), 0);
  zip_discard(zip);
  return ends;
}

Ends read_by_ourselves(const std::string& path) {
  Ends ends;
  RecordingOptions options;
  options.limits.ratio = 2000;  // zeros: deflate makes a thousandth of them
  auto recording = Recording::open(posix_env().files, path, options);
  EXPECT_OK(recording);
  if (!recording) {
    return ends;
  }
  EXPECT_EQ(recording->info().serial(), "MOS2A01234567") << "the entry behind the long one";
  auto source = recording->open_entry("log.bin");
  EXPECT_OK(source);
  Bytes piece(1 << 20);
  while (source) {
    const auto count = (*source)->read(piece);
    EXPECT_OK(count);
    if (!count || *count == 0) {
      break;
    }
    ends.size += *count;
    ends.last = piece[*count - 1];
  }
  return ends;
}

class Zip64 : public testing::TestWithParam<Packing> {
 protected:
  void SetUp() override { write_long(path_, GetParam()); }
  tests::TemporaryFolder folder_;
  std::string path_ = folder_ / "long.gt3x";
};

TEST_P(Zip64, AnEntryOfMoreThan4GibIsWrittenAndReadWhole) {
  for (const Ends& ends : {read_by_libzip(path_), read_by_ourselves(path_)}) {
    EXPECT_EQ(ends.size, kBeyond);
    EXPECT_EQ(ends.last, kLast);
  }
}

TEST_P(Zip64, TheEndAndTheHeadersAreFoundBeyond4Gib) {
  auto opened = posix_env().files.open(path_);
  ASSERT_OK(opened);
  const std::shared_ptr<const ReadableFile> file = std::move(*opened);
  EXPECT_EQ(file->size() > kBeyond, GetParam() == Packing::store);
  const auto end = archive_end(*file);
  ASSERT_OK(end);
  EXPECT_EQ(*end, file->size());

  const auto found = find_local_entries(*file, ArchiveLimits{});
  ASSERT_OK(found);
  ASSERT_EQ(found->size(), 2U);
  EXPECT_EQ((*found)[0].header.name, "log.bin");
  EXPECT_EQ((*found)[0].header.size, kBeyond);
  EXPECT_EQ((*found)[1].header.name, "info.txt");
}

INSTANTIATE_TEST_SUITE_P(BothWaysOfPacking, Zip64,
                         testing::Values(Packing::store, Packing::deflate), [](const auto& test) {
                           return test.param == Packing::store ? "Stored" : "Deflated";
                         });

}  // namespace
}  // namespace sixpoint::gt3x
