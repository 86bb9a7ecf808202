#include "gt3x/container/archive_end.h"

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/made_archive.h"

namespace sixpoint::gt3x {
namespace {

std::uint64_t end_of(const Bytes& bytes) {
  MemoryEnv memory;
  EXPECT_OK(write_file(memory.files, "f", as_text(bytes)));
  const auto file = memory.files.open("f");
  EXPECT_OK(file);
  return archive_end(**file).value();
}

const Bytes& some_archive() {
  static const Bytes kArchive =
      tests::MadeArchive({{"log.bin", Bytes(500, 7)}, {"info.txt", Bytes(90, 'x')}}).bytes;
  return kArchive;
}

TEST(ArchiveEnd, AnyNumberOfBytesMayStandBehind) {
  for (const std::size_t behind : {0U, 1U, 4096U, 65'514U, 65'535U, 65'536U, 70'000U, 300'001U}) {
    for (const std::uint8_t junk : {std::uint8_t{0}, std::uint8_t{'P'}}) {
      Bytes bytes = some_archive();
      bytes.insert(bytes.end(), behind, junk);
      EXPECT_EQ(end_of(bytes), some_archive().size()) << behind;
    }
  }
}

TEST(ArchiveEnd, RecordsThatAreNotTrueAreNoEnd) {
  // A record of the same form in the bytes behind, whose list is not where it says.
  Bytes bytes = some_archive();
  const Bytes end(bytes.end() - 22, bytes.end());
  bytes.insert(bytes.end(), 1000, 0);
  bytes.insert(bytes.end(), end.begin(), end.end());
  EXPECT_EQ(end_of(bytes), some_archive().size());
}

TEST(ArchiveEnd, WithoutARecordItIsTheFiles) {
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{1}, std::size_t{21}, some_archive().size() - 1}) {
    const Bytes bytes(some_archive().begin(),
                      some_archive().begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_EQ(end_of(bytes), size);
  }
}

}  // namespace
}  // namespace sixpoint::gt3x
