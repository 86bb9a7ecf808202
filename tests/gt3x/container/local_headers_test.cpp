#include "gt3x/container/local_headers.h"

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/made_archive.h"

namespace sixpoint::gt3x {
namespace {

std::vector<LocalEntry> entries_in(const Bytes& bytes, const ArchiveLimits& limits = {}) {
  MemoryEnv memory;
  EXPECT_OK(write_file(memory.files, "f", as_text(bytes)));
  const auto file = memory.files.open("f");
  EXPECT_OK(file);
  return find_local_entries(**file, limits).value();
}

Bytes counted(std::size_t size) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) {
    bytes[i] = static_cast<std::uint8_t>(i * 37 % 251);
  }
  return bytes;
}

TEST(LocalHeaders, EveryKindOfEntryIsFound) {
  const tests::MadeArchive made({{"info.txt", Bytes(90, 'x')},
                                 {"stored behind", counted(700), false, true},
                                 {"deflated behind", counted(900), true, true},
                                 {"log.bin", counted(600'000), true, false}});
  for (const std::size_t size : {made.bytes.size(), made.list_offset}) {
    const auto found = entries_in(
        Bytes(made.bytes.begin(), made.bytes.begin() + static_cast<std::ptrdiff_t>(size)));
    ASSERT_EQ(found.size(), 4U);
    const std::size_t kSizes[] = {90, 700, 900, 600'000};
    for (std::size_t i = 0; i < found.size(); ++i) {
      EXPECT_EQ(found[i].header.size, kSizes[i]) << i;
      EXPECT_EQ(found[i].offset, made.data_offsets[i]) << i;
      EXPECT_TRUE(found[i].size_known && found[i].crc_known) << i;
      EXPECT_EQ(found[i].packed_bytes, found[i].header.packed_size) << i;
    }
    EXPECT_EQ(found[1].header.name, "stored behind");
    EXPECT_EQ(found[3].header.method, kMethodDeflate);
  }
}

TEST(LocalHeaders, ACutEntryEndsWithTheFile) {
  const tests::MadeArchive made({{"info.txt", Bytes(90, 'x')}, {"log.bin", counted(5000)}});
  const std::size_t cut = made.data_offsets[1] + 1234;
  const auto found =
      entries_in(Bytes(made.bytes.begin(), made.bytes.begin() + static_cast<std::ptrdiff_t>(cut)));
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[1].header.size, 5000U);
  EXPECT_TRUE(found[1].size_known);
  EXPECT_EQ(found[1].packed_bytes, 1234U);
}

TEST(LocalHeaders, ACutEntryWithItsSizesBehindIt) {
  const tests::MadeArchive made({{"log.bin", counted(5000), false, true}});
  const std::size_t cut = made.data_offsets[0] + 1234;
  const auto found =
      entries_in(Bytes(made.bytes.begin(), made.bytes.begin() + static_cast<std::ptrdiff_t>(cut)));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_FALSE(found[0].size_known || found[0].crc_known);
  EXPECT_EQ(found[0].packed_bytes, 1234U);
}

TEST(LocalHeaders, AWrongSizeDoesNotHideTheNextEntry) {
  tests::MadeArchive made({{"log.bin", counted(5000)}, {"info.txt", Bytes(90, 'x')}});
  made.bytes[18 + 1] ^= 0x40;  // packed size in the first header
  const auto found = entries_in(made.bytes);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_FALSE(found[0].size_known || found[0].crc_known);
  EXPECT_EQ(found[0].packed_bytes, 5000U);
  EXPECT_EQ(found[1].header.name, "info.txt");
}

TEST(LocalHeaders, NoMoreThanTheLimitAndOne) {
  std::vector<tests::MadeEntry> many;
  for (int i = 0; i < 20; ++i) {
    many.push_back({"e" + std::to_string(i), Bytes(3, 1)});
  }
  ArchiveLimits limits;
  limits.entries = 7;
  EXPECT_EQ(entries_in(tests::MadeArchive(many).bytes, limits).size(), 8U);
}

TEST(LocalHeaders, NothingInWhatIsNoArchive) {
  EXPECT_TRUE(entries_in({}).empty());
  EXPECT_TRUE(entries_in(Bytes(100'000, 'P')).empty());
  EXPECT_TRUE(entries_in(Bytes{'P', 'K', 3, 4}).empty());
}

}  // namespace
}  // namespace sixpoint::gt3x
