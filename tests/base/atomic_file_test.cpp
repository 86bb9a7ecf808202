#include "base/atomic_file.h"

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include <gmock/gmock.h>
#include <unistd.h>

#include "base/forwarding_files.h"
#include "base/memory_env.h"
#include "base/temporaries.h"
#include "expect_result.h"
#include "temporary_folder.h"
#include "text_of.h"

namespace sixpoint {
namespace {

TEST(AtomicFile, ReplacesTheOldFileOnlyOnCommit) {
  MemoryEnv memory;
  ASSERT_OK(write_file(memory.files, "a/f", "old"));
  {
    auto out = AtomicFile::create(memory.files, "a/f");
    ASSERT_OK(out);
    ASSERT_OK(out->append("new and longer"));
    EXPECT_EQ(text_of(memory.files, "a/f"), "old");
  }
  EXPECT_EQ(text_of(memory.files, "a/f"), "old");
  EXPECT_EQ(memory.files.list("a")->size(), 1U) << "the temporary file must be gone";
  ASSERT_OK(write_file(memory.files, "a/f", "new"));
  EXPECT_EQ(text_of(memory.files, "a/f"), "new");
}

// The oracle is the promise itself: after a power cut at every single disk operation in turn, the
// file holds the old text or the new one, and the new one once commit() has returned.
TEST(AtomicFile, SurvivesAPowerCutAtEveryOperation) {
  for (std::size_t stop = 0;; ++stop) {
    MemoryEnv memory;
    ASSERT_OK(write_file(memory.files, "f", "old"));
    memory.files.fail_after(stop);
    const auto status = write_file(memory.files, "f", "new");
    memory.files.stop_failing();
    memory.files.lose_power();
    const std::string text = text_of(memory.files, "f");
    if (status) {
      EXPECT_EQ(text, "new");
      EXPECT_GE(stop, 5U) << "create, write, sync, rename, folder sync";
      break;
    }
    EXPECT_TRUE(text == "old" || text == "new") << text << " after operation " << stop;
  }
}

TEST(AtomicFile, TakesOverWhatAProcessThatIsGoneLeft) {
  MemoryEnv memory;
  ASSERT_OK(memory.files.create("./.f.0.tmp"));
  ASSERT_OK(write_file(memory.files, "f", "text"));
  EXPECT_EQ(text_of(memory.files, "f"), "text");
  EXPECT_EQ(memory.files.list(".")->size(), 1U);
  // On the real disk, as many as earlier versions could pile up.
  const tests::TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  for (int i = 0; i < 100; ++i) {
    ASSERT_OK(files.create(folder / (".f." + std::to_string(i) + ".tmp")));
  }
  ASSERT_OK(write_file(files, folder / "f", "text"));
  EXPECT_THAT(*files.list(folder.path()), testing::ElementsAre("f"));
}

// Says whether the file that is removed was locked by who wrote it.
class WatchedRemoval final : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  Status remove(const std::string& path) override {
    const auto lock = disk().lock(path);
    was_locked = lock && *lock == nullptr;
    return disk().remove(path);
  }
  bool was_locked = false;
};

// Else another process could take the name in between, and would lose its file.
TEST(AtomicFile, IsRemovedWhileItIsLocked) {
  const tests::TemporaryFolder folder;
  WatchedRemoval files(posix_env().files);
  { ASSERT_OK(AtomicFile::create(files, folder / "f")); }
  EXPECT_TRUE(files.was_locked);
  EXPECT_TRUE(files.list(folder.path())->empty());
}

TEST(AtomicFile, SaysThatANameIsTooLongForTheTemporaryOne) {
  const tests::TemporaryFolder folder;
  ASSERT_OK(write_file(posix_env().files, folder / std::string(248, 'a'), "x"));
  const std::string path = folder / std::string(249, 'a');
  const Status status = write_file(posix_env().files, path, "x");
  EXPECT_FAILS(status, ErrorCode::cannot_create);
  EXPECT_EQ(status.error().where, path);
  EXPECT_THAT(status.error().what, testing::HasSubstr("too long"));
  EXPECT_THAT(status.error().hint, testing::HasSubstr("248 bytes"));
}

TEST(AtomicFile, LeavesWhatIsBeingWritten) {
  const tests::TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  auto here = AtomicFile::create(files, folder / "f");
  ASSERT_OK(here);
  ASSERT_OK(here->append("first"));
  // As another process makes it, whose temporary files this one does not know.
  auto elsewhere = files.create(folder / ".f.1.tmp");
  ASSERT_OK(elsewhere);
  ASSERT_OK(write_file(files, folder / "f", "second"));
  EXPECT_THAT(*files.list(folder.path()), testing::ElementsAre(".f.0.tmp", ".f.1.tmp", "f"));
  ASSERT_OK(here->commit());
  EXPECT_EQ(text_of(files, folder / "f"), "first");
  elsewhere->reset();  // it ended without giving it its name
  ASSERT_OK(write_file(files, folder / "f", "third"));
  // .f.0.tmp is free, so nobody looks further: the next that needs a second name takes it over.
  EXPECT_THAT(*files.list(folder.path()), testing::ElementsAre(".f.1.tmp", "f"));
}

TEST(Temporaries, AreRemovedAsTheyAreNoted) {
  const tests::TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  auto begun = AtomicFile::create(files, folder / "f");
  ASSERT_OK(begun);
  ASSERT_OK(write_file(files, folder / "done", "text"));
  EXPECT_TRUE(is_noted_temporary(folder / ".f.0.tmp"));
  EXPECT_FALSE(is_noted_temporary(folder / ".done.0.tmp"));
  // In a process that ends behind it, as the handler does.
  EXPECT_EXIT(
      {
        remove_noted_temporaries();
        ::_exit(is_noted_temporary(folder / ".f.0.tmp") ? 1 : 0);
      },
      testing::ExitedWithCode(0), "");
  EXPECT_THAT(*files.list(folder.path()), testing::ElementsAre("done"));
}

// The process is told to end right after the file was created, on the thread that creates it or on
// another: the file is noted first.
TEST(Temporaries, OneThatIsJustCreatedIsRemovedToo) {
  class ToldToEnd final : public ForwardingFiles {
   public:
    ToldToEnd(FileSystem& files, bool elsewhere) : ForwardingFiles(files), elsewhere_(elsewhere) {}
    Result<std::unique_ptr<WritableFile>> create(const std::string& path) override {
      auto file = ForwardingFiles::create(path);
      if (elsewhere_) {
        std::thread(end).detach();
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
      } else {
        static_cast<void>(::raise(SIGTERM));
      }
      return file;
    }
    static void end() {
      remove_noted_temporaries();
      ::_exit(0);
    }

   private:
    bool elsewhere_;
  };
  for (const bool elsewhere : {false, true}) {
    SCOPED_TRACE(elsewhere);
    const tests::TemporaryFolder folder;
    EXPECT_EXIT(
        {
          ::signal(SIGTERM, [](int) { ToldToEnd::end(); });
          ToldToEnd files(posix_env().files, elsewhere);
          static_cast<void>(AtomicFile::create(files, folder / "f"));
          ::sleep(30);
          ::_exit(1);
        },
        testing::ExitedWithCode(0), "");
    EXPECT_THAT(*posix_env().files.list(folder.path()), testing::IsEmpty());
  }
}

// A disk whose rule is `how` for every file, with a pipe that takes everything.
class RuledFiles final : public ForwardingFiles {
 public:
  RuledFiles(FileSystem& files, Placing how) : ForwardingFiles(files), how_(how) {}
  Result<Placement> placement(const std::string& path) override { return Placement{how_, path}; }
  Result<std::unique_ptr<WritableFile>> open_through(const std::string& /*path*/) override {
    class Pipe final : public WritableFile {
     public:
      explicit Pipe(std::string& text) : text_(text) {}
      Status write_at(std::uint64_t /*offset*/, std::span<const std::uint8_t> bytes) override {
        text_ += as_text(bytes);
        return {};
      }
      Result<std::size_t> read_at(std::uint64_t /*offset*/,
                                  std::span<std::uint8_t> /*out*/) override {
        return std::size_t{0};
      }
      Status sync() override { return {}; }
      Status close() override { return {}; }

     private:
      std::string& text_;
    };
    return std::make_unique<Pipe>(went_through);
  }
  std::string went_through;

 private:
  Placing how_;
};

TEST(AtomicFile, KeepsWhatIsThereWhereTheRuleSaysSo) {
  MemoryEnv memory;
  RuledFiles files(memory.files, Placing::keep);
  ASSERT_OK(write_file(files, "f", "first"));
  EXPECT_FAILS(write_file(files, "f", "second"), ErrorCode::cannot_create);
  EXPECT_EQ(text_of(memory.files, "f"), "first");
  EXPECT_EQ(memory.files.list(".")->size(), 1U) << "no temporary file stays";
  RuledFiles replacing(memory.files, Placing::replace);
  EXPECT_FAILS(refuse_existing(memory.files, "f"), ErrorCode::cannot_create);
  EXPECT_OK(refuse_existing(replacing, "f"));
  EXPECT_OK(refuse_existing(memory.files, "none"));
}

TEST(AtomicFile, BytesThatGoThroughMakeNoFile) {
  MemoryEnv memory;
  RuledFiles files(memory.files, Placing::through);
  {
    auto out = AtomicFile::create(files, "pipe");
    ASSERT_OK(out);
    ASSERT_OK(out->append("as "));
    EXPECT_EQ(files.went_through, "as ") << "at once";
    ASSERT_OK(out->append("they come"));
    ASSERT_OK(out->commit());
  }
  EXPECT_EQ(files.went_through, "as they come");
  files.went_through.clear();
  // A writer that goes back: the whole comes at the end.
  auto seeking = AtomicFile::create(files, "pipe");
  ASSERT_OK(seeking);
  ASSERT_OK(seeking->file().write_at(2, as_bytes("cd")));
  ASSERT_OK(seeking->file().write_at(0, as_bytes("ab")));
  EXPECT_EQ(files.went_through, "");
  ASSERT_OK(seeking->commit());
  EXPECT_EQ(files.went_through, "abcd");
  EXPECT_EQ(memory.files.changing_operations(), 0U);
}

TEST(PrivateFiles, AreTheirOwnersAlone) {
  const tests::TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  ASSERT_OK(make_private_folders(files, folder / "a/b"));
  ASSERT_OK(write_private_file(files, folder / "a/b/f", "text"));
  using std::filesystem::perms;
  EXPECT_EQ(std::filesystem::status(folder / "a").permissions(), perms::owner_all);
  EXPECT_EQ(std::filesystem::status(folder / "a/b").permissions(), perms::owner_all);
  EXPECT_EQ(std::filesystem::status(folder / "a/b/f").permissions(),
            perms::owner_read | perms::owner_write);
  EXPECT_EQ(text_of(files, folder / "a/b/f"), "text");
}

}  // namespace
}  // namespace sixpoint
