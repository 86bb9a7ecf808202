// Files by name or folder, and work on many of them.
#include "cli/workers.h"

#include <atomic>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "run_command.h"

namespace sixpoint::cli {
namespace {

class Workers : public testing::Test {
 protected:
  MemoryEnv memory_;
  std::ostringstream out_;
  std::ostringstream people_;
  std::istringstream in_;
  Context context_{memory_.env, out_, people_, in_};
};

TEST_F(Workers, NamedFilesKeepTheOrderInWhichTheyWereNamed) {
  FileSystem& files = memory_.env.files;
  for (const char* folder : {"tree", "tree/sub", "empty"}) {
    ASSERT_OK(files.make_folders(folder));
  }
  for (const char* name : {"b.gt3x", "tree/a.GT3X", "tree/sub/c.gt3x", "tree/notes.txt"}) {
    ASSERT_OK(write_file(files, name, "x"));
  }
  const auto found = named_files(
      context_, {"b.gt3x", "none", "tree", "b.gt3x", "tree/a.GT3X", "empty"}, {".gt3x"});
  std::vector<std::string> names;
  for (const NamedFile& file : found) {
    names.push_back(file.path + (file.error ? " refused" : " as " + file.relative));
  }
  EXPECT_EQ(names,
            (std::vector<std::string>{"b.gt3x as b.gt3x", "none refused", "tree/a.GT3X as a.GT3X",
                                      "tree/sub/c.gt3x as sub/c.gt3x"}))
      << "a file that is named twice is taken once";
  EXPECT_EQ(found[1].error->code, ErrorCode::no_input);
  EXPECT_NE(people_.str().find("empty: no .gt3x file below this folder"), std::string::npos);
  EXPECT_EQ(context_.exit_code, 0) << "of a folder among others";
  EXPECT_TRUE(named_files(context_, {"empty", "tree/sub"}, {".agd"}).empty());
  EXPECT_EQ(context_.exit_code, static_cast<int>(ErrorCode::no_input)) << "nothing to work on";
}

TEST_F(Workers, EveryFileIsAnsweredOnceAndInOrder) {
  std::vector<NamedFile> files(100);
  for (std::size_t i = 0; i < files.size(); ++i) {
    files[i].path = std::to_string(i);
  }
  for (const unsigned jobs : {0U, 1U, 7U}) {
    std::atomic<int> calls{0};
    const auto answers =
        for_each_file<std::string>(context_, "working", files, jobs, [&](const NamedFile& file) {
          ++calls;
          return file.path + "!";
        });
    EXPECT_EQ(calls, 100);
    ASSERT_EQ(answers.size(), 100U);
    EXPECT_EQ(answers[0], "0!");
    EXPECT_EQ(answers[99], "99!");
  }
  EXPECT_TRUE(
      for_each_file<int>(context_, "working", {}, 4, [](const NamedFile&) { return 1; }).empty());
  EXPECT_EQ(people_.str(), "") << "a bar belongs on a terminal only";
}

TEST(JobsOption, MoreThreadsThanAnyoneMeansAreRefused) {
  MemoryEnv memory;
  for (const std::vector<std::string>& line :
       {std::vector<std::string>{"repair", "a.gt3x", "-o", "out"},
        {"scan", "a.gt3x"},
        {"export", "a.gt3x", "--csv", "a.csv.gz", "--gzip"},
        {"impact", "a.gt3x"},
        {"archive", "plan", "a.gt3x", "-o", "plan"},
        {"archive", "run", "plan", "--shard", "0", "-o", "out"}}) {
    for (const char* jobs : {"257", "4294967295"}) {
      std::vector<std::string> words = line;
      words.insert(words.end(), {"--jobs", jobs});
      EXPECT_EQ(tests::run_command(memory.env, words).exit_code, 64) << line.front();
    }
    std::vector<std::string> most = line;
    most.insert(most.end(), {"--jobs", "256"});
    EXPECT_EQ(tests::run_command(memory.env, most).exit_code, 66) << "there is no such input";
  }
}

}  // namespace
}  // namespace sixpoint::cli
