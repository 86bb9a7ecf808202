// Every option of every command is an input, an output or neither; every output obeys the rule of
// cli/output.h. The list is the command line's own: a new option fails this test until it is
// classified here.
#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <set>
#include <thread>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include "cli/command_fixture.h"
#include "expect_result.h"

namespace sixpoint::cli {
namespace {

using tests::Answer;

enum class Role {
  no_path,
  input,
  store,           // read, or added to by the database itself
  output,          // a file; through a device or a pipe too
  output_to_keep,  // a file that is read again: no device, no pipe
  folder,          // a new one
  working_folder,  // one that is gone on with
  refused,         // an old name of an output
};

// Options that mean the same in every command that has them.
const std::map<std::string, Role>& common_roles() {
  static const std::map<std::string, Role> kRoles = [] {
    std::map<std::string, Role> roles = {{"--store", Role::store},
                                         {"--limits", Role::input},
                                         {"--calibration-file", Role::input},
                                         {"--faults", Role::input},
                                         {"--files", Role::input},
                                         {"--token-file", Role::input},
                                         {"--pin-file", Role::input},
                                         {"--tls-cert", Role::input},
                                         {"--tls-key", Role::input},
                                         {"--state", Role::working_folder},
                                         {"--record", Role::output_to_keep},
                                         {"--certificate", Role::output},
                                         {"--label", Role::output},
                                         {"--html", Role::output},
                                         {"--png", Role::output},
                                         {"--pdf", Role::output},
                                         {"--csv", Role::output},
                                         {"--truth", Role::output},
                                         {"--scenario-out", Role::output},
                                         {"--constants-out", Role::output},
                                         {"--keep", Role::folder},
                                         {"--export", Role::folder},
                                         {"ANSWERS", Role::input},
                                         {"FOLDER", Role::input},
                                         {"--journal", Role::input},
                                         {"--recording", Role::input},
                                         {"--program", Role::input},
                                         {"FILE", Role::input},
                                         {"path", Role::input},
                                         {"files", Role::input},
                                         {"file", Role::input},
                                         {"plan", Role::input},
                                         {"RECORDING", Role::input},
                                         {"BEFORE", Role::input},
                                         {"BUNDLE", Role::input},
                                         {"INPUT", Role::input},
                                         {"SOURCE", Role::input},
                                         {"SESSION", Role::input},
                                         {"CAPTURE", Role::input},
                                         {"--scenario", Role::input},
                                         {"--constants", Role::input},
                                         {"--population", Role::input}};
    for (const char* name : {"--device",
                             "--jig",
                             "--gravity",
                             "--latitude",
                             "--altitude",
                             "--jobs",
                             "--operator",
                             "--reason",
                             "--station",
                             "--role",
                             "NAME",
                             "--seed",
                             "--rate",
                             "--patience",
                             "--dwell",
                             "--filter",
                             "--jig-id",
                             "--jig-due",
                             "--jig-exception",
                             "--jig-exception-by",
                             "--expect",
                             "--retest-of",
                             "--study",
                             "--side-seconds",
                             "--sides",
                             "--turn-seconds",
                             "--method",
                             "--prior",
                             "--max-lag",
                             "--head",
                             "--days",
                             "--from",
                             "--to",
                             "--by",
                             "--quantity",
                             "--axis",
                             "--tolerance",
                             "--without",
                             "--run",
                             "--trials",
                             "--protocol",
                             "--effects",
                             "--none",
                             "--pairs",
                             "--outside",
                             "--usbip",
                             "--count",
                             "--port",
                             "--printer",
                             "--socket",
                             "--bind",
                             "--token",
                             "--shards",
                             "--shard-bytes",
                             "--at-once",
                             "--shard",
                             "--doing",
                             "--replays",
                             "--bus",
                             "--device-number",
                             "--for",
                             "--help",
                             "SERIAL",
                             "serial",
                             "RUN",
                             "id",
                             "table",
                             "jig",
                             "--time",
                             "--records",
                             "--matters-mg",
                             "--least-units",
                             "--realistic",
                             "--format",
                             "--fill-limit",
                             "--epoch",
                             "--cut",
                             "--link-unaffected",
                             "--sbatch",
                             "--why"}) {
      roles.emplace(name, Role::no_path);
    }
    return roles;
  }();
  return kRoles;
}

// "command option" where it differs from the list above.
const std::map<std::string, Role>& own_roles() {
  static const std::map<std::string, Role> kRoles = {
      {"repair --output", Role::working_folder},
      {"export --output", Role::folder},
      {"scan --units", Role::output},
      {"archive report --output", Role::output},
      {"solve --output", Role::output},
      {"capture --output", Role::output_to_keep},
      {"capture --constants", Role::refused},
      {"certificate --output", Role::output},
      {"store export --output", Role::output},
      {"store backup --output", Role::output_to_keep},
      {"simulate --output", Role::output},
      {"session recover --output", Role::output_to_keep},
      {"session minimise --output", Role::output},
      {"session from-pcap --output", Role::output},
      {"archive plan --output", Role::folder},
      {"archive run --output", Role::working_folder},
      {"archive submit --output", Role::working_folder},
      {"gap diagnose --scenario", Role::refused},
      {"gap challenge --labels", Role::output_to_keep},
      {"gap score --answers", Role::input},
      {"gap score --labels", Role::input},
      {"gap answers --output", Role::output},
      {"gap adopt --output", Role::output},
      {"gap report --output", Role::output},
      {"gap trends --lots", Role::input},
  };
  return kRoles;
}

std::string long_name(const CLI::Option& option) {
  return option.get_lnames().empty() ? option.get_name() : "--" + option.get_lnames().front();
}

// Calls `visit("command option", role)` for every option that takes a value.
void for_each_option(const std::function<void(const std::string&, std::optional<Role>)>& visit) {
  std::ostringstream stream;
  std::istringstream in;
  Context context{posix_env(), stream, stream, in};
  CLI::App app;
  declare_commands(app, context);
  const std::function<void(const CLI::App&, const std::string&)> walk =
      [&](const CLI::App& command, const std::string& name) {
        for (const CLI::Option* option : command.get_options()) {
          if (option->get_items_expected_max() == 0) {
            continue;  // a flag takes no value
          }
          const std::string key = long_name(*option);
          const auto own = own_roles().find(name + " " + key);
          const auto common = common_roles().find(key);
          std::optional<Role> role;
          if (own != own_roles().end()) {
            role = own->second;
          } else if (common != common_roles().end()) {
            role = common->second;
          }
          visit(name + " " + key, role);
        }
        for (const CLI::App* sub : command.get_subcommands([](const CLI::App*) { return true; })) {
          walk(*sub, name.empty() ? sub->get_name() : name + " " + sub->get_name());
        }
      };
  walk(app, "");
}

TEST(OptionList, EveryOptionIsClassified) {
  std::size_t seen = 0;
  std::set<std::string> own;
  for_each_option([&](const std::string& name, std::optional<Role> role) {
    ++seen;
    EXPECT_TRUE(role) << name << ": say in this test whether it names an input or an output";
    if (own_roles().contains(name)) {
      own.insert(name);
    }
  });
  EXPECT_GT(seen, 150U);
  EXPECT_EQ(own.size(), own_roles().size()) << "an option of this test is no option any more";
}

// A command that would write `output` through each of the options; everything else is as it has to
// be.
class EveryOutput : public tests::CommandTest {
 protected:
  void SetUp() override {
    write("s.json",
          R"({"seed": 3, "motions": [{"kind": "still", "duration_s": 30, "pose": "+z"}]})");
    write("b.json", R"({"schema": "sixpoint/scenario/1", "seed": 3, "protocol": "production"})");
    must({"simulate", "--scenario", path("s.json"), "-o", path("rec.gt3x")}, 0);
    must({"simulate", "--scenario", path("b.json"), "-o", path("bundle")}, 0);
    const Answer jig =
        must({"jig", "--device", tests::kUnitInJig, "--store", path("s.db"), "--station", "A",
              "--write", "--record", path("session.zip"), "--json"},
             0);
    run_ = jig.json().value("run", "");
    ASSERT_FALSE(run_.empty());
    std::filesystem::create_directory(path("archive"));
    std::filesystem::copy_file(path("rec.gt3x"), path("archive/rec.gt3x"));
    must({"archive", "plan", path("archive"), "-o", path("plan"), "--scan"}, 0);
    must({"gap", "challenge", "--export", path("bundles"), "--trials", "1", "--protocol",
          "production"},
         0);
    // A recording that was killed leaves its journal.
    write("cut.zip.journal", R"({"schema":"sixpoint/session-journal/1"})");
  }

  Answer must(const std::vector<std::string>& arguments, int exit_code) {
    Answer answer = run(arguments);
    EXPECT_EQ(answer.exit_code, exit_code) << arguments[0] << ": " << answer.people;
    return answer;
  }
  void write(const std::string& name, std::string_view text) const {
    std::ofstream(path(name), std::ios::binary) << text;
  }

  // The arguments before the output's name; --store names a store that does not matter.
  std::map<std::string, std::vector<std::string>> recipes() const {
    const std::vector<std::string> jig = {
        "jig", "--device", tests::kUnitInJig, "--store", path("j.db"), "--station", "A", "--write"};
    const std::vector<std::string> capture = {
        "capture", "--device", tests::kUnitInJig, "--store", path("c.db"), "--side-seconds", "5"};
    const std::vector<std::string> diagnose = {"gap", "diagnose", path("bundle")};
    const std::vector<std::string> challenge = {"gap",       "challenge",     "--trials",
                                                "1",         "--protocol",    "production",
                                                "--program", SIXPOINT_PROGRAM};
    const std::vector<std::string> simulate = {"simulate", "--scenario", path("s.json")};
    const std::vector<std::string> certificate = {"certificate", run_, "--store", path("s.db")};
    std::map<std::string, std::vector<std::string>> all = {
        {"export --csv", {"export", path("rec.gt3x")}},
        {"export --output", {"export", path("rec.gt3x")}},
        {"compare --html", {"compare", path("rec.gt3x"), path("archive/rec.gt3x")}},
        {"impact --csv", {"impact", path("rec.gt3x")}},
        {"impact --html", {"impact", path("rec.gt3x")}},
        {"solve --output", {"solve", path("rec.gt3x")}},
        {"repair --output", {"repair", path("archive"), "--scan"}},
        {"check-unit chart --html", {"check-unit", "chart", "--store", path("s.db")}},
        {"statistics --html", {"statistics", "--store", path("s.db")}},
        {"store export --output", {"store", "export", "--store", path("s.db")}},
        {"store backup --output", {"store", "backup", "--store", path("s.db")}},
        {"session recover --output", {"session", "recover", path("cut.zip")}},
        {"session minimise --output",
         {"session", "minimise", path("session.zip"), "--doing", "identify", "--replays", "1"}},
        {"session from-pcap --output", {"session", "from-pcap", path("s.json")}},
        {"archive plan --output", {"archive", "plan", path("archive"), "--scan"}},
        {"gap adopt --output", {"gap", "adopt", path("bundle")}},
        {"gap report --output", {"gap", "report", path("bundle"), "--scenario", path("b.json")}},
        {"station --state", {"station", "--port", "0", "--device", "virtual:seed=7"}},
        {"archive run --output", {"archive", "run", path("plan"), "--shard", "0"}},
        {"archive submit --output", {"archive", "submit", path("plan"), "--dry-run"}},
        {"archive report --output", {"archive", "report", path("plan")}},
        {"scan --units", {"scan", path("archive")}},
        {"gap challenge --export",
         {"gap", "challenge", "--trials", "1", "--protocol", "production"}},
        {"gap challenge --labels",
         {"gap", "challenge", "--trials", "1", "--protocol", "production", "--export",
          path("exported")}},
        {"gap answers --output", {"gap", "answers", path("bundles"), "--method", "sequential"}},
    };
    for (const char* option : {"--certificate", "--label", "--record", "--state"}) {
      all.emplace(std::string("jig ") + option, jig);
    }
    for (const char* option : {"--output", "--constants-out", "--record"}) {
      all.emplace(std::string("capture ") + option, capture);
    }
    for (const char* option : {"--html", "--png", "--pdf", "--scenario-out"}) {
      all.emplace(std::string("gap diagnose ") + option, diagnose);
    }
    for (const char* option : {"--html", "--keep"}) {
      all.emplace(std::string("gap challenge ") + option, challenge);
    }
    for (const char* option : {"--output", "--truth"}) {
      all.emplace(std::string("simulate ") + option, simulate);
    }
    for (const char* option : {"--output", "--label"}) {
      all.emplace(std::string("certificate ") + option, certificate);
    }
    for (const char* option : {"simulate --truth", "capture --constants-out", "capture --record"}) {
      all.at(option).insert(all.at(option).end(), {"-o", path("t.gt3x")});
    }
    return all;
  }

  // Runs the command of `name` with its output in `target`. Whatever stands in the way of another
  // run is removed.
  Answer write_to(const std::string& name, const std::string& target, bool force) {
    std::error_code ignored;
    std::filesystem::remove(path("t.gt3x"), ignored);
    std::vector<std::string> arguments = recipes().at(name);
    arguments.insert(arguments.end(), {name.substr(name.rfind(' ') + 1), target});
    if (force) {
      arguments.emplace_back("--force");
    }
    return run(arguments);
  }

  std::string run_;
};

// A certificate's name ends in .pdf or .json, whatever lies there.
std::string ending_for(const std::string& option) {
  return option == "jig --certificate" || option == "certificate --output" ? ".json" : "";
}

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// All that lies below: names and bytes.
std::map<std::string, std::string> everything_in(const std::filesystem::path& path) {
  std::map<std::string, std::string> all;
  if (std::filesystem::is_directory(path)) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path)) {
      all[entry.path()] = entry.is_regular_file() ? bytes_of(entry.path()) : "";
    }
  } else {
    all[path] = bytes_of(path);
  }
  return all;
}

bool has_force(const std::string& option) {
  return option != "repair --output" && option != "archive run --output" &&
         option != "archive submit --output" && option != "station --state";
}

TEST_F(EveryOutput, NothingThatHoldsMeasurementsIsWrittenOver) {
  std::size_t tried = 0;
  for_each_option([&](const std::string& option, std::optional<Role> role) {
    if (!role || *role < Role::output || *role == Role::refused) {
      return;
    }
    ASSERT_TRUE(recipes().contains(option)) << option << ": say in this test how it is run";
    ++tried;
    for (const std::string kind :
         {"recording", "store", "session", "bundle", "folder", "link", "journal"}) {
      const bool folder_is_fine = *role == Role::working_folder && kind == "folder";
      for (const bool force : {false, true}) {
        if (folder_is_fine || (force && !has_force(option))) {
          continue;
        }
        SCOPED_TRACE(option + (force ? " --force on a " : " on a ") + kind);
        const std::string target = path("target" + ending_for(option));
        const std::string behind = kind == "link" ? path("behind") : target;
        const std::map<std::string, std::string> sources = {
            {"recording", "rec.gt3x"},     {"store", "s.db"},     {"session", "session.zip"},
            {"bundle", "bundle"},          {"folder", "archive"}, {"link", "rec.gt3x"},
            {"journal", "cut.zip.journal"}};
        std::filesystem::copy(path(sources.at(kind)), behind,
                              std::filesystem::copy_options::recursive);
        if (kind == "link") {
          std::filesystem::create_symlink(behind, target);
        }
        const auto before = everything_in(behind);
        // --force uses a folder that is not empty; what it holds stays.
        const bool used = force && *role == Role::folder && kind == "folder";
        const Answer answer = write_to(option, target, force);
        if (!used) {
          EXPECT_EQ(answer.exit_code, 73) << answer.people;
          EXPECT_EQ(everything_in(behind), before);
        }
        for (const auto& [name, bytes] : before) {
          EXPECT_EQ(std::filesystem::is_directory(name) ? "" : bytes_of(name), bytes) << name;
        }
        EXPECT_EQ(std::filesystem::is_symlink(target), kind == "link");
        std::filesystem::remove_all(target);
        std::filesystem::remove_all(behind);
      }
    }
  });
  EXPECT_GE(tried, 28U);
}

TEST_F(EveryOutput, AFileOfUnknownOriginIsReplacedWithForceAlone) {
  for_each_option([&](const std::string& option, std::optional<Role> role) {
    if (!role || *role < Role::output || *role >= Role::folder) {
      return;
    }
    SCOPED_TRACE(option);
    const std::string target = path("target" + ending_for(option));
    std::ofstream(target) << "of another program";
    const Answer answer = write_to(option, target, false);
    EXPECT_EQ(answer.exit_code, 73) << answer.people;
    EXPECT_NE(answer.people.find("--force"), std::string::npos) << answer.people;
    EXPECT_EQ(bytes_of(target), "of another program");
    std::filesystem::remove(target);
  });
}

// A pipe that is read until the object ends; what came is thrown away.
class ReadPipe {
 public:
  explicit ReadPipe(const std::string& path)
      : fd_(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)), thread_([this] { read(); }) {}
  ReadPipe(const ReadPipe&) = delete;
  ReadPipe& operator=(const ReadPipe&) = delete;
  ~ReadPipe() {
    ends_ = true;
    thread_.join();
    ::close(fd_);
  }
  std::size_t bytes() const { return bytes_; }

 private:
  void read() {
    std::array<char, 4096> piece{};
    while (!ends_) {
      const ssize_t count = ::read(fd_, piece.data(), piece.size());
      if (count > 0) {
        bytes_ += static_cast<std::size_t>(count);
      } else {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    }
    ssize_t count = 0;
    while ((count = ::read(fd_, piece.data(), piece.size())) > 0) {
      bytes_ += static_cast<std::size_t>(count);
    }
  }
  int fd_;
  std::atomic<bool> ends_ = false;
  std::atomic<std::size_t> bytes_ = 0;
  std::thread thread_;
};

// /dev/full under a name of the test's own where the system lets it; the real one else.
std::string full_device(const std::string& path) {
  constexpr unsigned kMajor = 1;
  constexpr unsigned kFullMinor = 7;
  return ::mknod(path.c_str(), S_IFCHR | 0666, makedev(kMajor, kFullMinor)) == 0 &&
                 ::access(path.c_str(), W_OK) == 0
             ? path
             : "/dev/full";
}

TEST_F(EveryOutput, DevicesAndPipesStayWhatTheyAre) {
  for_each_option([&](const std::string& option, std::optional<Role> role) {
    if (!role || *role < Role::output || *role == Role::refused ||
        option == "gap challenge --html") {
      return;
    }
    for (const bool force : {false, true}) {
      if (force && !has_force(option)) {
        continue;
      }
      SCOPED_TRACE(option + (force ? " --force" : ""));
      const std::string device = full_device(path("device" + ending_for(option)));
      const Answer to_device = ending_for(option).empty() || device != "/dev/full"
                                   ? write_to(option, device, force)
                                   : Answer{73, "", ""};
      EXPECT_TRUE(std::filesystem::is_character_file(device));
      EXPECT_NE(to_device.exit_code, 0) << "a full device takes nothing";
      if (*role != Role::output) {
        EXPECT_EQ(to_device.exit_code, 73) << to_device.people;
      }
      if (device != "/dev/full") {
        std::filesystem::remove(device);
      }
      const std::string pipe = path("pipe" + ending_for(option));
      ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
      {
        ReadPipe reader(pipe);
        const Answer to_pipe = write_to(option, pipe, force);
        if (*role != Role::output) {
          EXPECT_EQ(to_pipe.exit_code, 73) << to_pipe.people;
        }
      }
      EXPECT_TRUE(std::filesystem::is_fifo(pipe));
      std::filesystem::remove(pipe);
    }
  });
}

TEST_F(EveryOutput, TheOldNamesOfOutputsAreRefusedWithTheNewOnes) {
  const Answer diagnosis = run({"gap", "diagnose", path("bundle"), "--scenario", path("s.json")});
  EXPECT_EQ(diagnosis.exit_code, 64);
  EXPECT_NE(diagnosis.people.find("--scenario-out"), std::string::npos) << diagnosis.people;
  const Answer capture =
      run({"capture", "--device", tests::kUnitInJig, "--constants", path("c.json")});
  EXPECT_EQ(capture.exit_code, 64);
  EXPECT_NE(capture.people.find("--constants-out"), std::string::npos) << capture.people;
  EXPECT_FALSE(std::filesystem::exists(path("c.json")));
}

}  // namespace
}  // namespace sixpoint::cli
