// solve by its contract: keys, exit codes, what is stored and what is not.
#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/random.h"
#include "calib/constants.h"
#include "cli/command_fixture.h"
#include "expect_result.h"
#include "repair/made_agdc.h"
#include "repair/made_recording.h"
#include "shared_data.h"

namespace sixpoint::cli {
namespace {

using testing::ElementsAre;
using testing::UnorderedElementsAre;
using tests::MadeRecording;

constexpr PerAxis<double> kSensitivity = {0.0042, 0.00405, 0.0043};
constexpr PerAxis<double> kZero = {90.5, 50.25, 88};

// A minute on each of the sides named by `sides` ("+x" is 0 ... "-z" is 5), a few degrees askew.
MadeRecording sides_recording(const std::vector<int>& sides, unsigned rate_hz = 30,
                              int seconds = 60, std::uint64_t seed = 5) {
  MadeRecording made;
  made.rate_hz = rate_hz;
  Random random(seed);
  for (const int side : sides) {
    PerAxis<double> up = {0.03 * random.normal(), 0.03 * random.normal(), 0.03 * random.normal()};
    up[static_cast<std::size_t>(side / 2)] = side % 2 == 0 ? 1 : -1;
    const double length = std::sqrt(up[0] * up[0] + up[1] * up[1] + up[2] * up[2]);
    for (int i = 0; i < seconds * static_cast<int>(rate_hz); ++i) {
      const bool turning = i < 3 * static_cast<int>(rate_hz);
      PerAxis<int> raw{};
      for (std::size_t a = 0; a < kAxes; ++a) {
        const double g = up[a] / length + (turning ? 0.3 : 0.0045) * random.normal();
        raw[a] = static_cast<int>(std::lround(g / kSensitivity[a] + kZero[a]));
      }
      made.raw.push_back(raw);
    }
  }
  return made;
}

class SolveCommand : public tests::CommandTest {
 protected:
  std::string write(const MadeRecording& made, const std::string& name) {
    const std::string path = folder_ / name;
    EXPECT_OK(made.write(posix_env().files, path));
    return path;
  }
};

// The name of a file may be any bytes; what is written and stored is UTF-8.
TEST_F(SolveCommand, ANameThatIsNoUtf8IsEscaped) {
  const std::string path = write(sides_recording({0, 1, 2, 3, 4, 5}), "s\xff x.gt3x");
  const std::string output = folder_ / "constants.json";
  const auto answer =
      run({"solve", path, "--json", "--save", "--store", folder_ / "s.db", "-o", output});
  ASSERT_EQ(answer.exit_code, 0) << answer.people;
  EXPECT_TRUE(answer.json().is_object());
  std::ifstream file(output);
  const auto written = nlohmann::json::parse(file);
  EXPECT_EQ(written["made_from"]["file"], "s\\xff x.gt3x");
}

TEST_F(SolveCommand, SixSidesAreSolvedStoredAndWritten) {
  for (const unsigned rate : {30U, 60U, 100U}) {
    const std::string path =
        write(sides_recording({0, 1, 2, 3, 4, 5}, rate), "six" + std::to_string(rate) + ".gt3x");
    const std::string store = folder_ / ("s" + std::to_string(rate) + ".db");
    const std::string output = folder_ / ("c" + std::to_string(rate) + ".json");
    const auto answer = run({"solve", path, "--json", "--save", "--store", store, "-o", output});
    ASSERT_EQ(answer.exit_code, 0) << answer.out << answer.people;
    const Json json = answer.json();
    EXPECT_EQ(json["schema"], "sixpoint/solve/1");
    for (const char* key : {"serial", "filter", "method", "constants", "standard_uncertainty",
                            "points", "coverage_g", "residual_mg", "verified", "verdict", "reasons",
                            "missing_directions", "iterations", "seconds", "stored_id"}) {
      EXPECT_TRUE(json.contains(key)) << key;
    }
    EXPECT_EQ(json["serial"], "MOS2A45130450");
    EXPECT_EQ(json["filter"], "current");
    EXPECT_TRUE(json["verified"].get<bool>());
    EXPECT_TRUE(json["missing_directions"].empty());
    EXPECT_GT(json["residual_mg"]["before"].get<double>(), 50);
    EXPECT_LT(json["residual_mg"]["after"].get<double>(), 1);
    for (std::size_t a = 0; a < kAxes; ++a) {
      // Oracle: the constants that the recording was made with. 0.5 mg, and 0.05 %.
      const double s = json["constants"]["sensitivity_g_per_lsb"][a].get<double>();
      EXPECT_NEAR(s / kSensitivity[a], 1, 5e-4);
      EXPECT_NEAR((json["constants"]["zero_lsb"][a].get<double>() - kZero[a]) * s, 0, 5e-4);
    }
    std::ifstream file(output);
    const std::string text((std::istreambuf_iterator<char>(file)),
                           std::istreambuf_iterator<char>());
    const auto record = calib::parse_constants_record(text);
    ASSERT_OK(record);
    EXPECT_EQ(record->made_from.sha256.size(), 64U);
    const auto history = run({"history", "MOS2A45130450", "--json", "--store", store});
    ASSERT_EQ(history.exit_code, 0);
    EXPECT_EQ(history.json()["constants"][0]["id"], json["stored_id"]);
  }
}

// A full disk: what was measured is in the store all the same.
TEST_F(SolveCommand, AFileThatCannotBeWrittenStopsNotTheStore) {
  const std::string path = write(sides_recording({0, 1, 2, 3, 4, 5}), "six.gt3x");
  const std::string store = folder_ / "s.db";
  const auto answer = run({"solve", path, "--json", "--save", "--store", store, "-o", "/dev/full"});
  EXPECT_EQ(answer.exit_code, 74);
  EXPECT_THAT(answer.people, HasSubstr("/dev/full"));
  const Json stored = run({"history", "MOS2A45130450", "--json", "--store", store}).json();
  ASSERT_EQ(stored["constants"].size(), 1U) << answer.people;
  EXPECT_EQ(answer.json()["stored_id"], stored["constants"][0]["id"]);
  EXPECT_EQ(answer.json()["error"]["code"], "io");
  EXPECT_EQ(run({"solve", path, "-o", "/dev/full"}).exit_code, 74) << "without the store";
}

TEST_F(SolveCommand, GeneticAlgorithmIsReproducible) {
  const std::string path = write(sides_recording({0, 1, 2, 3, 4, 5}), "six.gt3x");
  const auto one = run({"solve", path, "--method", "ga", "--seed", "7", "--json"});
  const auto two = run({"solve", path, "--method", "ga", "--seed", "7", "--json"});
  ASSERT_EQ(one.exit_code, 0) << one.out;
  EXPECT_EQ(one.json()["method"], "ga");
  EXPECT_EQ(one.json()["constants"], two.json()["constants"]);
}

TEST_F(SolveCommand, MissingSidesAreNamedAndNothingIsStored) {
  const std::string path = write(sides_recording({0, 1, 2, 4}), "four.gt3x");
  const std::string store = folder_ / "store.db";
  const std::string output = folder_ / "constants.json";
  const auto answer = run({"solve", path, "--json", "--save", "--store", store, "-o", output});
  EXPECT_EQ(answer.exit_code, 1);
  const Json json = answer.json();
  EXPECT_FALSE(json["verified"].get<bool>());
  EXPECT_TRUE(json["stored_id"].is_null());
  EXPECT_TRUE(json["constants"].is_null());
  EXPECT_THAT(json["missing_directions"].get<std::vector<std::string>>(),
              UnorderedElementsAre("-y", "-z"));
  EXPECT_FALSE(std::filesystem::exists(output));
  const auto with_prior = run({"solve", path, "--json", "--prior", "population"});
  EXPECT_EQ(with_prior.exit_code, 1);
  EXPECT_TRUE(with_prior.json()["from_prior"].get<bool>());
  EXPECT_EQ(with_prior.json()["verdict"], "rests_on_prior");
  // As the help of -o says.
  EXPECT_EQ(run({"solve", path, "--prior", "population", "-o", output}).exit_code, 1);
  std::ifstream written(output);
  EXPECT_EQ(Json::parse(written)["from_prior"], true);
  EXPECT_THAT(run({"solve", "--help"}).out, testing::HasSubstr("(from_prior)"));
}

// Good constants of the wrong filter: who keeps them must know that they repair nothing.
TEST_F(SolveCommand, ConstantsOfTheLegacyFilterSaySo) {
  MadeRecording made = sides_recording({0, 1, 2, 3, 4, 5});
  const auto notes = [&](const std::string& firmware) {
    made.firmware = firmware;
    const auto answer = run({"solve", write(made, firmware + ".gt3x"), "--json"});
    EXPECT_EQ(answer.exit_code, 0) << answer.people;
    return answer.json()["notes"].dump();
  };
  EXPECT_THAT(notes("1.3.0"),
              testing::HasSubstr("(firmware 1.3.0 chose it): its constants repair "
                                 "no affected file; record one with firmware 1.4.0"));
  EXPECT_THAT(notes("1.5.0"), testing::Not(testing::HasSubstr("legacy")));
  const auto next = [&](const std::string& name) { return run({"solve", path(name)}).people; };
  EXPECT_THAT(next("1.3.0.gt3x"), testing::Not(HasSubstr("--save")));
  EXPECT_THAT(next("1.5.0.gt3x"), HasSubstr("--save"));
}

// Affected by its header, and right by the constants stored in it: other software leaves such a
// file, and what is solved from it is not the sensor. Oracle: the sensor that the other file was
// made with.
TEST_F(SolveCommand, ARecordingThatOtherSoftwareCorrectedLendsNoConstants) {
  MadeRecording corrected = sides_recording({0, 1, 2, 3, 4, 5});
  corrected.constants = {{326, 287, 321}, {-201, -268, -199}, {61, 4, 61}};
  for (PerAxis<int>& raw : corrected.raw) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double g = (raw[a] - kZero[a]) * kSensitivity[a];
      const StoredConstants& stored = corrected.constants;
      raw[a] = static_cast<int>(std::lround(
          g * (stored.positive_lsb[a] - stored.negative_lsb[a]) / 2 + stored.zero_lsb[a]));
    }
  }
  std::filesystem::create_directory(path("study"));
  const std::string fixed = write(corrected, "study/fixed.gt3x");
  const std::string store = path("s.db");
  const auto answer = run({"solve", fixed, "--json", "--save", "--store", store});
  EXPECT_EQ(answer.exit_code, 65);
  const Json json = answer.json();
  EXPECT_TRUE(json["stored_id"].is_null());
  EXPECT_TRUE(json["constants"].is_object()) << "the answer is there all the same";
  EXPECT_THAT(json["notes"].back().get<std::string>(), HasSubstr("other software"));
  EXPECT_EQ(json["error"]["code"], "bad_data");
  EXPECT_EQ(run({"solve", fixed, "-o", path("of_fixed.json")}).exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(path("of_fixed.json"))) << "for this file itself";
  // Another file of the unit, whose own sides do not suffice.
  MadeRecording worn = sides_recording({0, 2});
  worn.constants = corrected.constants;
  const std::string poor = write(worn, "study/worn.gt3x");
  const auto by_file =
      run({"repair", poor, "--calibration-file", fixed, "-o", path("a"), "--json"});
  EXPECT_EQ(by_file.json()["files"][0]["status"], "not_repairable") << by_file.out;
  EXPECT_THAT(by_file.out, HasSubstr("other software may have corrected it"));
  const auto pooled = run({"repair", path("study"), "--scan", "-o", path("b"), "--json"});
  const Json files = pooled.json()["files"];
  EXPECT_EQ(files.size(), 2U);
  for (const Json& file : files) {
    EXPECT_EQ(file["status"], "not_repairable") << file;
  }
}

// Without a scale a count may be anything.
TEST_F(SolveCommand, WithoutAScaleNothingIsSolved) {
  const MadeRecording made = sides_recording({0, 1, 2, 3, 4, 5});
  auto writer = gt3x::RecordingWriter::create(posix_env().files, path("x.gt3x")).value();
  gt3x::ParameterValues values;
  gt3x::set_constants(values, made.constants);
  Bytes log;
  gt3x::append_record(log, gt3x::RecordType::parameters, 7, gt3x::encode_parameters(values));
  Bytes own;
  gt3x::append_record(own, gt3x::RecordType::parameters, made.start - 1, made.parameters());
  const Bytes rest = made.log();
  log.insert(log.end(), rest.begin() + static_cast<std::ptrdiff_t>(own.size()), rest.end());
  ASSERT_OK(writer.add("log.bin", log));
  ASSERT_OK(
      writer.add("info.txt", "Serial Number: XYZ1\r\nFirmware: 1.5.0\r\nSample Rate: 30\r\n"));
  ASSERT_OK(writer.commit());
  const auto solved = run({"solve", path("x.gt3x")});
  EXPECT_EQ(solved.exit_code, 65);
  EXPECT_THAT(solved.people, HasSubstr("Acceleration Scale"));
  const auto scanned = run({"scan", path("x.gt3x"), "--json"}).json();
  EXPECT_TRUE(scanned["files"][0]["evidence_mg"].is_null()) << scanned;
}

// Of constants that are not verified nothing is stored; so what is said of the store was said
// before the work.
TEST_F(SolveCommand, AStoreThatCannotBeMadeIsSaidBeforeTheWork) {
  const std::string path = write(sides_recording({0, 1, 2, 4}), "four.gt3x");
  const auto answer = run({"solve", path, "--save", "--store", folder_ / "nowhere/store.db"});
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.people, HasSubstr("the store cannot be used now"));
  EXPECT_THAT(run({"solve", path, "--store", folder_ / "nowhere/store.db"}).people,
              testing::Not(HasSubstr("the store cannot be used now")));
}

TEST_F(SolveCommand, UsageAndBadInput) {
  const std::string path = write(sides_recording({0}), "one.gt3x");
  EXPECT_EQ(run({"solve", path, "--method", "magic"}).exit_code, 64);
  EXPECT_EQ(run({"solve", path, "--gravity", "1.62"}).exit_code, 64);
  EXPECT_EQ(run({"solve", path, "--prior", "hope"}).exit_code, 64);
  EXPECT_EQ(run({"solve"}).exit_code, 64);
  const auto missing = run({"solve", folder_ / "none.gt3x", "--json"});
  EXPECT_EQ(missing.exit_code, 66);
  EXPECT_TRUE(missing.json().contains("error"));
  MadeRecording broken = sides_recording({0, 1});
  broken.constants.negative_lsb[1] = broken.constants.positive_lsb[1];
  EXPECT_EQ(run({"solve", write(broken, "broken.gt3x")}).exit_code, 65);
}

// The same person's turns of an .agdc recorder, cold and warm by turns: raw counts, a
// calibration.json that is off by a little, the die's temperature every four seconds.
std::string write_agdc(FileSystem& files, const std::string& path, const PerAxis<double>& mg_per_c,
                       int poses) {
  constexpr PerAxis<double> kCountsPerG = {246, 262, 253};
  constexpr PerAxis<double> kZeroAt20 = {33, 19, 88};
  Random random(11);
  Bytes log;
  std::uint32_t time = 1'660'839'480;
  for (int pose = 0; pose < poses; ++pose) {
    PerAxis<double> up{};
    if (pose < 6) {
      up[static_cast<std::size_t>(pose / 2)] = pose % 2 == 0 ? 1 : -1;
    } else {
      up = {random.normal(), random.normal(), random.normal()};
    }
    const double length = std::sqrt(up[0] * up[0] + up[1] * up[1] + up[2] * up[2]);
    const double celsius = random.uniform(8, 32);
    for (int second = 0; second < 40; ++second, ++time) {
      if (second % 4 == 0) {
        // 68 at 10 C and 536 at 40 C.
        const auto adc = static_cast<int>(std::lround(68 + (celsius - 10) * (536 - 68) / 30));
        gt3x::append_record(log, gt3x::RecordType::temperature, time,
                            Bytes{0, 0, 4, 1, static_cast<std::uint8_t>(adc & 0xFF),
                                  static_cast<std::uint8_t>((adc >> 8) & 0xFF)});
      }
      std::vector<gt3x::Counts> samples(32);
      for (gt3x::Counts& sample : samples) {
        for (std::size_t a = 0; a < kAxes; ++a) {
          const double g = up[a] / length + mg_per_c[a] / 1000 * (celsius - 20) +
                           (second < 3 ? 0.3 : 0.004) * random.normal();
          sample[a] = static_cast<std::int16_t>(std::lround(kZeroAt20[a] + kCountsPerG[a] * g));
        }
      }
      Bytes payload;
      gt3x::append_activity3(payload, samples);
      gt3x::append_record(log, gt3x::RecordType::activity3, time, payload);
    }
  }
  gt3x::Info info;
  info.set("Serial Number", "CPW1C48210099");
  info.set("Firmware", "2.1.9");
  info.set("Sample Rate", "32");
  Json calibration = {{"calibrationMethod", 2}, {"isCalibrated", false}, {"calibrationTime", 1}};
  const PerAxis<const char*> names = {"X", "Y", "Z"};
  for (std::size_t a = 0; a < kAxes; ++a) {
    const auto zero = static_cast<int>(kZeroAt20[a]);
    calibration[std::string("positiveZeroGOffset") + names[a] + "_32"] = zero + 250;
    calibration[std::string("negativeZeroGOffset") + names[a] + "_32"] = zero - 250;
    calibration[std::string("zeroGOffset") + names[a] + "_32"] = zero + 8;
    calibration[std::string("offset") + names[a] + "_32"] = zero + 8;
    for (std::size_t b = a; b < kAxes; ++b) {
      calibration[std::string("sensitivity") + names[a] + names[b] + "_32"] = a == b ? 25'000 : 0;
    }
  }
  const Json thermometer = {{"mcuTempLow", 970},   {"mcuTempHigh", 1075}, {"adxlTempLow", 68},
                            {"adxlTempHigh", 536}, {"tempLow", 10},       {"tempHigh", 40}};
  const auto bytes = [](const Json& json) {
    const std::string text = json.dump();
    return Bytes(text.begin(), text.end());
  };
  auto writer = gt3x::RecordingWriter::create(files, path);
  EXPECT_OK(writer);
  EXPECT_OK(writer->add("log.bin", std::move(log)));
  EXPECT_OK(writer->add("info.txt", info.serialise()));
  EXPECT_OK(writer->add("calibration.json", bytes(calibration)));
  EXPECT_OK(writer->add("temperature_calibration.json", bytes(thermometer)));
  EXPECT_OK(writer->commit());
  return path;
}

// Where many poses meet many temperatures, held-out error admits temperature terms; the six
// constants then hold at the mean temperature. Oracle: the numbers that the recording was made
// with.
TEST_F(SolveCommand, TemperatureTermsAreAdmittedByEvidenceOnly) {
  const PerAxis<double> drift = {-0.5, 0.4, -0.45};
  const auto warm =
      run({"solve", write_agdc(posix_env().files, folder_ / "warm.agdc", drift, 40), "--json"});
  ASSERT_EQ(warm.exit_code, 0) << warm.out << warm.people;
  const Json json = warm.json();
  EXPECT_EQ(json["serial"], "CPW1C48210099");
  ASSERT_TRUE(json.contains("richer_model")) << json.dump(1);
  const Json& richer = json["richer_model"];
  ASSERT_FALSE(richer["zero_lsb_per_c"].is_null());
  const double reference_c = richer["reference_temperature_c"].get<double>();
  EXPECT_NEAR(reference_c, 20, 4);
  const PerAxis<double> counts_per_g = {246, 262, 253};
  const PerAxis<double> zero = {33, 19, 88};
  for (std::size_t a = 0; a < kAxes; ++a) {
    EXPECT_NEAR(richer["zero_lsb_per_c"][a].get<double>() / counts_per_g[a] * 1000, drift[a], 0.03);
    const double at_reference = zero[a] + counts_per_g[a] * drift[a] / 1000 * (reference_c - 20);
    EXPECT_NEAR(json["constants"]["zero_lsb"][a].get<double>(), at_reference, 0.25);
    EXPECT_NEAR(json["constants"]["sensitivity_g_per_lsb"][a].get<double>() * counts_per_g[a], 1,
                1e-3);
  }
  // Without drift the temperatures are there and the terms are not.
  const auto steady = run(
      {"solve", write_agdc(posix_env().files, folder_ / "steady.agdc", {0, 0, 0}, 40), "--json"});
  ASSERT_EQ(steady.exit_code, 0) << steady.out;
  EXPECT_TRUE(!steady.json().contains("richer_model") ||
              steady.json()["richer_model"]["zero_lsb_per_c"].is_null());
}

// Of samples that are in g already there are no raw counts to solve.
TEST_F(SolveCommand, ACalibratedAgdcIsExportedAndNotSolved) {
  const std::string path = folder_ / "calibrated.agdc";
  tests::MadeAgdc made;
  made.calibrated = true;
  made.coefficients = false;
  ASSERT_OK(made.write(posix_env().files, path));
  const auto answer = run({"solve", path});
  EXPECT_EQ(answer.exit_code, 65);
  EXPECT_THAT(answer.people, testing::HasSubstr("calibrated before they were written"));
  EXPECT_EQ(run({"impact", path}).exit_code, 0);
  EXPECT_EQ(run({"export", path, "--csv", folder_ / "g.csv"}).exit_code, 0);
}

// Three and a half hours in a chamber from 0 to 30 C, in one pose: no constants, and the drift.
// Oracle: the drift that PROVENANCE states for this recording (about -0.16, -0.40, -0.43 mg/C).
TEST_F(SolveCommand, DriftOfTheChamberRun) {
  SIXPOINT_NEED_SHARED("data/agdc/CPW1C48210013_baseline.agdc");
  const auto answer =
      run({"solve", tests::shared_file("data/agdc/CPW1C48210013_baseline.agdc"), "--json"});
  EXPECT_EQ(answer.exit_code, 1);
  const Json json = answer.json();
  EXPECT_EQ(json["verdict"], "incomplete");
  EXPECT_TRUE(json["constants"].is_null());
  EXPECT_THAT(json["missing_directions"].get<std::vector<std::string>>(),
              ElementsAre("+x", "-x", "+y", "-y", "-z"));
  ASSERT_TRUE(json.contains("temperature"));
  const PerAxis<double> stated = {-0.16, -0.40, -0.43};
  for (std::size_t a = 0; a < kAxes; ++a) {
    EXPECT_NEAR(json["temperature"]["zero_mg_per_c"][a].get<double>(), stated[a], 0.07);
    EXPECT_LT(json["temperature"]["standard_uncertainty_mg_per_c"][a].get<double>(), 0.02);
  }
  EXPECT_LT(json["temperature"]["low_c"].get<double>(), 3);
  EXPECT_GT(json["temperature"]["high_c"].get<double>(), 28);
}

// The honest answer about the two really affected units.
TEST_F(SolveCommand, AffectedUnitsOwnStillPeriodsDoNotSuffice) {
  SIXPOINT_NEED_SHARED("data/wgt3x-bt-affected/MOS2A45130450.gt3x");
  const auto one =
      run({"solve", tests::shared_file("data/wgt3x-bt-affected/MOS2A45130450.gt3x"), "--json"});
  EXPECT_EQ(one.exit_code, 1);
  EXPECT_THAT(one.json()["missing_directions"].get<std::vector<std::string>>(),
              ElementsAre("+x", "-x", "+y", "-y", "+z"));
  const auto two =
      run({"solve", tests::shared_file("data/wgt3x-bt-affected/MOS2A45130451.gt3x"), "--json"});
  EXPECT_EQ(two.exit_code, 1);
  EXPECT_THAT(two.json()["missing_directions"].get<std::vector<std::string>>(),
              ElementsAre("+x", "-x", "+y", "-y"));
}

}  // namespace
}  // namespace sixpoint::cli
