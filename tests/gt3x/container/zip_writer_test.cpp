#include "gt3x/container/zip_writer.h"

#include <gtest/gtest.h>
#include <zip.h>

#include "base/random.h"
#include "expect_result.h"

namespace sixpoint::gt3x {
namespace {

// What comes from a pipe: its length is not known.
class OfUnknownSize final : public ByteSource {
 public:
  explicit OfUnknownSize(Bytes bytes) : inner_(std::move(bytes)) {}
  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    return inner_.read(out.first(std::min<std::size_t>(out.size(), 1000)));
  }

 private:
  MemorySource inner_;
};

Bytes log_like(std::size_t size) {
  Random random(size);
  Bytes bytes(size);
  for (auto& byte : bytes) {
    byte = static_cast<std::uint8_t>(random.below(90));
  }
  return bytes;
}

const std::vector<std::pair<std::string, Bytes>>& entries_to_write() {
  static const std::vector<std::pair<std::string, Bytes>> entries = {
      {"log.bin", log_like(3 * kPackedPieceSize + 12'345)},
      {"empty", {}},
      {"one", {7}},
      {"piece", log_like(kPackedPieceSize)},
      {"pieces", log_like(2 * kPackedPieceSize)},
      {"\xC3\xA4.txt", Bytes(1000, 'a')}};
  return entries;
}

Bytes archive_of(Packing packing, unsigned jobs, bool sizes_known = true) {
  Bytes archive;
  ZipWriter zip(
      [&](std::span<const std::uint8_t> bytes) {
        archive.insert(archive.end(), bytes.begin(), bytes.end());
        return Status{};
      },
      jobs);
  for (const auto& [name, bytes] : entries_to_write()) {
    MemorySource known(bytes);
    OfUnknownSize unknown(bytes);
    EXPECT_OK(zip.add(name, sizes_known ? static_cast<ByteSource&>(known) : unknown, packing));
  }
  EXPECT_OK(zip.finish());
  return archive;
}

// Oracle: libzip, with its own check that the central directory and the local headers agree.
void expect_libzip_reads(const Bytes& archive) {
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* source = zip_source_buffer_create(archive.data(), archive.size(), 0, &error);
  ASSERT_NE(source, nullptr);
  zip_t* zip = zip_open_from_source(source, ZIP_RDONLY | ZIP_CHECKCONS, &error);
  ASSERT_NE(zip, nullptr) << zip_error_strerror(&error);
  ASSERT_EQ(zip_get_num_entries(zip, 0), static_cast<zip_int64_t>(entries_to_write().size()));
  zip_uint64_t index = 0;
  for (const auto& [name, bytes] : entries_to_write()) {
    EXPECT_EQ(zip_get_name(zip, index, ZIP_FL_ENC_UTF_8), name);
    zip_file_t* file = zip_fopen_index(zip, index, 0);
    ASSERT_NE(file, nullptr);
    Bytes out(bytes.size() + 1);
    EXPECT_EQ(zip_fread(file, out.data(), out.size()), static_cast<zip_int64_t>(bytes.size()));
    out.resize(bytes.size());
    EXPECT_TRUE(out == bytes) << name;
    EXPECT_EQ(zip_fclose(file), 0);
    ++index;
  }
  zip_discard(zip);
}

TEST(ZipWriter, LibzipReadsEveryKindOfEntry) {
  for (const auto packing : {Packing::store, Packing::deflate}) {
    for (const bool sizes_known : {true, false}) {
      SCOPED_TRACE(sizes_known);
      expect_libzip_reads(archive_of(packing, 1, sizes_known));
    }
  }
}

TEST(ZipWriter, SameBytesOnAnyNumberOfThreads) {
  const Bytes one = archive_of(Packing::deflate, 1);
  for (const unsigned jobs : {2U, 3U, 8U}) {
    EXPECT_TRUE(archive_of(Packing::deflate, jobs) == one) << jobs;
  }
}

TEST(ZipWriter, ErrorsOfSourceAndSinkComeBack) {
  class Breaks final : public ByteSource {
   public:
    Result<std::size_t> read(std::span<std::uint8_t> out) override {
      if (++reads_ > 5) {
        return fail(ErrorCode::bad_data, "the source broke");
      }
      std::fill(out.begin(), out.end(), std::uint8_t{1});
      return out.size();
    }

   private:
    int reads_ = 0;
  };
  for (const auto packing : {Packing::store, Packing::deflate}) {
    for (const unsigned jobs : {1U, 2U}) {
      ZipWriter zip([](std::span<const std::uint8_t>) { return Status{}; }, jobs);
      Breaks source;
      const auto broken = zip.add("log.bin", source, packing);
      ASSERT_FALSE(broken);
      EXPECT_EQ(broken.error().what, "the source broke");
      std::size_t written = 0;
      ZipWriter full(
          [&](std::span<const std::uint8_t> bytes) -> Status {
            written += bytes.size();
            return written > kPackedPieceSize / 2
                       ? fail(ErrorCode::io, "the disk is full", "f", "make room")
                       : Status{};
          },
          jobs);
      MemorySource long_one(entries_to_write().front().second);
      EXPECT_FAILS(full.add("log.bin", long_one, packing), ErrorCode::io);
    }
  }
}

// The sanitizers see a thread that packs a piece which is gone.
TEST(ZipWriter, ASourceThatBreaksAtAnyPieceLeavesNoThreadBehind) {
  class BreaksAt final : public ByteSource {
   public:
    explicit BreaksAt(Bytes bytes) : bytes_(std::move(bytes)) {}
    Result<std::size_t> read(std::span<std::uint8_t> out) override {
      SIXPOINT_ASSIGN(const std::size_t count, bytes_.read(out));
      if (count == 0) {
        return fail(ErrorCode::bad_data, "the source broke", "f", "mend it");
      }
      return count;
    }

   private:
    MemorySource bytes_;
  };
  const Bytes all = log_like(9 * kPackedPieceSize);
  for (const unsigned jobs : {2U, 3U}) {
    for (std::size_t pieces = 2; pieces <= 2 * jobs + 3; ++pieces) {
      ZipWriter zip([](std::span<const std::uint8_t>) { return Status{}; }, jobs);
      const auto part = std::span(all).first(pieces * kPackedPieceSize);
      BreaksAt source({part.begin(), part.end()});
      EXPECT_FAILS(zip.add("log.bin", source, Packing::deflate), ErrorCode::bad_data);
    }
  }
}

}  // namespace
}  // namespace sixpoint::gt3x
