#include "gt3x/recording_writer.h"

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x_made_log.h"

namespace sixpoint::gt3x {
namespace {

Status write_pair(FileSystem& files, const std::string& path) {
  return tests::put_recording(files, path, Bytes(1000, 0x55), "Serial Number: X\r\n");
}

TEST(RecordingWriter, SameEntriesSameBytes) {
  MemoryEnv memory;
  ASSERT_OK(write_pair(memory.files, "a.gt3x"));
  ASSERT_OK(write_pair(memory.files, "b.gt3x"));
  const auto a = read_file(memory.files, "a.gt3x");
  ASSERT_OK(a);
  EXPECT_EQ(*a, *read_file(memory.files, "b.gt3x"));
  EXPECT_EQ(memory.files.list(".")->size(), 2U);
}

TEST(RecordingWriter, RefusesNamesThatLeaveTheArchive) {
  MemoryEnv memory;
  auto out = RecordingWriter::create(memory.files, "a.gt3x");
  ASSERT_OK(out);
  for (const char* name : {"", "../x", "/b", "a/../b", "C:x", "a/", ".."}) {
    EXPECT_FAILS(out->add(name, Bytes{1}), ErrorCode::usage);
  }
  ASSERT_OK(out->add("x", Bytes{1}));
  ASSERT_OK(out->add("notes/x", Bytes{1}));
  EXPECT_FAILS(out->add("x", Bytes{2}), ErrorCode::usage);
}

class FailingSource final : public ByteSource {
 public:
  Result<std::size_t> read(std::span<std::uint8_t>) override {
    return fail(ErrorCode::bad_data, "the source broke", "here", "repair it");
  }
};

// What is written can be read again.
TEST(RecordingWriter, RefusesOneEntryMoreThanIsRead) {
  MemoryEnv memory;
  auto out = RecordingWriter::create(memory.files, "a.gt3x");
  ASSERT_OK(out);
  ASSERT_OK(out->add("log.bin", std::string_view()));
  ASSERT_OK(out->add("info.txt", std::string_view("Serial Number: MOS2A45130450")));
  for (std::uint64_t i = 2; i < ArchiveLimits{}.entries; ++i) {
    ASSERT_OK(out->add("entry " + std::to_string(i), std::string_view("text")));
  }
  EXPECT_FAILS(out->add("one more", std::string_view("text")), ErrorCode::bad_data);
  ASSERT_OK(out->commit());
  const auto back = Recording::open(memory.files, "a.gt3x");
  ASSERT_OK(back);
  EXPECT_EQ(back->entries().size(), ArchiveLimits{}.entries);
}

TEST(RecordingWriter, ASourceThatFailsLeavesNoFile) {
  MemoryEnv memory;
  {
    auto out = RecordingWriter::create(memory.files, "a.gt3x");
    ASSERT_OK(out);
    FailingSource source;
    const auto added = out->add("log.bin", source);
    ASSERT_FALSE(added);
    EXPECT_EQ(added.error().what, "the source broke");
    const auto status = out->commit();
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().what, "the source broke");
  }
  EXPECT_TRUE(memory.files.list(".")->empty());
}

// Oracle: the promise of AtomicFile, through the writer: at every operation of the disk in turn the
// power goes, and the old file or the whole new one is there.
TEST(RecordingWriter, SurvivesAPowerCutAtEveryOperation) {
  MemoryEnv whole;
  ASSERT_OK(write_pair(whole.files, "f"));
  const Bytes new_bytes = *read_file(whole.files, "f");
  for (std::size_t stop = 0;; ++stop) {
    MemoryEnv memory;
    ASSERT_OK(write_file(memory.files, "f", "old"));
    memory.files.fail_after(stop);
    const auto status = write_pair(memory.files, "f");
    memory.files.stop_failing();
    memory.files.lose_power();
    const auto bytes = read_file(memory.files, "f");
    ASSERT_OK(bytes);
    if (status) {
      EXPECT_EQ(*bytes, new_bytes);
      EXPECT_GE(stop, 5U);
      break;
    }
    EXPECT_TRUE(*bytes == (Bytes{'o', 'l', 'd'}) || *bytes == new_bytes) << stop;
  }
}

}  // namespace
}  // namespace sixpoint::gt3x
