#include "repair/rescale/repair_file.h"

#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/forwarding_files.h"
#include "base/memory_env.h"
#include "base/random.h"
#include "base/sha256.h"
#include "expect_result.h"
#include "gt3x/made_archive.h"
#include "repair/old_form.h"
#include "repair/rescale/gate.h"
#include "repair/rescale/repair_mark.h"
#include "repair/six_sides.h"
#include "shared_data.h"
#include "temporary_folder.h"

namespace sixpoint::repair {
namespace {

using gt3x::Counts;
using tests::entry_of;
using tests::kTrue;
using tests::MadeRecording;
using tests::samples_of;
using tests::sense;
using tests::six_sides;

// The raw counts that the unit stores as zero.
constexpr PerAxis<int> kStoredZero = tests::kStored.zero_lsb;

class FixedConstants final : public ConstantsSource {
 public:
  explicit FixedConstants(const calib::Calibration& calibration = kTrue) {
    ChosenConstants chosen;
    chosen.record.serial = "MOS2A45130450";
    chosen.record.filter = calib::FilterConfiguration::current;
    chosen.record.calibration = calibration;
    chosen.method = "store";
    chosen.constants_id = "abc";
    choice.chosen = chosen;
  }
  Result<ConstantsChoice> choose(const std::string&, const Survey&) override { return choice; }
  std::optional<ChosenConstants> foreseen(const FileFacts&) override { return choice.chosen; }
  ConstantsChoice choice;
};

// A log without the mark, which is its first record.
Bytes without_mark(const Bytes& log) {
  gt3x::LogReader reader(std::make_unique<gt3x::MemorySource>(log));
  const auto first = reader.next().value();
  EXPECT_TRUE(first && is_repair_mark(first->record));
  return {log.begin() + static_cast<std::ptrdiff_t>(first ? first->raw.size() : 0), log.end()};
}

class RepairFile : public testing::Test {
 protected:
  // In two passes and in one, which must give the same answer and the same bytes.
  RepairReport repair(RepairOptions options = {}) {
    const auto before = output();
    options.one_pass_from_bytes = std::numeric_limits<std::uint64_t>::max();
    const RepairReport in_two = repair_file(memory_.env, "in.gt3x", "out.gt3x", source_, options);
    const auto by_two = output();
    if (by_two) {
      EXPECT_OK(memory_.files.remove("out.gt3x"));
    }
    if (before) {
      EXPECT_OK(memory_.files.create("out.gt3x").value()->write_at(0, *before));
    }
    options.one_pass_from_bytes = 0;
    RepairReport in_one = repair_file(memory_.env, "in.gt3x", "out.gt3x", source_, options);
    EXPECT_EQ(in_one.to_json().dump(1), in_two.to_json().dump(1));
    EXPECT_TRUE(output() == by_two);
    return in_one;
  }
  std::optional<Bytes> output() {
    return exists("out.gt3x") ? std::optional(read_file(memory_.files, "out.gt3x").value())
                              : std::nullopt;
  }
  bool exists(const std::string& path) { return memory_.files.info(path).has_value(); }
  // The repair fails and gives no output. Returns what the error says.
  std::string expect_bad_data() {
    const RepairReport report = repair();
    EXPECT_EQ(report.status, RepairStatus::failed);
    EXPECT_FALSE(exists("out.gt3x"));
    const Error error = report.error.value_or(Error{});
    EXPECT_EQ(error.code, ErrorCode::bad_data);
    return error.what;
  }

  MemoryEnv memory_;
  FixedConstants source_;
};

// Mean distance from 1 g of what a unit without noise stores in these poses.
double distance_mg(const std::array<PerAxis<int>, 4>& poses, const calib::Calibration& constants,
                   bool in_counts) {
  double sum = 0;
  for (const PerAxis<int>& raw : poses) {
    double square = 0;
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double g = constants.to_g(a, raw[a]);
      square += std::pow(in_counts ? std::round(256 * g) / 256 : g, 2);
    }
    sum += 1000 * std::abs(std::sqrt(square) - 1) / 4;
  }
  return sum;
}

// Writes in.gt3x and returns constants that gain a mg and more, which rounding takes away again.
// Nothing where none are found.
std::optional<calib::Calibration> gain_that_rounding_takes_away(FileSystem& files) {
  const calib::Calibration stored = calib::calibration_from(tests::kStored).value();
  Random random(11);
  for (int trial = 0; trial < 1'000'000; ++trial) {
    calib::Calibration sensors = stored;
    for (std::size_t a = 0; a < kAxes; ++a) {
      sensors.sensitivity_g_per_lsb[a] *= 1 + 0.002 * random.normal();
      sensors.zero_lsb[a] += 0.4 * random.normal();
    }
    std::array<PerAxis<int>, 4> poses{};
    for (PerAxis<int>& raw : poses) {
      const PerAxis<double> up = {random.normal(), random.normal(), random.normal()};
      for (std::size_t a = 0; a < kAxes; ++a) {
        const double g = up[a] / std::hypot(up[0], up[1], up[2]);
        raw[a] = static_cast<int>(
            std::lround(g / sensors.sensitivity_g_per_lsb[a] + sensors.zero_lsb[a]));
      }
    }
    const double before_mg = distance_mg(poses, stored, true);
    if (distance_mg(poses, sensors, false) < before_mg - 1.1 &&
        distance_mg(poses, sensors, true) > before_mg + 0.4) {
      MadeRecording made;
      for (const PerAxis<int>& raw : poses) {
        made.raw.insert(made.raw.end(), 300, raw);
      }
      EXPECT_OK(made.write(files, "in.gt3x"));
      return sensors;
    }
  }
  return std::nullopt;
}

// Each way to an output asks: in two passes, in one, a dry run, one that goes on, with and without
// force.
TEST_F(RepairFile, WhatRoundingTakesAwayAgainIsNotKept) {
  const auto sensors = gain_that_rounding_takes_away(memory_.files);
  ASSERT_TRUE(sensors);
  source_ = FixedConstants(*sensors);
  const auto with = [](std::initializer_list<bool RepairOptions::*> given) {
    RepairOptions options;
    for (const auto option : given) {
      options.*option = true;
    }
    return options;
  };
  const auto expect_refused = [&](const RepairOptions& options, RepairStatus status) {
    const auto before = output();
    const RepairReport report = repair(options);
    EXPECT_EQ(report.status, status) << report.to_json().dump(1);
    EXPECT_THAT(report.reasons, testing::Contains(testing::HasSubstr("rounded to counts")));
    EXPECT_EQ(report.still_error_after_mg.has_value(), status != RepairStatus::outdated);
    if (report.still_error_after_mg) {
      EXPECT_GT(report.still_error_after_mg, report.still_error_before_mg);
    }
    EXPECT_TRUE(output() == before);
  };
  expect_refused({}, RepairStatus::not_repairable);
  expect_refused(with({&RepairOptions::dry_run}), RepairStatus::not_repairable);
  const RepairReport forced = repair(with({&RepairOptions::force}));
  EXPECT_EQ(forced.status, RepairStatus::repaired);
  EXPECT_TRUE(forced.forced);
  ASSERT_TRUE(output());
  expect_refused(with({&RepairOptions::resume}), RepairStatus::outdated);
  expect_refused(with({&RepairOptions::resume, &RepairOptions::redo_outdated}),
                 RepairStatus::outdated);
  const RepairReport again = repair(with({&RepairOptions::resume, &RepairOptions::force}));
  EXPECT_EQ(again.status, RepairStatus::repaired);
  EXPECT_TRUE(again.resumed);
  EXPECT_TRUE(again.forced);
}

TEST_F(RepairFile, EverySampleIsWhatTheRightConstantsWouldHaveStored) {
  const MadeRecording made = six_sides();
  ASSERT_OK(made.write(memory_.files, "in.gt3x"));
  const Bytes before = read_file(memory_.files, "in.gt3x").value();
  const RepairReport report = repair();
  ASSERT_EQ(report.status, RepairStatus::repaired) << report.to_json().dump(1);
  EXPECT_EQ(read_file(memory_.files, "in.gt3x").value(), before) << "the original was touched";
  EXPECT_GT(report.still_error_before_mg.value(), 100);
  EXPECT_LT(report.still_error_after_mg.value(), 1);
  EXPECT_EQ(report.samples, made.raw.size());
  const auto repaired = samples_of(memory_.files, "out.gt3x");
  ASSERT_EQ(repaired.size(), made.raw.size());
  // Oracle: the right constants applied to the raw counts themselves. Where the firmware sent two
  // raw counts to one stored count, half a raw count may be missing.
  std::size_t exact = 0;
  for (std::size_t i = 0; i < repaired.size(); ++i) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double wanted = 256 * kTrue.to_g(a, made.raw[i][a]);
      EXPECT_LE(std::abs(repaired[i][a] - wanted),
                0.5 + 0.5 * 256 * kTrue.sensitivity_g_per_lsb[a]);
      exact += repaired[i][a] == std::lround(wanted) ? 1U : 0U;
    }
  }
  EXPECT_GT(static_cast<double>(exact) / static_cast<double>(3 * repaired.size()), 0.95);
}

TEST_F(RepairFile, OnlySampleRecordsAndTheMarkDiffer) {
  MadeRecording made = six_sides();
  made.raw.resize(1837);  // the last record holds an odd number of samples: an unused nibble
  Bytes wrong_checksum;
  gt3x::append_record(wrong_checksum, gt3x::RecordType::activity, 1'428'588'244, Bytes(135, 7));
  wrong_checksum.back() ^= 1U;
  made.between = [&](std::size_t second) {
    Bytes extra;
    if (second == 3) {
      extra = {0, 0, 0};  // legal
    } else if (second == 4) {
      extra = wrong_checksum;
    } else if (second == 5) {
      gt3x::append_record(extra, gt3x::RecordType::activity, 1'428'588'245, Bytes{0});  // USB
    } else if (second == 6) {
      gt3x::append_record(extra, static_cast<gt3x::RecordType>(77), 1'428'588'246, Bytes{1, 2});
    }
    return extra;
  };
  Bytes log = made.log();
  log[log.size() - 2] |= 0x0AU;  // the unused nibble is not ours
  log.back() = gt3x::record_checksum(std::span(log).last(41).first(40));
  ASSERT_EQ(log[log.size() - 41], gt3x::kSeparator);
  ASSERT_OK(made.write(memory_.files, "in.gt3x", log));
  const RepairReport report = repair();
  ASSERT_EQ(report.status, RepairStatus::repaired) << report.to_json().dump(1);
  const Bytes after = without_mark(entry_of(memory_.files, "out.gt3x", "log.bin"));
  ASSERT_EQ(after.size(), log.size());
  gt3x::LogReader was(std::make_unique<gt3x::MemorySource>(log));
  gt3x::LogReader is(std::make_unique<gt3x::MemorySource>(after));
  std::size_t changed = 0;
  while (true) {
    const auto a = was.next().value();
    const auto b = is.next().value();
    ASSERT_EQ(a.has_value(), b.has_value());
    if (!a) {
      break;
    }
    ASSERT_EQ(a->raw.size(), b->raw.size());
    if (a->kind == gt3x::LogItem::Kind::record && a->record.checksum_ok &&
        a->record.is(gt3x::RecordType::activity) && a->record.payload.size() > 1) {
      EXPECT_TRUE(b->record.checksum_ok);
      EXPECT_EQ(a->record.unix_time, b->record.unix_time);
      ++changed;
    } else {
      EXPECT_TRUE(std::equal(a->raw.begin(), a->raw.end(), b->raw.begin()));
    }
  }
  EXPECT_EQ(changed, 62U);
  EXPECT_EQ(after[after.size() - 2] & 0x0FU, 0x0AU);
  EXPECT_EQ(entry_of(memory_.files, "out.gt3x", "info.txt"),
            entry_of(memory_.files, "in.gt3x", "info.txt"));
  EXPECT_EQ(entry_of(memory_.files, "out.gt3x", "extra.bin"), (Bytes{1, 2, 3}));
}

TEST_F(RepairFile, UnchangedConstantsChangeNothingAtAll) {
  const MadeRecording made = six_sides();
  ASSERT_OK(made.write(memory_.files, "in.gt3x"));
  FixedConstants same(calib::calibration_from(made.constants).value());
  RepairOptions force;  // the gate refuses a repair that changes nothing
  force.force = true;
  const auto report = repair_file(memory_.env, "in.gt3x", "out.gt3x", same, force);
  ASSERT_EQ(report.status, RepairStatus::repaired);
  EXPECT_TRUE(report.forced);
  EXPECT_EQ(without_mark(entry_of(memory_.files, "out.gt3x", "log.bin")), made.log());
}

// A file that other software corrected: the same header, right samples.
TEST_F(RepairFile, WhatIsRightAlreadyIsNotWritten) {
  MadeRecording made = six_sides();
  made.constants = {{328, 300, 333}, {-148, -204, -152}, {95, 52, 91}};  // those of kTrue
  MadeRecording header = made;
  header.constants = tests::kStored;
  Bytes log = made.log();
  const Bytes parameters = header.parameters();
  Bytes head;
  gt3x::append_record(head, gt3x::RecordType::parameters, made.start - 1, parameters);
  std::copy(head.begin(), head.end(), log.begin());
  ASSERT_OK(made.write(memory_.files, "in.gt3x", log));
  const RepairReport report = repair();
  EXPECT_EQ(report.status, RepairStatus::not_repairable) << report.to_json().dump(1);
  EXPECT_LT(report.still_error_before_mg.value(), 5);
  EXPECT_GT(report.still_error_after_mg.value(), 50);
  EXPECT_FALSE(exists("out.gt3x"));
}

TEST_F(RepairFile, ConstantsOfAnotherUnitAreRefusedByTheGateAndForcedWithAMark) {
  ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
  calib::Calibration other = kTrue;
  other.zero_lsb = {110, 20, 60};
  source_ = FixedConstants(other);
  const RepairReport refused = repair();
  EXPECT_EQ(refused.status, RepairStatus::not_repairable);
  EXPECT_EQ(refused.reasons.back(), what_may_help(false, 6));
  EXPECT_FALSE(exists("out.gt3x"));
  RepairOptions force;
  force.force = true;
  const RepairReport report = repair(force);
  ASSERT_EQ(report.status, RepairStatus::repaired);
  EXPECT_NE(report.reasons.back(), what_may_help(false, 6));
  EXPECT_TRUE(report.forced);
  const Bytes bytes = entry_of(memory_.files, "out.gt3x", kRepairMark);
  const auto mark = nlohmann::json::parse(bytes.begin(), bytes.end());
  EXPECT_EQ(mark["forced"], true);
  EXPECT_GT(mark["still_error_mg"]["before"].get<double>(), 32);
  EXPECT_GT(mark["still_error_mg"]["after"].get<double>(), 32);
}

// 20 mg on one axis pass the gate; the file's own still periods know better.
TEST_F(RepairFile, ConstantsThatTheFileContradictsAreNotApplied) {
  ASSERT_OK(tests::many_sides().write(memory_.files, "in.gt3x"));
  calib::Calibration old = kTrue;
  old.zero_lsb[2] += 5;
  source_ = FixedConstants(old);
  const RepairReport report = repair();
  EXPECT_EQ(report.status, RepairStatus::not_repairable);
  ASSERT_GE(report.reasons.size(), 2U);
  const std::string& why = report.reasons[report.reasons.size() - 2];
  EXPECT_NE(why.find("on z"), std::string::npos) << why;
  EXPECT_EQ(report.reasons.back(), what_may_help(false, 6));
  RepairOptions force;
  force.force = true;
  EXPECT_TRUE(repair(force).forced);
}

TEST_F(RepairFile, WithoutStillPeriodsItIsWrittenAndSaid) {
  MadeRecording made = six_sides();
  made.raw.erase(made.raw.begin(), made.raw.begin() + 1800);
  ASSERT_OK(made.write(memory_.files, "in.gt3x"));
  const RepairReport report = repair();
  EXPECT_EQ(report.status, RepairStatus::repaired);
  EXPECT_EQ(report.still_blocks, 0U);
  EXPECT_NE(report.to_json()["reasons"].dump().find("could not be checked"), std::string::npos);
}

// A unit on its charger stores zeros: they stay, and count neither before nor after.
TEST_F(RepairFile, ChargingZerosStayZero) {
  const MadeRecording made = six_sides();
  ASSERT_OK(made.write(memory_.files, "plain.gt3x"));
  const auto plain = repair_file(memory_.env, "plain.gt3x", "plain-out.gt3x", source_, {});
  Bytes log = made.log();
  const std::vector<Counts> zeros(made.rate_hz);
  for (std::uint32_t second = 0; second < 600; ++second) {
    Bytes payload;
    gt3x::append_activity(payload, zeros);
    gt3x::append_record(log, gt3x::RecordType::activity, made.start + 70 + second, payload);
  }
  ASSERT_OK(made.write(memory_.files, "in.gt3x", log));
  const RepairReport report = repair();
  ASSERT_EQ(report.status, RepairStatus::repaired) << report.to_json().dump(1);
  EXPECT_EQ(report.still_error_before_mg, plain.still_error_before_mg);
  EXPECT_EQ(report.still_error_after_mg, plain.still_error_after_mg);
  const auto repaired = samples_of(memory_.files, "out.gt3x");
  ASSERT_EQ(repaired.size(), 670U * made.rate_hz);
  for (std::size_t i = 70UL * made.rate_hz; i < repaired.size(); ++i) {
    ASSERT_EQ(repaired[i], Counts{}) << i;
  }
}

TEST_F(RepairFile, ASingleZeroIsAMeasurement) {
  MadeRecording made = six_sides();
  const std::size_t at = 1815;  // moving, and inside a record
  made.raw[at] = {kStoredZero[0], kStoredZero[1], kStoredZero[2]};
  ASSERT_EQ(made.stored()[at], Counts{});
  ASSERT_OK(made.write(memory_.files, "in.gt3x"));
  ASSERT_EQ(repair().status, RepairStatus::repaired);
  EXPECT_NE(samples_of(memory_.files, "out.gt3x")[at], Counts{});
}

TEST_F(RepairFile, IsDoneOnce) {
  ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
  ASSERT_EQ(repair().status, RepairStatus::repaired);
  const auto again = repair_file(memory_.env, "out.gt3x", "twice.gt3x", source_, {});
  EXPECT_EQ(again.status, RepairStatus::already_repaired);
  EXPECT_FALSE(exists("twice.gt3x"));
  EXPECT_EQ(repair().error->code, ErrorCode::cannot_create) << "an output is never overwritten";
  RepairOptions resume;
  resume.resume = true;
  const auto resumed = repair(resume);
  EXPECT_EQ(resumed.status, RepairStatus::repaired);
  EXPECT_EQ(resumed.output_sha256.size(), 64U);
}

TEST_F(RepairFile, UndoesTheRotationOfFirmware160Once) {
  const MadeRecording straight = six_sides();
  MadeRecording turned = straight;
  turned.firmware = "1.6.0";
  ASSERT_NE(straight.stored(), turned.stored());
  ASSERT_OK(straight.write(memory_.files, "straight.gt3x"));
  ASSERT_OK(turned.write(memory_.files, "in.gt3x"));
  ASSERT_EQ(repair().status, RepairStatus::repaired);
  ASSERT_EQ(repair_file(memory_.env, "straight.gt3x", "straight-out.gt3x", source_, {}).status,
            RepairStatus::repaired);
  EXPECT_EQ(samples_of(memory_.files, "out.gt3x"), samples_of(memory_.files, "straight-out.gt3x"));
}

TEST_F(RepairFile, LeavesARotatedFileWithRightConstantsAloneUnlessAsked) {
  MadeRecording turned = six_sides();
  turned.firmware = "1.6.0";
  turned.calibrated = 1'430'000'000;
  ASSERT_OK(turned.write(memory_.files, "in.gt3x"));
  EXPECT_EQ(repair().status, RepairStatus::not_affected);
  RepairOptions options;
  options.undo_rotation = true;
  const auto report = repair(options);
  ASSERT_EQ(report.status, RepairStatus::repaired);
  EXPECT_EQ(report.method, "rotation");
  turned.firmware = "1.5.0";
  EXPECT_EQ(samples_of(memory_.files, "out.gt3x"), turned.stored());
}

TEST_F(RepairFile, CountsClippedSamplesAndKeepsThemAtTheLimit) {
  MadeRecording made;
  made.raw.assign(60, {2047, 60, 60});  // 7.5 g by the old constants
  made.raw[3] = {2400, 60, 60};         // beyond 8 g: clipped when it was stored
  made.raw[4] = {60, 60, -2300};
  made.raw[5] = {2047, 60, 60};
  ASSERT_OK(made.write(memory_.files, "in.gt3x"));
  const auto narrow = repair();
  ASSERT_EQ(narrow.status, RepairStatus::repaired) << narrow.to_json().dump(1);
  EXPECT_EQ(narrow.clipped_before, 2U);
  const auto repaired = samples_of(memory_.files, "out.gt3x");
  EXPECT_EQ(repaired[3][0], 2047);
  EXPECT_EQ(repaired[4][2], -2048);
  // 1952 counts at 1/237.7 g are 8.21 g: more than 12 bits hold.
  EXPECT_EQ(narrow.clipped_after, 60U);
  RepairOptions options;
  options.wide = true;
  const auto wide = repair_file(memory_.env, "in.gt3x", "wide.gt3x", source_, options);
  ASSERT_EQ(wide.status, RepairStatus::repaired);
  EXPECT_EQ(wide.clipped_after, 2U) << "their true value stays unknown";
  EXPECT_EQ(samples_of(memory_.files, "wide.gt3x")[5][0], std::lround(256 * kTrue.to_g(0, 2047)));
}

// The hash in the answer is that of the file, though no one read it again.
TEST_F(RepairFile, AnyNumberOfThreadsGivesTheSameBytesAndPackingTheSameSamples) {
  MadeRecording made = six_sides();
  const auto sides = made.raw;
  while (made.raw.size() < 800'000) {  // more than three pieces of 1 MiB
    made.raw.insert(made.raw.end(), sides.begin(), sides.end());
  }
  ASSERT_OK(made.write(memory_.files, "in.gt3x"));
  RepairOptions options;
  const auto one = repair_file(memory_.env, "in.gt3x", "one.gt3x", source_, options);
  ASSERT_EQ(one.status, RepairStatus::repaired) << one.to_json().dump(1);
  options.jobs = 3;
  const auto three = repair_file(memory_.env, "in.gt3x", "three.gt3x", source_, options);
  const Bytes bytes = read_file(memory_.files, "one.gt3x").value();
  EXPECT_TRUE(read_file(memory_.files, "three.gt3x").value() == bytes);
  EXPECT_EQ(one.output_sha256, to_hex(sha256(bytes)));
  EXPECT_EQ(three.output_sha256, one.output_sha256);

  options.store_only = true;
  const auto stored = repair_file(memory_.env, "in.gt3x", "stored.gt3x", source_, options);
  ASSERT_EQ(stored.status, RepairStatus::repaired);
  EXPECT_GT(memory_.files.info("stored.gt3x")->size, bytes.size());
  EXPECT_EQ(stored.output_sha256, file_sha256(memory_.files, "stored.gt3x").value());
  EXPECT_TRUE(samples_of(memory_.files, "stored.gt3x") == samples_of(memory_.files, "one.gt3x"));
  options.resume = true;
  EXPECT_TRUE(repair_file(memory_.env, "in.gt3x", "stored.gt3x", source_, options).resumed);
  options.store_only = false;
  EXPECT_EQ(repair_file(memory_.env, "in.gt3x", "stored.gt3x", source_, options).status,
            RepairStatus::outdated);
}

TEST_F(RepairFile, RefusesConstantsThatAreNotForThisFile) {
  ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
  source_.choice.chosen->record.serial = "MOS2A99999999";
  EXPECT_EQ(repair().status, RepairStatus::not_repairable);
  source_ = FixedConstants();
  source_.choice.chosen->record.filter = calib::FilterConfiguration::legacy;
  EXPECT_EQ(repair().status, RepairStatus::not_repairable);
  source_ = FixedConstants();
  source_.choice.chosen->record.from_prior = true;
  EXPECT_EQ(repair().status, RepairStatus::not_repairable);
  source_.choice = {std::nullopt, {"no constants in the store"}};
  const auto report = repair();
  EXPECT_EQ(report.status, RepairStatus::not_repairable);
  EXPECT_EQ(report.reasons.back(), "no constants in the store");
  EXPECT_FALSE(exists("out.gt3x"));
}

// An answer that rests on other units says so, in words and for programs.
TEST_F(RepairFile, ConstantsOfAPriorAreSaidWhereTheyAreUsed) {
  ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
  const std::string why =
      "the constants rest on a population prior (--allow-prior), not on this unit's data alone";
  EXPECT_THAT(repair().reasons, testing::Not(testing::Contains(why)));
  EXPECT_EQ(repair().to_json()["source"]["from_prior"], false);
  ASSERT_OK(memory_.files.remove("out.gt3x"));
  source_.choice.chosen->record.from_prior = true;
  RepairOptions allowed;
  allowed.allow_prior = true;
  const RepairReport report = repair(allowed);
  ASSERT_EQ(report.status, RepairStatus::repaired);
  EXPECT_THAT(report.reasons, testing::Contains(why));
  EXPECT_EQ(report.to_json()["source"]["from_prior"], true);
  EXPECT_TRUE(parse_source_used(report.to_json()["source"]).value().from_prior);
  allowed.resume = true;
  EXPECT_EQ(repair(allowed).to_json()["source"]["from_prior"], true) << "as its mark says";
}

// The log of a recording with other parameters.
Bytes log_with(const MadeRecording& made, const Bytes& parameters) {
  Bytes log;
  gt3x::append_record(log, gt3x::RecordType::parameters, made.start, parameters);
  const Bytes whole = made.log();
  log.insert(
      log.end(),
      whole.begin() + static_cast<std::ptrdiff_t>(made.parameters().size() + gt3x::kRecordOverhead),
      whole.end());
  return log;
}

TEST_F(RepairFile, DividesByNoZero) {
  MadeRecording made = six_sides();
  MadeRecording other = made;
  other.constants.positive_lsb[1] = other.constants.negative_lsb[1];
  const Bytes broken = log_with(made, other.parameters());
  ASSERT_OK(made.write(memory_.files, "in.gt3x", broken));
  expect_bad_data();
  EXPECT_THAT(repair().error.value_or(Error{}).hint, testing::HasSubstr("no other constants help"));
}

TEST_F(RepairFile, AFileWithoutSamplesSaysNothingOfConstants) {
  MadeRecording made = six_sides();
  made.raw.clear();
  ASSERT_OK(made.write(memory_.files, "in.gt3x"));
  const Error error = repair().error.value_or(Error{});
  EXPECT_EQ(error.code, ErrorCode::bad_data);
  EXPECT_THAT(error.what, testing::HasSubstr("no samples"));
  EXPECT_THAT(error.hint, testing::HasSubstr("download it from the unit again"));
  EXPECT_THAT(error.brief(), testing::Not(testing::HasSubstr("constants")));
}

TEST_F(RepairFile, AffectedFileWithoutConstantsIsBadData) {
  MadeRecording made = six_sides();
  gt3x::ParameterValues values;
  values[gt3x::kParameterCalibrationTime] = static_cast<std::uint32_t>(made.calibrated);
  const Bytes log = log_with(made, gt3x::encode_parameters(values));
  ASSERT_OK(made.write(memory_.files, "in.gt3x", log));
  EXPECT_NE(expect_bad_data().find("constants"), std::string::npos);
}

// At every disk operation in turn the power goes: the original is whole, the output whole or
// absent.
void cut_the_power_everywhere(FixedConstants& source, const RepairOptions& options) {
  MadeRecording made = six_sides();
  made.raw.resize(600);
  for (std::size_t stop = 0;; ++stop) {
    MemoryEnv memory;
    ASSERT_OK(made.write(memory.files, "in.gt3x"));
    const Bytes original = read_file(memory.files, "in.gt3x").value();
    memory.files.fail_after(stop);
    const auto report = repair_file(memory.env, "in.gt3x", "out.gt3x", source, options);
    memory.files.stop_failing();
    memory.files.lose_power();
    EXPECT_EQ(read_file(memory.files, "in.gt3x").value(), original);
    const bool there = memory.files.info("out.gt3x").has_value();
    if (there) {
      EXPECT_EQ(samples_of(memory.files, "out.gt3x").size(), made.raw.size());
    }
    if (report.status == RepairStatus::repaired) {
      EXPECT_TRUE(there);
      EXPECT_GE(stop, 5U);
      break;
    }
    EXPECT_EQ(report.status, RepairStatus::failed);
  }
}

// A mark that is cut is none, and the output would be repaired once more.
TEST_F(RepairFile, ASerialNumberThatNoMarkHoldsGivesNoOutput) {
  MadeRecording made = six_sides();
  made.serial = "MOS" + std::string(70'000, '0');
  source_.choice.chosen->record.serial = made.serial;
  ASSERT_OK(made.write(memory_.files, "in.gt3x"));
  EXPECT_NE(expect_bad_data().find("mark"), std::string::npos);
}

TEST_F(RepairFile, SurvivesAPowerCutAtEveryOperation) {
  RepairOptions options;
  cut_the_power_everywhere(source_, options);
  options.one_pass_from_bytes = 0;
  cut_the_power_everywhere(source_, options);
}

// Counts how often a file is opened.
class CountingFiles final : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  Result<std::unique_ptr<ReadableFile>> open(const std::string& path) override {
    ++opened[path];
    return disk().open(path);
  }
  std::map<std::string, int> opened;
};

// Without this, the tests above would hold if one pass were never taken.
TEST_F(RepairFile, OnePassOpensTheInputOnceAndOnceForItsHash) {
  ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
  CountingFiles files(memory_.files);
  Env env{memory_.clock, files};
  RepairOptions options;
  options.one_pass_from_bytes = 0;
  ASSERT_EQ(repair_file(env, "in.gt3x", "one.gt3x", source_, options).status,
            RepairStatus::repaired);
  EXPECT_EQ(files.opened["in.gt3x"], 2);
  files.opened.clear();
  options.one_pass_from_bytes = std::uint64_t{1} << 20;
  ASSERT_EQ(repair_file(env, "in.gt3x", "two.gt3x", source_, options).status,
            RepairStatus::repaired);
  EXPECT_EQ(files.opened["in.gt3x"], 4) << "to see how large it is, survey, hash, write";
}

// Counts the temporary files that are begun.
class CountingOutputs final : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  Result<std::unique_ptr<WritableFile>> create(const std::string& path) override {
    ++begun;
    return disk().create(path);
  }
  int begun = 0;
};

// Longer than the beginning that a one pass would go by, which does not say how large it becomes.
TEST_F(RepairFile, ALongWideLogIsPackedOnce) {
  MadeRecording made = six_sides();
  const std::vector<PerAxis<int>> sides = made.raw;
  while (made.raw.size() < 110'000) {
    made.raw.insert(made.raw.end(), sides.begin(), sides.end());
  }
  ASSERT_OK(made.write(memory_.files, "in.gt3x"));
  CountingOutputs files(memory_.files);
  Env env{memory_.clock, files};
  RepairOptions options;
  options.one_pass_from_bytes = 0;
  options.wide = true;
  ASSERT_EQ(repair_file(env, "in.gt3x", "out.gt3x", source_, options).status,
            RepairStatus::repaired);
  EXPECT_EQ(files.begun, 1);
}

// out.gt3x packed anew, with two bits of its samples turned that leave the record's checksum right.
void change_two_counts(FileSystem& files) {
  auto recording = gt3x::Recording::open(files, "out.gt3x").value();
  Bytes log;
  auto reader = recording.open_log().value();
  for (bool is_changed = false;;) {
    const auto item = reader.next().value();
    if (!item) {
      break;
    }
    log.insert(log.end(), item->raw.begin(), item->raw.end());
    if (!is_changed && item->record.is(gt3x::RecordType::activity) &&
        item->record.payload.size() > 20) {
      log[log.size() - 10] ^= 0x10U;
      log[log.size() - 11] ^= 0x10U;
      is_changed = true;
    }
  }
  auto writer = gt3x::RecordingWriter::create(files, "changed.gt3x", {}).value();
  for (const gt3x::EntryInfo& entry : recording.entries()) {
    ASSERT_OK(entry.name == "log.bin" ? writer.add(entry.name, log)
                                      : writer.copy(recording, entry.name));
  }
  ASSERT_OK(writer.commit());
  ASSERT_OK(files.rename("changed.gt3x", "out.gt3x"));
}

TEST_F(RepairFile, TheMarkStatesTheStillErrorThatTheReportStates) {
  ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
  for (const bool wide : {false, true}) {
    RepairOptions options;
    options.wide = wide;
    const RepairReport report = repair(options);
    ASSERT_TRUE(report.still_error_after_mg);
    const auto mark = mark_in(memory_.files, "out.gt3x");
    ASSERT_TRUE(mark);
    EXPECT_EQ((*mark)["still_error_mg"], report.to_json()["still_error_mg"]);
    ASSERT_OK(memory_.files.remove("out.gt3x"));
  }
}

TEST_F(RepairFile, WhatIsNotThereHasNoStillError) {
  ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
  ASSERT_EQ(repair().status, RepairStatus::repaired);
  const RepairReport refused = repair();
  EXPECT_EQ(refused.status, RepairStatus::failed);
  EXPECT_TRUE(refused.still_error_before_mg);
  EXPECT_FALSE(refused.still_error_after_mg);
  RepairOptions otherwise;
  otherwise.wide = true;
  otherwise.resume = true;
  const RepairReport outdated = repair(otherwise);
  EXPECT_EQ(outdated.status, RepairStatus::outdated);
  EXPECT_TRUE(outdated.still_error_before_mg);
  EXPECT_FALSE(outdated.still_error_after_mg);
}

TEST_F(RepairFile, AnOutputThatWasChangedIsNotTakenForDone) {
  ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
  RepairOptions options;
  ASSERT_EQ(repair(options).status, RepairStatus::repaired);
  options.resume = true;
  ASSERT_TRUE(repair(options).resumed);
  change_two_counts(memory_.files);
  const auto changed = output();
  const RepairReport report = repair(options);
  EXPECT_EQ(report.status, RepairStatus::failed);
  EXPECT_THAT(report.reasons.back(), testing::HasSubstr("not as that run wrote it"));
  EXPECT_TRUE(output() == changed) << "it is left for a person";
}

// Packs out.gt3x anew with another info.txt, one more entry, other places of its entries, or bytes
// behind it. Each reader of zip archives takes it.
struct Repack {
  bool other_info = false;
  bool one_more = false;
  bool other_order = false;
  bool bytes_behind = false;
};
void repack(FileSystem& files, const Repack& how) {
  auto recording = gt3x::Recording::open(files, "out.gt3x").value();
  auto entries = recording.entries();
  if (how.other_order) {
    std::swap(entries.at(0), entries.at(1));
  }
  auto writer = gt3x::RecordingWriter::create(files, "changed.gt3x", {}).value();
  for (const gt3x::EntryInfo& entry : entries) {
    if (how.other_info && entry.name == "info.txt") {
      gt3x::Info info = recording.info();
      std::string text = info.serialise();
      const auto at = text.find("MOS2A45130450");
      ASSERT_NE(at, std::string::npos);
      text[at + 12] = '1';
      ASSERT_OK(writer.add(entry.name, text));
    } else {
      ASSERT_OK(writer.copy(recording, entry.name));
    }
  }
  if (how.one_more) {
    ASSERT_OK(writer.add("more.txt", "more"));
  }
  ASSERT_OK(writer.commit());
  ASSERT_OK(files.rename("changed.gt3x", "out.gt3x"));
  if (how.bytes_behind) {
    const Bytes whole = read_file(files, "out.gt3x").value();
    Bytes longer = whole;
    longer.push_back(0);
    ASSERT_OK(files.remove("out.gt3x"));
    ASSERT_OK(files.create("out.gt3x").value()->write_at(0, longer));
  }
}

TEST_F(RepairFile, AnOutputIsDoneAsAWhole) {
  ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
  RepairOptions options;
  options.resume = true;
  for (const auto& [why, how] : {std::pair("info.txt", Repack{true, false, false, false}),
                                 {"one more entry", Repack{false, true, false, false}},
                                 {"another order", Repack{false, false, true, false}},
                                 {"bytes behind it", Repack{false, false, false, true}}}) {
    ASSERT_FALSE(repair(options).resumed) << why;
    repack(memory_.files, how);
    const auto changed = output();
    const RepairReport report = repair(options);
    EXPECT_EQ(report.status, RepairStatus::failed) << why;
    EXPECT_EQ(report.error.value_or(Error{}).code, ErrorCode::cannot_create) << why;
    EXPECT_THAT(report.reasons.back(), testing::HasSubstr("not as that run wrote it")) << why;
    EXPECT_TRUE(output() == changed) << why;
    ASSERT_OK(memory_.files.remove("out.gt3x"));
  }
}

// What an earlier version of the program packed otherwise is done, where no manifest knows it.
TEST_F(RepairFile, AnOutputOfTheSameEntriesIsDoneHoweverItIsPacked) {
  ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
  RepairOptions options;
  const RepairReport first = repair(options);
  options.resume = true;
  options.known_output = KnownOutput{first.input_sha256, first.output_sha256, memory_.clock.now()};
  EXPECT_TRUE(repair(options).resumed);
  auto recording = gt3x::Recording::open(memory_.files, "out.gt3x").value();
  gt3x::WriterOptions stored;
  stored.packing = gt3x::Packing::store;
  auto writer = gt3x::RecordingWriter::create(memory_.files, "changed.gt3x", stored).value();
  for (const gt3x::EntryInfo& entry : recording.entries()) {
    ASSERT_OK(writer.add(entry.name, *recording.open_entry(entry.name).value()));
  }
  ASSERT_OK(writer.commit());
  ASSERT_OK(memory_.files.rename("changed.gt3x", "out.gt3x"));
  EXPECT_EQ(repair(options).status, RepairStatus::failed) << "the manifest knows another hash";
  options.known_output.reset();
  EXPECT_TRUE(repair(options).resumed);
}

TEST_F(RepairFile, ADryRunJudgesTheOutputThatIsThere) {
  ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
  ASSERT_EQ(repair().status, RepairStatus::repaired);
  const auto both_say = [&](RepairOptions options, RepairStatus status, const std::string& reason) {
    const auto before = output();
    options.dry_run = true;
    const RepairReport dry = repair_file(memory_.env, "in.gt3x", "out.gt3x", source_, options);
    EXPECT_TRUE(output() == before);
    options.dry_run = false;
    const RepairReport real = repair_file(memory_.env, "in.gt3x", "out.gt3x", source_, options);
    EXPECT_EQ(dry.status, status) << reason;
    EXPECT_EQ(real.status, status) << reason;
    EXPECT_EQ(dry.reasons, real.reasons);
    EXPECT_EQ(dry.resumed, real.resumed);
    EXPECT_THAT(dry.reasons.back(), testing::HasSubstr(reason));
  };
  RepairOptions resume;
  resume.resume = true;
  both_say({}, RepairStatus::failed, "there already");
  both_say(resume, RepairStatus::repaired, "by an earlier run");
  RepairOptions wide = resume;
  wide.wide = true;
  both_say(wide, RepairStatus::outdated, "--redo-outdated");
  repack(memory_.files, {true, false, false, false});
  both_say(resume, RepairStatus::failed, "not as that run wrote it");
  ASSERT_OK(memory_.files.remove("out.gt3x"));
  ASSERT_OK(write_file(memory_.files, "out.gt3x", "another recording"));
  both_say(resume, RepairStatus::failed, "there already");
}

// Another file takes the input's name before it is opened for the time `before`.
class SwappingFiles final : public ForwardingFiles {
 public:
  SwappingFiles(FileSystem& files, int before) : ForwardingFiles(files), before_(before) {}
  Result<std::unique_ptr<ReadableFile>> open(const std::string& path) override {
    if (path == "in.gt3x" && ++opened_ == before_) {
      SIXPOINT_CHECK(disk().rename("other.gt3x", path));
    }
    return disk().open(path);
  }
  int opened() const { return opened_; }

 private:
  int before_;
  int opened_ = 0;
};

// As a program that copies an archive replaces files: half of the output would be of each.
TEST_F(RepairFile, AFileThatIsReplacedMeanwhileGivesNoOutput) {
  MadeRecording other = six_sides();
  other.start += 3600;
  for (const std::uint64_t one_pass_from : {std::uint64_t{0}, std::uint64_t{1} << 20}) {
    RepairOptions options;
    options.one_pass_from_bytes = one_pass_from;
    int most = 2;
    for (int before = 2; before <= most; ++before) {
      ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
      ASSERT_OK(other.write(memory_.files, "other.gt3x"));
      SwappingFiles files(memory_.files, before);
      Env env{memory_.clock, files};
      const RepairReport report = repair_file(env, "in.gt3x", "out.gt3x", source_, options);
      EXPECT_EQ(report.status, RepairStatus::failed) << before;
      EXPECT_FALSE(exists("out.gt3x")) << before;
      most = files.opened();
      ASSERT_OK(memory_.files.remove("in.gt3x"));
    }
    EXPECT_EQ(most, one_pass_from == 0 ? 2 : 4);
  }
}

// Another program makes the output's name when the temporary file is there.
class MakingFiles final : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  Result<std::unique_ptr<WritableFile>> create(const std::string& path) override {
    SIXPOINT_CHECK(write_file(disk(), "out.gt3x", "theirs"));
    return disk().create(path);
  }
};

TEST_F(RepairFile, WhatCameToTheOutputsNameMeanwhileStays) {
  ASSERT_OK(six_sides().write(memory_.files, "in.gt3x"));
  for (const std::uint64_t one_pass_from : {std::uint64_t{0}, std::uint64_t{1} << 20}) {
    MakingFiles files(memory_.files);
    Env env{memory_.clock, files};
    RepairOptions options;
    options.one_pass_from_bytes = one_pass_from;
    const RepairReport report = repair_file(env, "in.gt3x", "out.gt3x", source_, options);
    EXPECT_EQ(report.status, RepairStatus::failed);
    EXPECT_EQ(report.error.value_or(Error{}).code, ErrorCode::cannot_create);
    EXPECT_EQ(as_text(read_file(memory_.files, "out.gt3x").value()), "theirs");
    ASSERT_OK(memory_.files.remove("out.gt3x"));
  }
}

// A disk that is not mounted, for example.
TEST_F(RepairFile, ALinkThatLeadsNowhereIsNotReplaced) {
  const sixpoint::tests::TemporaryFolder folder;
  ASSERT_OK(six_sides().write(posix_env().files, folder / "in.gt3x"));
  std::filesystem::create_symlink(folder / "away/out.gt3x", folder / "out.gt3x");
  const RepairReport report =
      repair_file(posix_env(), folder / "in.gt3x", folder / "out.gt3x", source_, {});
  EXPECT_EQ(report.status, RepairStatus::failed);
  EXPECT_EQ(report.error.value_or(Error{}).code, ErrorCode::cannot_create);
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "out.gt3x"));
}

// Whoever did what the line says would lose the original: only a link may be removed.
TEST_F(RepairFile, NobodyIsToldToRemoveTheRecordingItself) {
  namespace fs = std::filesystem;
  const sixpoint::tests::TemporaryFolder folder;
  const std::string input = folder / "in.gt3x";
  ASSERT_OK(six_sides().write(posix_env().files, input));
  fs::create_hard_link(input, folder / "hard.gt3x");
  fs::create_symlink(input, folder / "link.gt3x");
  fs::create_directory_symlink(folder.path(), folder / "sub");
  const Bytes before = read_file(posix_env().files, input).value();
  RepairOptions resume;
  resume.resume = true;
  RepairOptions redo = resume;
  redo.redo_outdated = true;
  RepairOptions dry;
  dry.dry_run = true;
  const auto refused = [&](const std::string& from, const std::string& to,
                           const RepairOptions& options) {
    const RepairReport report =
        repair_file(posix_env(), folder / from, folder / to, source_, options);
    EXPECT_EQ(report.status, RepairStatus::failed) << from << " " << to;
    const Error error = report.error.value_or(Error{});
    EXPECT_EQ(error.code, ErrorCode::cannot_create) << from << " " << to;
    return error.what + "; " + error.hint;
  };
  for (const RepairOptions& options : {RepairOptions{}, resume, redo, dry}) {
    for (const auto& [from, to] : {std::pair("in.gt3x", "in.gt3x"),
                                   {"in.gt3x", "hard.gt3x"},
                                   {"in.gt3x", "sub/in.gt3x"},
                                   {"link.gt3x", "link.gt3x"},
                                   {"link.gt3x", "in.gt3x"}}) {
      EXPECT_EQ(refused(from, to, options),
                "this is the recording itself; choose another output folder")
          << from << " " << to;
    }
    EXPECT_EQ(refused("in.gt3x", "link.gt3x", options),
              "this is a link to the recording itself; remove the link, or choose another output "
              "folder");
  }
  EXPECT_EQ(read_file(posix_env().files, input).value(), before);
  fs::remove(folder / "link.gt3x");
  EXPECT_EQ(repair_file(posix_env(), input, folder / "link.gt3x", source_, resume).status,
            RepairStatus::repaired);
}

// Where the rest of a file says something else than its first 100,000 samples, what was written
// until then is dropped; the answer is that of two passes.
TEST_F(RepairFile, WhatTheBeginningSaysNeedNotHold) {
  MadeRecording made = six_sides();
  const auto sides = made.raw;
  while (made.raw.size() < 150'000) {
    made.raw.insert(made.raw.end(), sides.begin(), sides.end());
  }
  const auto end = static_cast<std::uint32_t>(made.start + made.raw.size() / made.rate_hz);
  const auto with_end = [&](const std::function<void(Bytes&)>& put) {
    Bytes log = made.log();
    put(log);
    EXPECT_OK(made.write(memory_.files, "in.gt3x", log));
  };
  // Counts that no integers lead to: half of the file is such.
  with_end([&](Bytes& log) {
    Random random(7);
    std::vector<Counts> samples(made.rate_hz);
    for (std::uint32_t second = 0; second < 5000; ++second) {
      for (Counts& sample : samples) {
        for (std::int16_t& count : sample) {
          count = static_cast<std::int16_t>(random.below(1000));
        }
      }
      Bytes payload;
      gt3x::append_activity(payload, samples);
      gt3x::append_record(log, gt3x::RecordType::activity, end + second, payload);
    }
  });
  EXPECT_EQ(repair().status, RepairStatus::repaired);
  ASSERT_OK(memory_.files.remove("out.gt3x"));
  // Other constants.
  MadeRecording later = made;
  later.constants.zero_lsb = {70, 14, 50};
  later.start = end + 1;
  with_end([&](Bytes& log) {
    const Bytes more = later.log();
    log.insert(log.end(), more.begin(), more.end());
  });
  EXPECT_EQ(repair().status, RepairStatus::repaired);
  ASSERT_OK(memory_.files.remove("out.gt3x"));
  // Constants that cannot be used.
  later.constants = {{1, 1, 1}, {1, 1, 1}, {0, 0, 0}};
  with_end([&](Bytes& log) {
    gt3x::append_record(log, gt3x::RecordType::parameters, end, later.parameters());
  });
  EXPECT_EQ(repair().status, RepairStatus::failed);
  // Another scale, and counts beyond 12 bits.
  with_end([&](Bytes& log) {
    Bytes payload;
    gt3x::append_activity2(payload, std::vector<Counts>(30, Counts{2100, 0, -2100}));
    gt3x::append_record(log, gt3x::RecordType::activity2, end, payload);
  });
  EXPECT_EQ(repair().status, RepairStatus::repaired);
}

TEST_F(RepairFile, ADamagedZipGivesNoOutput) {
  const MadeRecording made = six_sides();
  ASSERT_OK(made.write(memory_.files, "good.gt3x"));
  Bytes bytes = read_file(memory_.files, "good.gt3x").value();
  bytes[bytes.size() / 2] ^= 0x40U;  // inside log.bin: its CRC no longer holds
  auto out = memory_.files.create("in.gt3x").value();
  ASSERT_OK(out->write_at(0, bytes));
  expect_bad_data();
}

TEST_F(RepairFile, SecondParametersHoldFromThereOn) {
  MadeRecording made = six_sides();
  MadeRecording later = made;
  later.constants.zero_lsb = {70, 14, 50};
  later.start = made.start + 70;
  const Bytes first = made.log();
  const Bytes second = later.log();
  Bytes log = first;
  log.insert(log.end(), second.begin(), second.end());
  ASSERT_OK(made.write(memory_.files, "in.gt3x", log));
  const auto report = repair();
  ASSERT_EQ(report.status, RepairStatus::repaired);
  const auto repaired = samples_of(memory_.files, "out.gt3x");
  ASSERT_EQ(repaired.size(), 2 * made.raw.size());
  for (std::size_t i = 0; i < made.raw.size(); ++i) {
    for (std::size_t a = 0; a < kAxes; ++a) {
      EXPECT_NEAR(repaired[i][a], repaired[i + made.raw.size()][a], 1.01);
    }
  }
}

// Round trip on a real affected unit: its own constants again change no sample. Its counts do not
// all have an integer behind them under the constants in its header (none of the real 30 Hz units'
// do).
TEST_F(RepairFile, RealUnitRoundTrip) {
  const char* file = "data/wgt3x-bt-affected/MOS2A45130451.gt3x";
  SIXPOINT_NEED_SHARED(file);
  const std::string path = tests::shared_file(file);
  auto& disk = posix_env().files;
  const auto log = entry_of(disk, path, "log.bin");
  ASSERT_FALSE(log.empty());
  const auto surveyed = survey(disk, path);
  ASSERT_OK(surveyed);
  EXPECT_FALSE(surveyed->plausibility.plausible());
  FixedConstants same(calib::calibration_from(surveyed->constants.at(0)).value());
  same.choice.chosen->record.serial = "MOS2A45130451";
  RepairOptions dry;
  dry.dry_run = true;
  dry.force = true;
  const auto report = repair_file(posix_env(), path, "/nowhere/out.gt3x", same, dry);
  EXPECT_EQ(report.status, RepairStatus::repaired) << report.to_json().dump(1);
  EXPECT_NEAR(report.still_error_before_mg.value(), report.still_error_after_mg.value(), 1e-9);
  EXPECT_GT(report.still_error_before_mg.value(), 64) << "the paper's limit";
}

// A recording of two entries and one damaged record in the middle of its log, cut before its list.
Bytes damaged_recording(const Bytes& log, const std::string& info) {
  const gt3x::tests::MadeArchive made({{"notes/extra.bin", Bytes{1, 2, 3}},
                                       {"info.txt", Bytes(info.begin(), info.end())},
                                       {"log.bin", log}});
  Bytes bytes(made.bytes.begin(),
              made.bytes.begin() + static_cast<std::ptrdiff_t>(made.list_offset));
  bytes[made.data_offsets[2] + log.size() / 2] ^= 0x40U;
  return bytes;
}

TEST_F(RepairFile, SalvageWritesAWholeFileAndBothMarksStateTheLoss) {
  const MadeRecording made = six_sides();
  ASSERT_OK(made.write(memory_.files, "whole.gt3x"));
  const Bytes info = entry_of(memory_.files, "whole.gt3x", "info.txt");
  const Bytes damaged = damaged_recording(made.log(), std::string(as_text(info)));
  ASSERT_OK(write_file(memory_.files, "in.gt3x", as_text(damaged)));
  EXPECT_NE(expect_bad_data(), "");
  RepairOptions options;
  options.salvage = true;
  const RepairReport report = repair(options);
  ASSERT_EQ(report.status, RepairStatus::repaired) << report.to_json().dump(1);
  EXPECT_EQ(read_file(memory_.files, "in.gt3x").value(), damaged) << "the original was touched";
  EXPECT_GE(report.losses.size(), 3U);  // the list, the CRC, the record
  // The output is whole: it is read without the option, and what is missing is one second.
  const auto repaired = survey(memory_.files, "out.gt3x");
  ASSERT_OK(repaired);
  EXPECT_EQ(repaired->samples, made.raw.size() - made.rate_hz);
  EXPECT_EQ(repaired->log.checksum_failures + repaired->log.damaged_stretches, 0U);
  EXPECT_LT(repaired->magnitude.mean_mg, 2);
  EXPECT_EQ(entry_of(memory_.files, "out.gt3x", "notes/extra.bin"), (Bytes{1, 2, 3}));
  const auto mark = mark_in(memory_.files, "out.gt3x").value();
  ASSERT_EQ(mark["losses"].size(), report.losses.size());
  EXPECT_NE(mark["losses"].back()["from"], nullptr);
  const Bytes log = entry_of(memory_.files, "out.gt3x", "log.bin");
  gt3x::LogReader reader(std::make_unique<gt3x::MemorySource>(log));
  const auto record = nlohmann::ordered_json::parse(as_text(reader.next().value()->record.payload));
  EXPECT_EQ(record["MetadataType"], kRepairMarkType);
  EXPECT_EQ(record["InputSha256"], to_hex(sha256(damaged)));
  EXPECT_EQ(record["LossCount"], report.losses.size());
  EXPECT_EQ(record["Losses"].back()["why"], mark["losses"].back()["why"]);
  options.resume = true;
  EXPECT_TRUE(repair(options).resumed);
}

TEST_F(RepairFile, SalvageWritesAFileThatNeedsNoRepairAndDoesNotCallItRepaired) {
  MadeRecording made = six_sides();
  made.firmware = "1.8.0";
  ASSERT_OK(made.write(memory_.files, "whole.gt3x"));
  const Bytes info = entry_of(memory_.files, "whole.gt3x", "info.txt");
  ASSERT_OK(write_file(memory_.files, "in.gt3x",
                       as_text(damaged_recording(made.log(), std::string(as_text(info))))));
  RepairOptions options;
  options.salvage = true;
  const RepairReport report = repair(options);
  ASSERT_EQ(report.status, RepairStatus::not_affected) << report.to_json().dump(1);
  EXPECT_EQ(report.method, "salvage");
  EXPECT_EQ(report.output, "out.gt3x");
  const auto written = survey(memory_.files, "out.gt3x");
  ASSERT_OK(written);
  EXPECT_FALSE(written->already_repaired);
  EXPECT_EQ(written->samples, made.raw.size() - made.rate_hz);
  EXPECT_FALSE(entry_of(memory_.files, "out.gt3x", kSalvageMark).empty());
  EXPECT_EQ(mark_in(memory_.files, "out.gt3x").value()["losses"].size(), report.losses.size());
  options.resume = true;
  const RepairReport again = repair(options);
  EXPECT_TRUE(again.resumed);
  EXPECT_EQ(again.status, RepairStatus::not_affected);
}

TEST_F(RepairFile, SalvageOfADamagedFileOfTheOldFormIsNotAffected) {
  tests::OldRecording made;
  made.raw = six_sides().raw;
  ASSERT_OK(made.write(memory_.files, "whole.gt3x"));
  Bytes bytes = read_file(memory_.files, "whole.gt3x").value();
  bytes[bytes.size() - 22 + 16] ^= 0xFFU;  // where the list of entries begins
  ASSERT_OK(write_file(memory_.files, "in.gt3x", as_text(bytes)));
  RepairOptions options;
  options.salvage = true;
  const RepairReport report = repair(options);
  EXPECT_EQ(report.status, RepairStatus::not_affected) << report.to_json().dump(1);
  EXPECT_FALSE(report.losses.empty());
  EXPECT_FALSE(exists("out.gt3x"));
}

}  // namespace
}  // namespace sixpoint::repair
