#include "repair/triage/scan_file.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "repair/made_agd.h"
#include "repair/made_agdc.h"
#include "repair/six_sides.h"
#include "repair/triage/inspection.h"
#include "repair/triage/survey.h"
#include "shared_data.h"
#include "temporary_folder.h"

namespace sixpoint::repair {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using tests::shared_file;

// Twenty seconds at rest, Z up and reading `up_lsb` of 256 on average. The constants are such that
// the unit stores what its sensor reads, so the samples lie |up_lsb / 256 - 1| g from 1 g.
tests::MadeRecording at_rest(int up_lsb) {
  tests::MadeRecording made;
  made.constants = {{256, 256, 256}, {-256, -256, -256}, {0, 0, 0}};
  for (int i = 0; i < 600; ++i) {
    made.raw.push_back({0, 0, up_lsb + (i % 4 == 0 ? 1 : i % 4 == 2 ? -1 : 0)});
  }
  return made;
}

ScannedFile scanned(const tests::MadeRecording& made) {
  MemoryFiles files;
  EXPECT_OK(made.write(files, "in.gt3x"));
  return scan_file(files, "in.gt3x");
}

// Evidence is what the applied calibration makes of the samples; without one there is none.
TEST(ScanFile, TheEvidenceOfAnAgdcIsThatOfItsCalibration) {
  const auto scan_of = [](const tests::MadeAgdc& made) {
    MemoryFiles files;
    EXPECT_OK(made.write(files, "in.agdc"));
    return scan_file(files, "in.agdc");
  };
  tests::MadeAgdc made;
  for (const bool calibrated : {false, true}) {
    made.calibrated = calibrated;
    const ScannedFile found = scan_of(made);
    EXPECT_EQ(found.verdict, "not_affected");
    EXPECT_LT(found.evidence_mg.value(), 2);
    EXPECT_THAT(found.reasons, Not(Contains(HasSubstr("do not fit")))) << calibrated;
  }
  made.calibrated = false;
  made.calibration = false;
  const ScannedFile without = scan_of(made);
  EXPECT_FALSE(without.evidence_mg);
  EXPECT_THAT(without.reasons, Contains(HasSubstr("no calibration.json that fits them")));
}

// Oracle: inspect, which follows the export of the same file (raw_csv_test.cpp has the vendor's CSV).
TEST(ScanFile, TheEvidenceOfARealAgdcIsThatOfInspect) {
  SIXPOINT_NEED_SHARED("data/agdc/CPW1C48210013_baseline.agdc");
  const std::string path = shared_file("data/agdc/CPW1C48210013_baseline.agdc");
  const auto inspected = inspect(posix_env().files, path);
  ASSERT_OK(inspected);
  EXPECT_DOUBLE_EQ(scan_file(posix_env().files, path).evidence_mg.value(),
                   inspected->still->magnitude.p95_mg);
}

// Oracle: a row each of the table of triage.h.
TEST(ScanFile, TheVerdictIsThatOfTheTriage) {
  constexpr std::int64_t kBefore = 1'395'619'199;  // 2014-03-23T23:59:59Z
  constexpr std::int64_t kLate = 1'395'619'200;    // 2014-03-24T00:00:00Z
  struct Case {
    const char* serial;
    std::int64_t calibrated;
    const char* firmware;
    const char* verdict;
  };
  for (const Case& c :
       std::initializer_list<Case>{{"", kBefore, "1.5.0", "cannot_tell"},
                                   {"TAS1E31150129", kBefore, "1.5.0", "not_affected"},
                                   {"MOS2A45130450", kLate, "1.5.0", "not_affected"},
                                   {"MOS2A45130450", kBefore, "1.3.0", "not_affected"},
                                   {"MOS2A45130450", kBefore, "1.8.0", "not_affected"},
                                   {"MOS2A45130450", kBefore, "1.5.0", "affected"},
                                   {"MOS2A45130450", kBefore, "1.4.2", "cannot_tell"},
                                   {"MOS2A45130450", 0, "1.5.0", "cannot_tell"}}) {
    tests::MadeRecording made = at_rest(256);
    made.serial = c.serial;
    made.calibrated = c.calibrated;
    made.firmware = c.firmware;
    const ScannedFile file = scanned(made);
    SCOPED_TRACE(testing::Message() << c.serial << " " << c.calibrated << " " << c.firmware);
    EXPECT_EQ(file.verdict, c.verdict);
    EXPECT_EQ(file.facts.serial, c.serial);
    EXPECT_FALSE(file.reasons.empty());
    EXPECT_FALSE(file.error);
    EXPECT_EQ(file.path, "in.gt3x");
  }
}

TEST(ScanFile, SaysThatFirmware160TurnedTheAxes) {
  tests::MadeRecording made = at_rest(256);
  EXPECT_FALSE(scanned(made).axes_rotated);
  made.firmware = "1.6.0";
  EXPECT_TRUE(scanned(made).axes_rotated);
}

// Oracle: closed forms. 272, 273 and 239 LSB of 256 are 62.5, 66.4 and 66.4 mg from 1 g.
TEST(ScanFile, EvidenceBeginsAtThePapers64mg) {
  for (const auto& [up_lsb, evidence_mg] : {std::pair{256, 0.0}, {272, 62.5}}) {
    const ScannedFile file = scanned(at_rest(up_lsb));
    ASSERT_TRUE(file.evidence_mg);
    EXPECT_NEAR(*file.evidence_mg, evidence_mg, 0.01);
    EXPECT_THAT(file.reasons, Not(Contains(HasSubstr("from 1 g"))));
  }
  for (const int up_lsb : {273, 239}) {
    const ScannedFile file = scanned(at_rest(up_lsb));
    ASSERT_TRUE(file.evidence_mg);
    EXPECT_NEAR(*file.evidence_mg, 17 / 0.256, 0.01);
    EXPECT_THAT(file.reasons,
                Contains(HasSubstr("its 5 still periods are 66 mg from 1 g (95th percentile)")));
  }
}

// Oracle: the side on which Eq. 1-6 with the stored constants are furthest from 1 g.
TEST(ScanFile, EvidenceOfSixSidesIsTheWorstOfThem) {
  double worst_mg = 0;
  for (const gt3x::Counts& counts : tests::stored_sides()) {
    const double length_g = std::hypot(counts[0], counts[1], counts[2]) / 256;
    worst_mg = std::max(worst_mg, 1000 * std::abs(length_g - 1));
  }
  const ScannedFile file = scanned(tests::six_sides());
  ASSERT_TRUE(file.evidence_mg);
  EXPECT_NEAR(*file.evidence_mg, worst_mg, 4) << "one count of rounding";
}

TEST(ScanFile, SamplesNeverChangeTheVerdict) {
  EXPECT_EQ(scanned(at_rest(256)).verdict, "affected") << "the header says it, the samples do not";
  tests::MadeRecording made = at_rest(320);
  made.serial = "TAS1E31150129";
  const ScannedFile file = scanned(made);
  EXPECT_EQ(file.verdict, "not_affected") << "250 mg off for another reason";
  EXPECT_THAT(file.reasons, Contains(HasSubstr("the constants do not fit the data")));
  EXPECT_THAT(file.reasons, Contains(HasSubstr("16CPAN03 is not why they do not fit")));
}

TEST(ScanFile, SaysWhereTheSamplesGiveNoEvidence) {
  tests::MadeRecording made = at_rest(256);
  made.raw.resize(60);  // two seconds; a still block has four
  const ScannedFile file = scanned(made);
  EXPECT_EQ(file.verdict, "affected");
  EXPECT_FALSE(file.evidence_mg);
  EXPECT_THAT(file.reasons, Contains(HasSubstr("no still periods")));
}

TEST(ScanFile, CountsDamage) {
  const tests::MadeRecording made = at_rest(256);
  MemoryFiles files;
  Bytes log = made.log();
  log[log.size() - 144 - 20] ^= 1;  // among the samples of the last second but one
  ASSERT_OK(made.write(files, "one.gt3x", log));
  EXPECT_THAT(scan_file(files, "one.gt3x").reasons,
              Contains("damage: 1 wrong checksums, 0 damaged stretches"));
  log.insert(log.end(), 20, 0x77);
  ASSERT_OK(made.write(files, "both.gt3x", log));
  EXPECT_THAT(scan_file(files, "both.gt3x").reasons,
              Contains("damage: 1 wrong checksums, 1 damaged stretches"));
  EXPECT_THAT(scanned(made).reasons, Not(Contains(HasSubstr("damage"))));
}

TEST(ScanFile, ARepairedFileIsNotAffectedAnyMore) {
  MemoryFiles files;
  const tests::MadeRecording made = at_rest(256);
  auto writer = gt3x::RecordingWriter::create(files, "marked.gt3x").value();
  ASSERT_OK(writer.add("log.bin", made.log()));
  ASSERT_OK(writer.add("info.txt", std::string_view("Serial Number: MOS2A45130450\r\n"
                                                    "Firmware: 1.6.0\r\nSample Rate: 30\r\n")));
  ASSERT_OK(writer.add(kRepairMark, "{}"));
  ASSERT_OK(writer.commit());
  const ScannedFile file = scan_file(files, "marked.gt3x");
  EXPECT_EQ(file.verdict, "not_affected");
  EXPECT_THAT(file.reasons, ElementsAre("already repaired by sixpoint"));
  EXPECT_FALSE(file.axes_rotated) << "the repair turned them back";
}

// The mark says that it was repaired; its still periods say that this did not help.
TEST(ScanFile, AMarkedFileWhoseStillPeriodsDoNotFitIsNotCleared) {
  MemoryFiles files;
  const tests::MadeRecording made = at_rest(256 + 30);
  auto writer = gt3x::RecordingWriter::create(files, "marked.gt3x").value();
  ASSERT_OK(writer.add("log.bin", made.log()));
  ASSERT_OK(writer.add("info.txt", std::string_view("Serial Number: MOS2A45130450\r\n"
                                                    "Firmware: 1.5.0\r\nSample Rate: 30\r\n")));
  ASSERT_OK(writer.add(kRepairMark, "{}"));
  ASSERT_OK(writer.commit());
  const ScannedFile file = scan_file(files, "marked.gt3x");
  ASSERT_GT(file.evidence_mg.value(), kEvidenceLimit_mg);
  EXPECT_EQ(file.verdict, "cannot_tell");
  EXPECT_THAT(file.reasons, Contains(HasSubstr("repair the original again")));
}

TEST(ScanFile, AnAffectedFileThatFitsAllTheSameIsSaid) {
  const ScannedFile file = scanned(at_rest(256));
  ASSERT_LE(file.evidence_mg.value(), kEvidenceLimit_mg);
  EXPECT_EQ(file.verdict, "affected");
  EXPECT_THAT(file.reasons, Contains(HasSubstr("corrected by other software")));
}

TEST(ScanFile, WhatCannotBeReadIsAnAnswerToo) {
  MemoryFiles files;
  ASSERT_OK(write_file(files, "text.gt3x", "this is no zip archive"));
  const tests::TemporaryFolder folder;
  for (const char* name : {"text.agd", "text.AGD"}) {  // on the real disk, unlike recordings
    std::ofstream(folder / name) << "this is no database, and it is long enough to say so";
  }
  for (const auto& [path, code] :
       {std::pair<std::string, ErrorCode>{"none.gt3x", ErrorCode::no_input},
        {"text.gt3x", ErrorCode::bad_data},
        {folder / "none.agd", ErrorCode::no_input},
        {folder / "text.agd", ErrorCode::bad_data},
        {folder / "text.AGD", ErrorCode::bad_data}}) {
    SCOPED_TRACE(path);
    const ScannedFile file = scan_file(files, path);
    EXPECT_EQ(file.path, path);
    EXPECT_EQ(file.verdict, "unreadable");
    ASSERT_TRUE(file.error);
    EXPECT_EQ(file.error->code, code);
    EXPECT_THAT(file.error->where, HasSubstr(path));
    EXPECT_FALSE(file.evidence_mg);
    ASSERT_EQ(file.reasons.size(), 1U);
    EXPECT_THAT(file.reasons[0], AllOf(HasSubstr(file.error->what), HasSubstr(file.error->hint)));
    EXPECT_THAT(file.reasons[0], Not(HasSubstr(path))) << "the line names the file already";
  }
}

TEST(ScanFile, ARecordingThatIsCalledAgdIsSaidToBeOne) {
  const tests::TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  ASSERT_OK(at_rest(256).write(files, folder / "recording.agd"));
  const ScannedFile file = scan_file(files, folder / "recording.agd");
  EXPECT_EQ(file.verdict, "unreadable");
  EXPECT_THAT(file.error->what, HasSubstr("this is a .gt3x recording"));
  EXPECT_THAT(file.error->hint, HasSubstr("ends with .gt3x"));
}

// Oracles: the publishers' own words on these files (../shared/data/PROVENANCE.md).
TEST(ScanFile, RealFiles) {
  SIXPOINT_NEED_SHARED("data");
  FileSystem& disk = posix_env().files;
  for (const char* name : {"MOS2A45130450", "MOS2A45130451"}) {
    const ScannedFile file =
        scan_file(disk, shared_file(std::string("data/wgt3x-bt-affected/") + name + ".gt3x"));
    EXPECT_EQ(file.verdict, "affected") << name;
    ASSERT_TRUE(file.evidence_mg) << name;
    EXPECT_GT(*file.evidence_mg, kEvidenceLimit_mg) << name;
  }
  EXPECT_EQ(scan_file(disk, shared_file("data/gt9x/TAS1H30182785_2019-09-17.gt3x")).verdict,
            "not_affected");
  // Epochs of the recording data/gt9x/TAS1E31150129.gt3x.
  const ScannedFile epochs = scan_file(disk, shared_file("data/agd/example1sec.agd"));
  EXPECT_EQ(epochs.facts.serial, "TAS1E31150129");
  EXPECT_EQ(epochs.verdict, "not_affected");
  EXPECT_THAT(epochs.reasons, Not(Contains(HasSubstr("cannot be repaired")))) << "no need to";
}

// The date of an .agd stands in the recording beside it, where that is of the same unit.
TEST(ScanFile, AnAgdHasTheDateOfItsRecording) {
  const tests::TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  tests::MadeRecording made = at_rest(256);
  made.serial = "MOS2A1";
  ASSERT_OK(made.write(files, folder / "one.gt3x"));
  made.serial = "MOS2A2";
  ASSERT_OK(made.write(files, folder / "another60sec.gt3x"));
  struct Case {
    const char* name;
    const char* verdict;
    const char* reason;
  };
  for (const Case& c : std::initializer_list<Case>{{"one.agd", "affected", "one.gt3x"},
                                                   {"one60sec.agd", "affected", "one.gt3x"},
                                                   {"another60sec.agd", "cannot_tell", "put its"},
                                                   {"60sec.agd", "cannot_tell", "put its"},
                                                   {"alone.agd", "cannot_tell", "put its"}}) {
    tests::make_agd(folder / c.name, "MOS2A1", "1.5.0");
    const ScannedFile file = scan_file(files, folder / c.name);
    EXPECT_EQ(file.verdict, c.verdict) << c.name;
    EXPECT_THAT(file.reasons, Contains(HasSubstr(c.reason))) << c.name;
  }
}

// Who asks is asked in turn, but for a file whose recording says the date.
TEST(ScanFile, AnAgdWithoutItsRecordingHasTheDateThatIsKnownElsewhere) {
  const tests::TemporaryFolder folder;
  FileSystem& files = posix_env().files;
  tests::MadeRecording made = at_rest(256);
  made.serial = "MOS2A1";
  ASSERT_OK(made.write(files, folder / "one.gt3x"));
  tests::make_agd(folder / "one.agd", "MOS2A1", "1.5.0");
  tests::make_agd(folder / "alone.agd", "MOS2A1", "1.5.0");
  const auto in_2015 = [](const std::string& serial) -> KnownDate {
    return {from_unix_seconds(1'420'070'400), "known for " + serial};
  };
  EXPECT_EQ(scan_file(files, folder / "one.agd", in_2015).verdict, "affected");
  const ScannedFile known = scan_file(files, folder / "alone.agd", in_2015);
  EXPECT_EQ(known.verdict, "not_affected");
  EXPECT_THAT(known.reasons, Contains(HasSubstr("known for MOS2A1")));
  const ScannedFile several =
      scan_file(files, folder / "alone.agd", [](const std::string&) -> KnownDate {
        return {std::nullopt, "several dates"};
      });
  EXPECT_EQ(several.verdict, "cannot_tell");
  EXPECT_THAT(several.reasons, Contains(HasSubstr("several dates")));
  const ScannedFile unknown =
      scan_file(files, folder / "alone.agd", [](const std::string&) -> KnownDate { return {}; });
  EXPECT_EQ(unknown.verdict, "cannot_tell");
  EXPECT_THAT(unknown.reasons, Contains(HasSubstr("--store")));
}

}  // namespace
}  // namespace sixpoint::repair
