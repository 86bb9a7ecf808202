// sixpoint repair and scan by their contract, on the real disk.
#include <csignal>
#include <filesystem>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/random.h"
#include "cli/command_fixture.h"
#include "db/store.h"
#include "expect_result.h"
#include "repair/jig_constants.h"
#include "repair/made_agd.h"
#include "repair/made_recording.h"
#include "sanitized.h"
#include "shared_data.h"

namespace sixpoint::cli {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::UnorderedElementsAre;
using tests::kConstants;
using tests::MadeRecording;

// At rest in many directions.
MadeRecording half_hour() {
  MadeRecording made;
  Random random(5);
  for (int pose = 0; pose < 60; ++pose) {
    PerAxis<double> up = {random.normal(), random.normal(), random.normal()};
    const double length = std::sqrt(up[0] * up[0] + up[1] * up[1] + up[2] * up[2]);
    for (int i = 0; i < 900; ++i) {
      PerAxis<int> raw{};
      const PerAxis<double> sensitivity = {0.0042, 0.004, 0.0041};
      const PerAxis<double> zero = {90.5, 50.25, 88};
      for (std::size_t a = 0; a < kAxes; ++a) {
        raw[a] = static_cast<int>(
            std::lround((up[a] / length + 0.004 * random.normal()) / sensitivity[a] + zero[a]));
      }
      made.raw.push_back(raw);
    }
  }
  return made;
}

class RepairCommand : public tests::CommandTest {
 protected:
  RepairCommand() {
    std::filesystem::create_directories(archive_ + "/sub");
    MadeRecording affected = half_hour();
    EXPECT_OK(affected.write(files_, archive_ + "/affected.gt3x"));
    MadeRecording sound = affected;
    sound.firmware = "1.8.0";
    EXPECT_OK(sound.write(files_, archive_ + "/sub/sound.gt3x"));
    std::ofstream(folder_ / "constants.json") << kConstants;
  }

  std::string archive_ = folder_ / "archive";
  std::string out_ = folder_ / "out";
  FileSystem& files_ = posix_env().files;
};

TEST_F(RepairCommand, ScanSaysWhichFilesAreAffected) {
  std::ofstream(archive_ + "/broken.gt3x") << "this is no zip";
  const auto answer = run({"scan", archive_, "--json"});
  EXPECT_EQ(answer.exit_code, 65) << "the worst counts: unreadable";
  const Json json = answer.json();
  EXPECT_EQ(json["schema"], "sixpoint/scan/1");
  ASSERT_EQ(json["files"].size(), 3U);
  EXPECT_EQ(json["files"][0]["verdict"], "affected");
  EXPECT_EQ(json["files"][0]["serial"], "MOS2A45130450");
  EXPECT_EQ(json["files"][0]["firmware"], "1.5.0");
  EXPECT_EQ(json["files"][0]["calibration_time"], "2013-11-12T14:32:13Z");
  EXPECT_GT(json["files"][0]["evidence_mg"].get<double>(), 64);
  EXPECT_EQ(json["files"][1]["verdict"], "unreadable");
  EXPECT_FALSE(json["files"][1]["reasons"].empty());
  EXPECT_EQ(json["files"][2]["verdict"], "not_affected");
  EXPECT_EQ(json["summary"]["affected"], 1);
  EXPECT_EQ(run({"scan", archive_ + "/affected.gt3x"}).exit_code, 1);
  EXPECT_EQ(run({"scan", archive_ + "/sub"}).exit_code, 0);
  EXPECT_EQ(run({"scan", folder_ / "none"}).exit_code, 66);
  EXPECT_EQ(run({"scan"}).exit_code, 64);
}

TEST_F(RepairCommand, RepairsATreeOnce) {
  const auto answer =
      run({"repair", archive_, "-o", out_, "--constants", folder_ / "constants.json", "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  const Json json = answer.json();
  ASSERT_EQ(json["files"].size(), 2U);
  const Json& repaired = json["files"][0];
  EXPECT_EQ(repaired["status"], "repaired");
  EXPECT_EQ(repaired["output"], out_ + "/affected.gt3x");
  EXPECT_EQ(repaired["method"], "constants");
  EXPECT_GT(repaired["still_error_mg"]["before"].get<double>(), 100);
  EXPECT_LT(repaired["still_error_mg"]["after"].get<double>(), 2);
  EXPECT_EQ(repaired["samples"], 54'000);
  EXPECT_EQ(repaired["output_sha256"].get<std::string>().size(), 64U);
  EXPECT_EQ(json["files"][1]["status"], "not_affected");
  EXPECT_FALSE(std::filesystem::exists(out_ + "/sub/sound.gt3x"));

  const Json again = run({"repair", out_, "-o", folder_ / "twice", "--constants",
                          folder_ / "constants.json", "--json"})
                         .json();
  EXPECT_EQ(again["files"][0]["status"], "already_repaired");
  const auto in_the_way =
      run({"repair", archive_, "-o", out_, "--constants", folder_ / "constants.json"});
  EXPECT_EQ(in_the_way.exit_code, 73);
  EXPECT_EQ(
      run({"repair", archive_, "-o", out_, "--constants", folder_ / "constants.json", "--resume"})
          .exit_code,
      0);
  EXPECT_EQ(run({"scan", out_}).exit_code, 0) << "a repaired file is not affected any more";
}

TEST_F(RepairCommand, OutputsInTheTreeAreNoInputs) {
  for (int i = 0; i < 2; ++i) {
    const auto answer = run({"repair", archive_, "-o", archive_ + "/out", "--constants",
                             folder_ / "constants.json", "--resume", "--json"});
    EXPECT_EQ(answer.exit_code, 0) << answer.people;
    EXPECT_EQ(answer.json()["files"].size(), 2U);
  }
  EXPECT_FALSE(std::filesystem::exists(archive_ + "/out/out"));
  // The other way round: inputs that lie in the output folder.
  std::filesystem::create_directories(archive_ + "/raw");
  std::filesystem::rename(archive_ + "/affected.gt3x", archive_ + "/raw/affected.gt3x");
  const auto beside = run({"repair", archive_ + "/raw", "-o", archive_, "--constants",
                           folder_ / "constants.json", "--json"});
  EXPECT_EQ(beside.exit_code, 0) << beside.people;
  EXPECT_EQ(beside.json()["files"].size(), 1U);
}

TEST_F(RepairCommand, ScanOfTheFileItselfIsTheLastResort) {
  const Json json = run({"repair", archive_, "-o", out_, "--scan", "--json"}).json();
  EXPECT_EQ(json["files"][0]["status"], "repaired") << json.dump(1);
  EXPECT_EQ(json["files"][0]["method"], "scan");
  EXPECT_LT(json["files"][0]["still_error_mg"]["after"].get<double>(), 2);
}

TEST_F(RepairCommand, SaysWhatIsMissing) {
  MadeRecording made = half_hour();
  made.raw.resize(900);  // one pose
  ASSERT_OK(made.write(files_, folder_ / "one.gt3x"));
  const auto answer = run({"repair", folder_ / "one.gt3x", "-o", out_, "--scan", "--json"});
  EXPECT_EQ(answer.exit_code, 1);
  const Json file = answer.json()["files"][0];
  EXPECT_EQ(file["status"], "not_repairable");
  EXPECT_THAT(file["reasons"].dump(), HasSubstr("sides"));
  EXPECT_FALSE(std::filesystem::exists(out_ + "/one.gt3x"));
}

TEST_F(RepairCommand, CalibrationFileOfTheSameUnitUnderCurrentOnly) {
  MadeRecording one = half_hour();
  one.raw.resize(900);
  ASSERT_OK(one.write(files_, folder_ / "one.gt3x"));
  const auto repair = [&](const std::string& calibration_file, const std::string& out) {
    return run({"repair", folder_ / "one.gt3x", "-o", folder_ / out, "--calibration-file",
                calibration_file, "--json"})
        .json()["files"][0];
  };
  const Json good = repair(archive_ + "/affected.gt3x", "good");
  EXPECT_EQ(good["status"], "repaired") << good.dump(1);
  EXPECT_EQ(good["method"], "calibration_file");
  const Json legacy = repair(archive_ + "/sub/sound.gt3x", "legacy");
  EXPECT_EQ(legacy["status"], "not_repairable");
  EXPECT_THAT(legacy["reasons"].dump(), HasSubstr("legacy"));
  MadeRecording other = half_hour();
  other.serial = "MOS2A45130451";
  ASSERT_OK(other.write(files_, folder_ / "other.gt3x"));
  const Json stranger = repair(folder_ / "other.gt3x", "stranger");
  EXPECT_EQ(stranger["status"], "not_repairable");
  EXPECT_THAT(stranger["reasons"].dump(), HasSubstr("MOS2A45130451"));
}

TEST_F(RepairCommand, ACalibrationFileThatIsNoRecordingIsRefusedBeforeTheWork) {
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"repair"}, std::vector<std::string>{"archive", "plan"}}) {
    std::vector<std::string> words = command;
    words.insert(words.end(),
                 {archive_, "-o", out_, "--calibration-file", folder_ / "constants.json"});
    const auto answer = run(words);
    EXPECT_EQ(answer.exit_code, 65) << command.front();
    EXPECT_THAT(answer.people, HasSubstr("constants in JSON are given by --constants"));
    EXPECT_FALSE(std::filesystem::exists(out_)) << command.front();
  }
}

// A tree as disks hold them: links in circles and into nothing, a FIFO, a device.
TEST_F(RepairCommand, UnusualFilesGetTheirLinesAndTheRestIsRepaired) {
  std::filesystem::create_symlink("..", archive_ + "/sub/up");
  std::filesystem::create_symlink(".", archive_ + "/sub/here");
  std::filesystem::create_symlink("nowhere", archive_ + "/dangling.gt3x");
  std::filesystem::create_symlink("/dev/zero", archive_ + "/endless.gt3x");
  ASSERT_EQ(::mkfifo((archive_ + "/fifo.gt3x").c_str(), 0600), 0);
  const auto scanned = run({"scan", archive_, "--json"});
  EXPECT_EQ(scanned.exit_code, 66);
  EXPECT_EQ(scanned.json()["files"].size(), 5U) << "no file by two names: " << scanned.out;
  EXPECT_EQ(scanned.json()["summary"]["unreadable"], 3);
  const auto repaired =
      run({"repair", archive_, "-o", out_, "--constants", folder_ / "constants.json", "--json"});
  EXPECT_EQ(repaired.exit_code, 66);
  EXPECT_EQ(repaired.json()["summary"]["repaired"], 1);
  EXPECT_EQ(repaired.json()["summary"]["not_affected"], 1);
  EXPECT_EQ(repaired.json()["summary"]["failed"], 3);
}

TEST_F(RepairCommand, SalvageOfAFileThatIsCutShort) {
  const std::string path = archive_ + "/affected.gt3x";
  std::filesystem::resize_file(path, std::filesystem::file_size(path) * 3 / 4);
  const std::vector<std::string> line = {"repair", path,          "-o",
                                         out_,     "--constants", folder_ / "constants.json"};
  const auto refused = run(line);
  EXPECT_EQ(refused.exit_code, 65);
  EXPECT_THAT(refused.out + refused.people, HasSubstr("--salvage"));
  // info.txt stands behind the log and is lost: without a serial number nothing is decided.
  std::vector<std::string> salvage = line;
  salvage.emplace_back("--salvage");
  salvage.emplace_back("--json");
  const auto undecided = run(salvage);
  EXPECT_EQ(undecided.exit_code, 1) << undecided.people;
  const Json file = undecided.json()["files"][0];
  EXPECT_EQ(file["status"], "not_repairable");
  EXPECT_EQ(file["method"], "salvage");
  EXPECT_EQ(file["losses"][0]["kind"], "missing");
  const auto whole = run({"inspect", out_ + "/affected.gt3x", "--json"});
  EXPECT_EQ(whole.exit_code, 0) << whole.people;
  EXPECT_EQ(whole.json()["already_repaired"], false);
  const auto seen = run({"inspect", path, "--salvage", "--json"});
  EXPECT_EQ(seen.exit_code, 0) << seen.people;
  EXPECT_GT(seen.json()["samples"], 30'000);
  EXPECT_EQ(seen.json()["losses"], file["losses"]);
  EXPECT_EQ(seen.json()["serial"], "");
  const auto exported = run({"export", path, "--salvage", "--csv", folder_ / "out.csv"});
  EXPECT_EQ(exported.exit_code, 0) << exported.people;
  EXPECT_THAT(exported.people, HasSubstr("missing: log.bin"));
  EXPECT_EQ(run({"export", path, "--csv", folder_ / "none.csv"}).exit_code, 65);
}

TEST_F(RepairCommand, DryRunWritesNothing) {
  const auto answer = run({"repair", archive_, "-o", out_, "--constants",
                           folder_ / "constants.json", "--dry-run", "--json"});
  EXPECT_EQ(answer.exit_code, 0);
  EXPECT_EQ(answer.json()["files"][0]["status"], "repaired");
  EXPECT_FALSE(std::filesystem::exists(out_));
}

TEST_F(RepairCommand, WhatWasMadeOtherwiseIsOutdatedAndReplacedWhenAsked) {
  const auto repair = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {"repair", archive_ + "/affected.gt3x", "-o", out_, "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  };
  const std::string constants = folder_ / "constants.json";
  ASSERT_EQ(repair({"--constants", constants}).exit_code, 0);
  const Bytes first = read_file(files_, out_ + "/affected.gt3x").value();
  const auto outdated = repair({"--scan", "--resume"});
  EXPECT_EQ(outdated.exit_code, 1);
  EXPECT_EQ(outdated.json()["files"][0]["status"], "outdated");
  EXPECT_EQ(outdated.json()["summary"]["outdated"], 1);
  EXPECT_EQ(repair({"--constants", constants, "--wide", "--resume"}).exit_code, 1);
  EXPECT_EQ(repair({"--constants", constants, "--resume"}).exit_code, 0);
  EXPECT_EQ(read_file(files_, out_ + "/affected.gt3x").value(), first) << "nothing was touched";
  const auto redone = repair({"--scan", "--redo-outdated"});
  EXPECT_EQ(redone.exit_code, 0) << redone.out;
  EXPECT_EQ(redone.json()["files"][0]["method"], "scan");
  EXPECT_NE(read_file(files_, out_ + "/affected.gt3x").value(), first);
  EXPECT_EQ(repair({"--scan", "--resume"}).exit_code, 0);
}

// A changed output is refused in each later run: what the manifest knows of it stays there.
TEST_F(RepairCommand, AHashThatTheManifestKnowsIsNotReplaced) {
  const auto repair = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {"repair", archive_, "-o", out_, "--scan"};
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  };
  ASSERT_EQ(repair({}).exit_code, 0);
  const auto hash = [&] {
    const Json files = Json::parse(std::ifstream(out_ + "/manifest.json"))["files"];
    return files[0]["output_sha256"].get<std::string>();
  };
  const std::string first = hash();
  ASSERT_EQ(repair({"--resume"}).exit_code, 0);
  EXPECT_EQ(hash(), first);
  const std::string output = out_ + "/affected.gt3x";
  std::ofstream(output, std::ios::app | std::ios::binary) << "x";
  for (const bool dry : {true, false, false}) {
    const auto again = repair(dry ? std::vector<std::string>{"--resume", "--dry-run"}
                                  : std::vector<std::string>{"--resume"});
    EXPECT_EQ(again.exit_code, 73) << dry;
    EXPECT_THAT(again.people + again.out, HasSubstr("not as that run wrote it"));
    EXPECT_EQ(hash(), first);
  }
  std::filesystem::remove(output);
  EXPECT_EQ(repair({"--resume"}).exit_code, 0) << "it was removed, and is made again";
}

// The input was replaced after its output was made: that it failed stands in the manifest, and what
// is advised is no command that refuses the pair.
TEST_F(RepairCommand, WhatFailedStandsInTheManifestAndInTheNextStep) {
  const auto repair = [&](const char* resume) {
    return run({"repair", archive_, "-o", out_, "--constants", folder_ / "constants.json", resume});
  };
  const auto first = repair("--wide");
  EXPECT_THAT(first.people, HasSubstr("sixpoint impact"));
  MadeRecording other = half_hour();
  other.start += 3600;
  ASSERT_OK(other.write(files_, archive_ + "/affected.gt3x"));
  const auto again = repair("--resume");
  EXPECT_EQ(again.exit_code, 73);
  EXPECT_THAT(again.people, testing::Not(HasSubstr("sixpoint impact")));
  EXPECT_THAT(again.people, HasSubstr("1 of the files failed; do what their lines say"));
  EXPECT_THAT(again.people, HasSubstr("sixpoint repair " + archive_ + " -o " + out_));
  const Json files = Json::parse(std::ifstream(out_ + "/manifest.json"))["files"];
  ASSERT_EQ(files.size(), 3U);
  EXPECT_EQ(files[0]["status"], "repaired") << "the output of the file that was there before";
  EXPECT_EQ(files[1]["input"], archive_ + "/affected.gt3x");
  EXPECT_EQ(files[1]["status"], "failed");
  EXPECT_TRUE(files[1]["output"].is_null());
}

// Of a name that is relative only the folder in which it was typed says which file it is.
TEST_F(RepairCommand, TheManifestKnowsAFileByWhateverPathItIsNamed) {
  const auto before = std::filesystem::current_path();
  const auto repair = [&](const std::string& in, const std::string& path) {
    std::filesystem::current_path(in);
    const auto answer = run(
        {"repair", path, "-o", "../out", "--constants", folder_ / "constants.json", "--resume"});
    std::filesystem::current_path(before);
    EXPECT_EQ(answer.exit_code, 0) << answer.people;
    std::vector<std::string> lines;
    const Json manifest = Json::parse(std::ifstream(out_ + "/manifest.json"));
    for (const Json& file : manifest["files"]) {
      lines.push_back(file["input"].get<std::string>() + " " + file["status"].get<std::string>());
    }
    return lines;
  };
  const std::string affected = archive_ + "/affected.gt3x repaired";
  const std::string sound = archive_ + "/sub/sound.gt3x not_affected";
  std::filesystem::create_directories(folder_ / "other/sub");
  EXPECT_THAT(repair(folder_ / "other", "../archive"), ElementsAre(affected, sound));
  EXPECT_THAT(repair(folder_ / "other", archive_), ElementsAre(affected, sound));
  EXPECT_THAT(repair(archive_, "."), ElementsAre(affected, sound));
  // Another file of the same name in another folder.
  MadeRecording other = half_hour();
  other.firmware = "1.8.0";
  ASSERT_OK(other.write(files_, folder_ / "other/affected.gt3x"));
  EXPECT_THAT(repair(folder_ / "other", "."),
              ElementsAre(affected, sound, folder_ / "other/affected.gt3x not_affected"));
}

TEST_F(RepairCommand, OnePathIsOneFileHoweverItIsNamed) {
  const auto answer = run({"repair", archive_, archive_ + "/sub", archive_ + "/../archive",
                           archive_ + "/none.gt3x", archive_ + "/./none.gt3x", "-o", out_,
                           "--constants", folder_ / "constants.json", "--json"});
  EXPECT_EQ(answer.exit_code, 66) << answer.people;
  EXPECT_EQ(answer.json()["files"].size(), 3U) << "one of them is not there";
}

TEST_F(RepairCommand, TheFolderOfTheRecordingsIsNoOutputFolder) {
  const Bytes before = read_file(files_, archive_ + "/affected.gt3x").value();
  for (const char* more : {"--resume", "--redo-outdated", "--wide"}) {
    const auto answer = run({"repair", archive_, "-o", archive_ + "/.", "--constants",
                             folder_ / "constants.json", more});
    EXPECT_EQ(answer.exit_code, 64);
    EXPECT_THAT(answer.people, HasSubstr("the folder of the recordings"));
    EXPECT_THAT(answer.out + answer.people, testing::Not(HasSubstr("remove")));
  }
  EXPECT_FALSE(std::filesystem::exists(archive_ + "/manifest.csv"));
  const auto one = run({"repair", archive_ + "/affected.gt3x", "-o", archive_, "--constants",
                        folder_ / "constants.json"});
  EXPECT_EQ(one.exit_code, 64);
  EXPECT_THAT(one.people, HasSubstr("the folder of the recordings"));
  EXPECT_EQ(read_file(files_, archive_ + "/affected.gt3x").value(), before);
  EXPECT_THAT(files_.list(archive_).value(), UnorderedElementsAre("affected.gt3x", "sub"));
}

// By the table of next_run(), each with a run of the command that is advised.
TEST_F(RepairCommand, NoCommandIsAdvisedThatCanOnlyFailAgain) {
  const std::string constants = folder_ / "constants.json";
  const std::string other = folder_ / "other";
  std::filesystem::create_directories(other);
  std::filesystem::copy(archive_ + "/affected.gt3x", other);
  const auto twice = run({"repair", archive_, other, "-o", out_, "--constants", constants});
  EXPECT_EQ(twice.exit_code, 73);
  EXPECT_THAT(twice.out, HasSubstr("repair the two in separate runs"));
  EXPECT_THAT(twice.people, HasSubstr("1 of the files failed; do what their lines say: no run"));
  EXPECT_THAT(twice.people, Not(HasSubstr("--resume")));

  const std::string cut = other + "/affected.gt3x";
  std::filesystem::resize_file(cut, std::filesystem::file_size(cut) * 3 / 4);
  const auto damaged = run(
      {"repair", cut, archive_ + "/none.gt3x", "-o", folder_ / "second", "--constants", constants});
  EXPECT_THAT(damaged.people, HasSubstr("2 of the files failed; do what their lines say"));
  EXPECT_THAT(damaged.people, HasSubstr(" --salvage --resume\n"));
  const auto both = run({"repair", cut, archive_, other + "/../other/none.gt3x", "-o",
                         folder_ / "third", "--constants", constants, "--salvage", "--resume"});
  EXPECT_THAT(both.people, HasSubstr("2 of the files failed; another run can repair 1 of them"));
}

// An .agd that is named gets scan's answer: no constants help it, so no unit waits for any.
TEST_F(RepairCommand, AnAgdIsToBeMadeAgain) {
  const std::string agd = archive_ + "/epochs.agd";
  tests::make_agd(agd, "MOS2A45130001", "1.5.0");
  const std::string sentence =
      "an .agd cannot be repaired: make it again from the repaired raw data";
  EXPECT_THAT(run({"scan", agd}).out, HasSubstr(sentence));
  const auto answer = run({"repair", agd, "-o", out_, "--scan"});
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.out, AllOf(HasSubstr("not_repairable"), HasSubstr(sentence)));
  EXPECT_THAT(answer.people, AllOf(Not(HasSubstr("next:")), Not(HasSubstr("jig"))));
  const auto folder = run({"repair", archive_, "-o", out_, "--scan", "--json"});
  EXPECT_EQ(folder.exit_code, 0);
  EXPECT_EQ(folder.json()["summary"]["files"], 2) << "of a folder, recordings";
  tests::make_agd(archive_ + "/other.agd", "NEO1C15110001", "1.5.0");
  EXPECT_EQ(run({"repair", archive_ + "/other.agd", "-o", out_, "--scan"}).exit_code, 0)
      << "not affected";
}

// A file that would not be written now, and an earlier run's output of it: both are said.
TEST_F(RepairCommand, AnOutputThatWouldNotBeWrittenNowIsOutdated) {
  std::string wrong = kConstants;
  wrong.replace(wrong.find("90.5"), 4, "20.5");
  std::ofstream(folder_ / "wrong.json") << wrong;
  const auto repair = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {"repair",      archive_ + "/affected.gt3x", "-o",    out_,
                                      "--constants", folder_ / "wrong.json",      "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return run(words).json()["files"][0];
  };
  EXPECT_EQ(repair({})["status"], "not_repairable");
  const Json forced = repair({"--force"});
  EXPECT_EQ(forced["status"], "repaired");
  EXPECT_EQ(forced["forced"], true);
  EXPECT_EQ(repair({})["status"], "outdated");
  EXPECT_EQ(repair({"--redo-outdated"})["status"], "outdated") << "there is nothing to put there";
}

TEST_F(RepairCommand, AManifestThatCannotBeWrittenIsSaidBesideTheOneDocument) {
  const std::vector<std::string> words = {"repair",   archive_,      "-o",
                                          out_,       "--constants", folder_ / "constants.json",
                                          "--resume", "--json"};
  ASSERT_EQ(run(words).exit_code, 0);
  std::filesystem::remove(out_ + "/manifest.csv");
  std::filesystem::create_directory(out_ + "/manifest.csv");
  const auto again = run(words);
  EXPECT_EQ(again.json()["files"].size(), 2U) << "one document, whole";
  EXPECT_THAT(again.people, HasSubstr("manifest.csv"));
  EXPECT_GE(again.exit_code, 64);
}

TEST_F(RepairCommand, PeopleSeeTheSourceTheErrorsAndTheReasons) {
  const auto answer =
      run({"repair", archive_, "-o", out_, "--constants", folder_ / "constants.json"});
  EXPECT_THAT(answer.out, HasSubstr(" -> "));
  EXPECT_THAT(answer.out, HasSubstr("by constants "));
  EXPECT_THAT(answer.out, HasSubstr("calibrated on 2013-11-12"));
  const Json manifest = Json::parse(std::ifstream(out_ + "/manifest.json"));
  ASSERT_EQ(manifest["files"].size(), 2U);
  EXPECT_EQ(manifest["files"][0]["status"], "repaired");
  EXPECT_EQ(manifest["files"][0]["source"]["kind"], "constants");
  EXPECT_TRUE(std::filesystem::exists(out_ + "/manifest.csv"));
  EXPECT_EQ(run({"scan", out_}).exit_code, 0);
  EXPECT_THAT(next_of(answer), testing::ElementsAre("impact", archive_, out_));
  EXPECT_EQ(run(next_of(answer)).exit_code, 0);
}

// The program as people start it, stopped by Ctrl-C: exit 3, what is done stays, and the line that
// it prints goes on.
TEST_F(RepairCommand, CtrlCEndsInOrderAndTheLineGoesOn) {
  // So many that the signal comes in their midst; under the sanitizers each takes a second.
  constexpr std::size_t kMore = tests::kSanitized ? 12 : 60;
  for (std::size_t i = 0; i < kMore; ++i) {
    std::filesystem::copy_file(archive_ + "/affected.gt3x",
                               archive_ + "/more" + std::to_string(i) + ".gt3x");
  }
  const std::string line = std::string(SIXPOINT_PROGRAM) + " repair " + archive_ + " -o " + out_ +
                           " --jobs 1 --constants " + (folder_ / "constants.json");
  // The shell's own process becomes the program, so that the signal finds it.
  const std::string script = "exec " + line + " >/dev/null 2>" + (folder_ / "people");
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    ::execl("/bin/sh", "sh", "-c", script.c_str(), nullptr);
    ::_exit(127);
  }
  while (!std::filesystem::exists(out_ + "/affected.gt3x")) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ASSERT_EQ(::kill(child, SIGINT), 0);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 3);
  std::ifstream people(folder_ / "people");
  const std::string said{std::istreambuf_iterator<char>(people), {}};
  EXPECT_THAT(said, HasSubstr("to go on:\n  sixpoint repair " + archive_ + " -o " + out_));
  EXPECT_THAT(said, HasSubstr("--resume"));
  const Json manifest = Json::parse(std::ifstream(out_ + "/manifest.json"));
  EXPECT_GE(manifest["files"].size(), 1U);
  EXPECT_LT(manifest["files"].size(), kMore + 2);
  const auto on = run({"repair", archive_, "-o", out_, "--constants", folder_ / "constants.json",
                       "--resume", "--json"});
  EXPECT_EQ(on.exit_code, 0) << on.people;
  EXPECT_EQ(on.json()["summary"]["repaired"], kMore + 1);
  EXPECT_EQ(Json::parse(std::ifstream(out_ + "/manifest.json"))["files"].size(), kMore + 2);
}

TEST_F(RepairCommand, StoreCommandsAnswerByContract) {
  const std::string path = folder_ / "store.db";
  {
    auto store = db::Store::open(posix_env(), path);
    ASSERT_OK(store);
    ASSERT_OK(store->add_constants(tests::jig_constants(), "wGT3X-BT"));
  }
  const Json units = run({"units", "--store", path, "--json"}).json();
  EXPECT_EQ(units["units"][0]["serial"], "MOS2A45130450");
  const Json history = run({"history", "MOS2A45130450", "--store", path, "--json"}).json();
  ASSERT_EQ(history["constants"].size(), 1U);
  for (const char* key :
       {"id", "serial", "filter", "constants", "standard_uncertainty", "method", "made_at"}) {
    EXPECT_TRUE(history["constants"][0].contains(key)) << key;
  }
  const Json repaired =
      run({"repair", archive_, "-o", out_, "--store", path, "--json"}).json()["files"][0];
  EXPECT_EQ(repaired["method"], "store");
  EXPECT_EQ(repaired["constants_id"], history["constants"][0]["id"]);
  const auto audit = run({"audit", "verify", "--store", path, "--json"});
  EXPECT_EQ(audit.exit_code, 0);
  EXPECT_EQ(audit.json()["ok"], true);
  EXPECT_EQ(audit.json()["rows"], 4) << "unit, filter, constants, repair";
  EXPECT_EQ(audit.json()["head"].get<std::string>().size(), 64U);
  EXPECT_EQ(run({"history", "NONE", "--store", path}).exit_code, 66);
  EXPECT_EQ(run({"units", "--store", folder_ / "none.db"}).exit_code, 66);
}

TEST_F(RepairCommand, RealFilesAreJudged) {
  SIXPOINT_NEED_SHARED("data/wgt3x-bt-affected");
  const auto answer = run({"scan", tests::shared_file("data"), "--json"});
  EXPECT_EQ(answer.exit_code, 1);
  const Json json = answer.json();
  for (const Json& file : json["files"]) {
    const std::string path = file["path"];
    EXPECT_EQ(file["verdict"],
              path.find("wgt3x-bt-affected") != std::string::npos ? "affected" : "not_affected")
        << file.dump(1);
  }
}

// Some files have it so. The store and labels have capitals; the file's own bytes stay.
TEST_F(RepairCommand, ASerialNumberInSmallLettersIsThatOfItsUnit) {
  MadeRecording made = half_hour();
  made.serial = "mos2a45130450";
  const std::string small = folder_ / "small.gt3x";
  ASSERT_OK(made.write(files_, small));
  const std::string store = folder_ / "store.db";
  ASSERT_OK(db::Store::open(posix_env(), store)->add_constants(tests::jig_constants(), "wGT3X-BT"));
  EXPECT_EQ(run({"scan", small, "--json"}).json()["files"][0]["serial"], "MOS2A45130450");
  EXPECT_EQ(run({"inspect", small, "--json"}).json()["serial"], "MOS2A45130450");
  const auto answer = run({"repair", small, "-o", out_, "--store", store, "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.out << answer.people;
  EXPECT_EQ(answer.json()["files"][0]["status"], "repaired");
  EXPECT_EQ(answer.json()["files"][0]["serial"], "MOS2A45130450");
  EXPECT_EQ(tests::entry_of(files_, out_ + "/small.gt3x", "info.txt"),
            tests::entry_of(files_, small, "info.txt"));
  EXPECT_EQ(run({"history", "MOS2A45130450", "--store", store, "--json"}).json()["repairs"].size(),
            1U);
}

// Serial numbers of files come from outside: quotes are kept as they are, and one that no store
// keeps does not stand in the way of the others.
TEST_F(RepairCommand, FilesWithUnusualSerialNumbersAreRepairedAndKeptOrNamed) {
  const std::string quoted = "MOS\"';-- \\\\ %s";
  const std::string place = folder_ / "odd";
  MadeRecording made = half_hour();
  made.serial = quoted;
  ASSERT_OK(files_.make_folders(place));
  ASSERT_OK(made.write(files_, place + "/quoted.gt3x"));
  made.serial = "MOS" + std::string(10'000, 'x');
  ASSERT_OK(made.write(files_, place + "/long.gt3x"));
  made.serial = "MOS2A\x07\x1b[31m";
  ASSERT_OK(made.write(files_, place + "/control.gt3x"));
  const std::string store = folder_ / "store.db";
  {
    // Made by the first use, and empty.
    ASSERT_OK(db::Store::open(posix_env(), store));
  }
  const auto answer = run({"repair", place, "-o", out_, "--scan", "--store", store, "--json"});
  EXPECT_EQ(answer.exit_code, 65) << answer.people;
  EXPECT_EQ(answer.json()["summary"]["repaired"], 3) << answer.out;
  EXPECT_EQ(answer.json()["kept"]["in"], "store");
  EXPECT_THAT(answer.people,
              HasSubstr("long.gt3x: repaired, but the store cannot keep its record"));
  EXPECT_THAT(answer.people,
              HasSubstr("control.gt3x: repaired, but the store cannot keep its record"));
  EXPECT_THAT(answer.people, testing::Not(HasSubstr("\x1b")));
  const auto history = run({"history", quoted, "--store", store, "--json"});
  EXPECT_EQ(history.exit_code, 0) << history.people;
  EXPECT_EQ(history.json()["repairs"].size(), 1U);
  const auto nothing = run({"history", made.serial, "--store", store});
  EXPECT_EQ(nothing.exit_code, 66);
  EXPECT_THAT(nothing.people, testing::Not(HasSubstr("\x1b")));
  EXPECT_LT(run({"history", std::string(10'000, 'x'), "--store", store}).people.size(), 2000U);
  EXPECT_EQ(run({"audit", "verify", "--store", store}).exit_code, 0);
}

}  // namespace
}  // namespace sixpoint::cli
