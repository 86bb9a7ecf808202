#include "cli/output.h"

#include <filesystem>
#include <fstream>
#include <thread>

#include <CLI/App.hpp>
#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "cli/command_fixture.h"
#include "expect_result.h"

namespace sixpoint::cli {
namespace {

// One row of the table of placing_of().
struct PlacingRow {
  Target target;
  std::optional<Placing> plain;   // nothing: refused
  std::optional<Placing> forced;  // with --force
  bool force_helps = false;       // the hint names it
};

TEST(OutputRule, FollowsTheTable) {
  const std::vector<PlacingRow> rows = {
      {Target::nothing, Placing::keep, Placing::keep},
      {Target::plain, std::nullopt, Placing::replace, true},
      {Target::recording, std::nullopt, std::nullopt},
      {Target::database, std::nullopt, std::nullopt},
      {Target::record, std::nullopt, std::nullopt},
      {Target::input, std::nullopt, std::nullopt},
      {Target::folder, std::nullopt, std::nullopt},
      {Target::device, Placing::through, Placing::through},
      {Target::pipe, Placing::through, Placing::through},
      {Target::other, std::nullopt, std::nullopt},
      {Target::lost_link, std::nullopt, std::nullopt},
  };
  for (const PlacingRow& row : rows) {
    for (const bool force : {false, true}) {
      const auto answer = placing_of(row.target, force, "here");
      const auto& wanted = force ? row.forced : row.plain;
      SCOPED_TRACE(static_cast<int>(row.target));
      ASSERT_EQ(answer.has_value(), wanted.has_value());
      if (answer) {
        EXPECT_EQ(*answer, *wanted);
        continue;
      }
      EXPECT_EQ(answer.error().code, ErrorCode::cannot_create);
      EXPECT_EQ(answer.error().where, "here");
      EXPECT_EQ(answer.error().hint.find("--force") != std::string::npos, row.force_helps);
    }
  }
}

TEST(OutputRule, FollowsTheTableOfFolders) {
  const auto allowed = [](FolderTarget target, bool force) {
    return allow_folder(target, force, "here").has_value();
  };
  for (const bool force : {false, true}) {
    EXPECT_TRUE(allowed(FolderTarget::nothing, force));
    EXPECT_TRUE(allowed(FolderTarget::empty, force));
    EXPECT_FALSE(allowed(FolderTarget::recording_name, force));
    EXPECT_FALSE(allowed(FolderTarget::record, force));
    EXPECT_FALSE(allowed(FolderTarget::no_folder, force));
    EXPECT_EQ(allowed(FolderTarget::filled, force), force);
  }
  EXPECT_EQ(allow_folder(FolderTarget::record, true, "here").error().code,
            ErrorCode::cannot_create);
  EXPECT_EQ(allow_folder(FolderTarget::recording_name, true, "here").error().code,
            ErrorCode::usage);
}

class OutputLook : public tests::CommandTest {
 protected:
  Target look(const std::string& name) const { return look_at(posix_env().files, path(name), {}); }
  void write(const std::string& name, std::string_view text) const {
    ASSERT_OK(write_file(posix_env().files, path(name), text));
  }
  void link(const std::string& from, const std::string& to) const {
    std::filesystem::create_symlink(to, path(from));
  }
};

TEST_F(OutputLook, TellsFilesByTheirContent) {
  EXPECT_EQ(look("none"), Target::nothing);
  write("empty", "");
  EXPECT_EQ(look("empty"), Target::plain);
  write("note.txt", "PK is how a zip begins; SQLite format 3");
  EXPECT_EQ(look("note.txt"), Target::plain);
  write("anything", std::string_view("PK\x03\x04 a zip under another name", 30));
  EXPECT_EQ(look("anything"), Target::recording);
  write("day1.gt3x", "damaged");
  EXPECT_EQ(look("day1.gt3x"), Target::recording);
  write("store", std::string_view("SQLite format 3\0 and so on", 26));
  EXPECT_EQ(look("store"), Target::database);
  write("store-wal", "what was written last");
  EXPECT_EQ(look("store-wal"), Target::database);
  write("other-wal", "no database beside it");
  EXPECT_EQ(look("other-wal"), Target::plain);
}

TEST_F(OutputLook, TellsThePartsOfRecordsOfTheProgram) {
  std::filesystem::create_directory(path("bundle"));
  write("bundle/protocol.json", R"({"schema":"sixpoint/bundle/1","segments":[]})");
  write("bundle/temperature.csv", "host_time_s,temperature_c\n");
  write("bundle/report.html", "<!doctype html>");
  EXPECT_EQ(look("bundle/protocol.json"), Target::record);
  EXPECT_EQ(look("bundle/temperature.csv"), Target::record);
  EXPECT_EQ(look("bundle/report.html"), Target::plain);
  EXPECT_EQ(look("bundle"), Target::folder);
  write("temperature.csv", "of another program");
  EXPECT_EQ(look("temperature.csv"), Target::plain);
  write("s.journal", R"({"schema":"sixpoint/session-journal/1"})");
  EXPECT_EQ(look("s.journal"), Target::record);
  std::filesystem::create_directories(path("plan/shards"));
  write("plan/plan.json", R"({"schema":"sixpoint/archive-plan/1"})");
  write("plan/shards/00000.jsonl", "{}\n");
  EXPECT_EQ(look("plan/shards/00000.jsonl"), Target::record);
  for (const std::string kind : {"run", "capture"}) {
    std::filesystem::create_directory(path(kind));
    write(kind + "/samples-1.csv", "t,x,y,z,c\n");
    EXPECT_EQ(look(kind + "/samples-1.csv"), Target::plain);
    write(kind + "/" + kind + ".json", R"({"schema":"sixpoint/unfinished-)" + kind + R"(/1"})");
    EXPECT_EQ(look(kind + "/samples-1.csv"), Target::record);
    EXPECT_EQ(look(kind + "/" + kind + ".json"), Target::record);
  }
  FileSystem& files = posix_env().files;
  EXPECT_EQ(look_at_folder(files, path("bundle")), FolderTarget::record);
  EXPECT_EQ(look_at_folder(files, path("plan")), FolderTarget::record);
  EXPECT_EQ(look_at_folder(files, path("none")), FolderTarget::nothing);
  EXPECT_EQ(look_at_folder(files, path("none.gt3x")), FolderTarget::recording_name);
  EXPECT_EQ(look_at_folder(files, path("plan/shards")), FolderTarget::filled);
  EXPECT_EQ(look_at_folder(files, path("s.journal")), FolderTarget::no_folder);
  std::filesystem::create_directory(path("new"));
  EXPECT_EQ(look_at_folder(files, path("new")), FolderTarget::empty);
}

TEST_F(OutputLook, TellsDevicesPipesAndLinks) {
  EXPECT_EQ(look_at(posix_env().files, "/dev/null", {}), Target::device);
  EXPECT_EQ(look_at(posix_env().files, "-", {}), Target::device);
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_EQ(look("pipe"), Target::pipe);
  const int listener = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path("socket").copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  EXPECT_EQ(look("socket"), Target::other);
  ::close(listener);
  write("file", "text");
  write("day.gt3x", "x");
  link("to-file", "file");
  link("to-recording", "day.gt3x");
  link("to-nothing", "none");
  link("circle", "circle");
  link("to-device", "/dev/null");
  EXPECT_EQ(look("to-file"), Target::plain);
  EXPECT_EQ(look("to-recording"), Target::recording);
  EXPECT_EQ(look("to-nothing"), Target::lost_link);
  EXPECT_EQ(look("circle"), Target::lost_link);
  EXPECT_EQ(look("to-device"), Target::device);
}

class OutputWriting : public OutputLook {
 protected:
  std::string text(const std::string& name) const {
    std::ifstream in(path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  // What a command does: it asks, and then writes.
  Status put(const std::string& file, bool force, const std::string& input = {}) {
    context_.out_is_taken = false;
    Outputs outputs(context_, {force}, /*json=*/false);
    SIXPOINT_CHECK(outputs.input(input));
    SIXPOINT_CHECK(outputs.file("--out", file));
    return write_file(outputs.files(), file, "new");
  }
  std::ostringstream out_;
  std::ostringstream people_;
  std::istringstream in_;
  Context context_{posix_env(), out_, people_, in_};
};

TEST_F(OutputWriting, ReplacesAFileWithForceAlone) {
  ASSERT_OK(put(path("f"), false));
  EXPECT_EQ(text("f"), "new");
  write("f", "old");
  EXPECT_FAILS(put(path("f"), false), ErrorCode::cannot_create);
  EXPECT_EQ(text("f"), "old");
  ASSERT_OK(put(path("f"), true));
  EXPECT_EQ(text("f"), "new");
}

TEST_F(OutputWriting, FollowsALinkToAFileAndKeepsTheLink) {
  write("f", "old");
  link("l", "f");
  EXPECT_FAILS(put(path("l"), false), ErrorCode::cannot_create);
  EXPECT_EQ(text("f"), "old");
  ASSERT_OK(put(path("l"), true));
  EXPECT_EQ(text("f"), "new");
  EXPECT_TRUE(std::filesystem::is_symlink(path("l")));
}

TEST_F(OutputWriting, AnInputIsNeverAnOutputWhateverItsName) {
  write("limits.toml", "old");
  std::filesystem::create_hard_link(path("limits.toml"), path("second-name"));
  for (const std::string name : {"limits.toml", "second-name", "./limits.toml"}) {
    EXPECT_FAILS(put(path(name), true, path("limits.toml")), ErrorCode::cannot_create);
    EXPECT_EQ(text("limits.toml"), "old");
  }
}

TEST_F(OutputWriting, GoesThroughAPipeAndADevice) {
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  std::string came;
  std::thread reader([&] { came = text("pipe"); });
  EXPECT_OK(put(path("pipe"), false));
  reader.join();
  EXPECT_EQ(came, "new");
  EXPECT_TRUE(std::filesystem::is_fifo(path("pipe")));
  ASSERT_OK(put("/dev/null", false));
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
  EXPECT_FAILS(put("/dev/full", true), ErrorCode::io);
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST_F(OutputWriting, GoesToStandardOutputOnce) {
  ASSERT_OK(put("-", false));
  EXPECT_EQ(out_.str(), "new");
  EXPECT_TRUE(context_.out_is_taken);
  Outputs with_json(context_, {}, /*json=*/true);
  EXPECT_FAILS(with_json.file("--html", "-"), ErrorCode::usage);
  Outputs two(context_, {}, /*json=*/false);
  ASSERT_OK(two.file("--html", "-"));
  EXPECT_FAILS(two.file("--pdf", "/dev/stdout"), ErrorCode::usage);
  ASSERT_OK(two.file("--png", path("a")));
  EXPECT_FAILS(two.file("--label", path("./a")), ErrorCode::usage);
}

TEST_F(OutputWriting, WhatCameToTheNameMeanwhileStays) {
  Outputs outputs(context_, {}, /*json=*/false);
  ASSERT_OK(outputs.file("--out", path("f")));
  auto file = AtomicFile::create(outputs.files(), path("f"));
  ASSERT_OK(file);
  ASSERT_OK(file->append("ours"));
  write("f", "theirs");
  EXPECT_FAILS(file->commit(), ErrorCode::cannot_create);
  EXPECT_EQ(text("f"), "theirs");
}

TEST_F(OutputWriting, WhatIsReadAgainHasToBeAFile) {
  Outputs outputs(context_, {}, /*json=*/false);
  EXPECT_FAILS(outputs.file_to_keep("-o", "/dev/null"), ErrorCode::cannot_create);
  EXPECT_FAILS(outputs.file("-o", path("no/f")), ErrorCode::cannot_create);
  ASSERT_OK(outputs.file_to_keep("-o", path("f")));
}

TEST_F(OutputWriting, AFolderOfAnotherUserIsRefusedBeforeTheWork) {
  constexpr uid_t kNobody = 65534;
  std::filesystem::create_directory(path("theirs"));
  ASSERT_EQ(::chmod(path(".").c_str(), 0755), 0);
  ASSERT_EQ(::chmod(path("theirs").c_str(), ::geteuid() == 0 ? 0755 : 0555), 0);
  const bool is_root = ::geteuid() == 0;
  ASSERT_TRUE(!is_root || ::seteuid(kNobody) == 0);
  Outputs outputs(context_, {}, /*json=*/false);
  const std::vector<Status> all = {
      outputs.file("-o", path("theirs/f")), outputs.folder("-o", path("theirs")),
      outputs.folder("-o", path("theirs/new/newer")),
      Outputs(context_, {}, /*json=*/false).working_folder("-o", path("theirs"))};
  ASSERT_TRUE(!is_root || ::seteuid(0) == 0);
  for (const Status& refused : all) {
    EXPECT_FAILS(refused, ErrorCode::permission);
    EXPECT_EQ(refused.error().where, path("theirs"));
  }
}

TEST_F(OutputWriting, StandardOutputTakesNoFolder) {
  Outputs outputs(context_, {}, /*json=*/false);
  EXPECT_FAILS(outputs.folder("-o", "-"), ErrorCode::usage);
  EXPECT_FAILS(outputs.working_folder("-o", "-"), ErrorCode::usage);
}

TEST_F(OutputWriting, AFolderThatIsGoneOnWithMayHoldFiles) {
  std::filesystem::create_directories(path("repaired"));
  write("repaired/day1.gt3x", "done");
  Outputs outputs(context_, {}, /*json=*/false);
  ASSERT_OK(outputs.working_folder("-o", path("repaired")));
  Outputs again(context_, {}, /*json=*/false);
  EXPECT_FAILS(again.folder("-o", path("repaired")), ErrorCode::cannot_create);
  EXPECT_FAILS(again.working_folder("-o", path("repaired/day1.gt3x")), ErrorCode::cannot_create);
}

TEST(RefuseOldOutput, NamesTheOptionThatTookItsPlace) {
  CLI::App app;
  refuse_old_output(app, "--scenario", "--scenario-out");
  try {
    app.parse("--scenario x.json", false);
    FAIL() << "taken";
  } catch (const CLI::ParseError& error) {
    EXPECT_NE(std::string(error.what()).find("--scenario-out"), std::string::npos);
  }
  EXPECT_EQ(app.help().find("--scenario"), std::string::npos);
}

}  // namespace
}  // namespace sixpoint::cli
