#include "repair/rescale/applying_constants.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace sixpoint::repair {
namespace {

using calib::FilterConfiguration;
using testing::HasSubstr;

// A unit's sets of constants, as the store has them.
class Sets {
 public:
  // A set of day `day`, whose zeros stand `shift_mg` beside those of the others.
  std::string add(const std::string& kind, int day, double uncertainty_mg, double shift_mg = 0,
                  FilterConfiguration filter = FilterConfiguration::current) {
    calib::ConstantsRecord record;
    record.serial = "MOS2A1";
    record.filter = filter;
    record.calibration = {{0.004, 0.004, 0.004}, {}};
    record.calibration.zero_lsb.fill(10 + shift_mg / 4);
    record.stored = {{260, 260, 260}, {-240, -240, -240}, {10, 10, 10}};
    record.uncertainty.zero_mg.fill(uncertainty_mg);
    record.made_from.kind = kind;
    db::ConstantsRecord row;
    row.id = fmt::format("set {}", history.constants.size());
    row.serial = record.serial;
    row.filter = std::string(calib::to_string(filter));
    row.method = "least_squares";
    row.made_at = from_unix_seconds(86'400LL * day);
    row.document = calib::to_json(record).dump();
    history.constants.push_back(row);
    return row.id;
  }
  void correct(const std::string& id, const std::string& action) {
    history.corrections.push_back({"", {}, "constants", id, action, "Ada", "because"});
  }
  // The id of the set that applies, "conflict" or "none".
  std::string applying() const {
    const Applying answer = applying_constants(history, FilterConfiguration::current);
    EXPECT_EQ(answer.about.size(), history.constants.size());
    if (answer.index) {
      EXPECT_THAT(answer.about[*answer.index], testing::StartsWith(answer.why));
      EXPECT_THAT(answer.why, testing::StartsWith("applies"));
      return history.constants[*answer.index].id;
    }
    return answer.conflict ? "conflict" : "none";
  }
  std::string why() const { return applying_constants(history, FilterConfiguration::current).why; }

  db::UnitHistory history;
};

TEST(ApplyingConstants, WithoutSetsNothingApplies) { EXPECT_EQ(Sets().applying(), "none"); }

TEST(ApplyingConstants, WithdrawnAndOtherFiltersNever) {
  Sets sets;
  const auto withdrawn = sets.add("jig", 3, 1);
  sets.correct(withdrawn, "withdraw");
  sets.add("jig", 4, 1, 0, FilterConfiguration::legacy);
  EXPECT_EQ(sets.applying(), "none");
  const auto scan = sets.add("file_scan", 1, 9);
  EXPECT_EQ(sets.applying(), scan);
  const auto about = applying_constants(sets.history, FilterConfiguration::current).about;
  EXPECT_THAT(about[0], HasSubstr("withdrawn"));
  EXPECT_THAT(about[1], HasSubstr("filter"));
  sets.correct(withdrawn, "reinstate");
  EXPECT_EQ(sets.applying(), withdrawn);
}

TEST(ApplyingConstants, WhatWasWithdrawnIsNamedWhereNothingApplies) {
  const auto withdrawn = [](const Sets& sets) {
    return applying_constants(sets.history, FilterConfiguration::current).withdrawn;
  };
  Sets sets;
  EXPECT_EQ(withdrawn(sets), "");
  sets.correct(sets.add("jig", 1, 1, 0, FilterConfiguration::legacy), "withdraw");
  EXPECT_EQ(withdrawn(sets), "") << "of another configuration";
  sets.correct(sets.add("jig", 2, 1), "withdraw");
  EXPECT_EQ(withdrawn(sets), "set 1 on 1970-01-01 (because)");
  for (int day = 3; day < 6; ++day) {
    sets.correct(sets.add("jig", day, 1), "withdraw");
  }
  EXPECT_EQ(withdrawn(sets),
            "set 4 on 1970-01-01 (because), set 3 on 1970-01-01 (because), set 2 on 1970-01-01 "
            "(because) and 1 more");
  sets.add("file_scan", 1, 9);
  EXPECT_EQ(withdrawn(sets), "") << "one applies";
}

TEST(ApplyingConstants, TheMethodComesFirst) {
  Sets sets;
  const auto scan = sets.add("file_scan", 3, 0.5);
  EXPECT_EQ(sets.applying(), scan);
  const auto file = sets.add("calibration_file", 2, 1);
  EXPECT_EQ(sets.applying(), file);
  const auto jig = sets.add("jig", 1, 2);
  EXPECT_EQ(sets.applying(), jig);
  EXPECT_THAT(sets.why(), HasSubstr("jig comes first"));
}

TEST(ApplyingConstants, AnOlderSetOfABetterMethodThatANewerOneContradictsIsForAPerson) {
  Sets sets;
  const auto jig = sets.add("jig", 1, 1);
  const auto scan = sets.add("file_scan", 2, 1, 40);
  EXPECT_EQ(sets.applying(), "conflict");
  EXPECT_THAT(sets.why(), HasSubstr("store prefer"));
  sets.correct(scan, "prefer");
  EXPECT_EQ(sets.applying(), scan);
  sets.correct(jig, "prefer");
  EXPECT_EQ(sets.applying(), jig) << "the last word";
  EXPECT_THAT(sets.why(), HasSubstr("because"));
}

TEST(ApplyingConstants, WithinTheUncertaintiesOrOlderItIsNoConflict) {
  Sets within;
  const auto jig = within.add("jig", 1, 10);
  within.add("file_scan", 2, 10, 40);
  EXPECT_EQ(within.applying(), jig) << "3 sqrt(10^2 + 10^2) + 10 = 52 mg are allowed";
  Sets older;
  const auto newer_jig = older.add("jig", 3, 1);
  older.add("file_scan", 2, 1, 40);
  EXPECT_EQ(older.applying(), newer_jig);
}

TEST(ApplyingConstants, ASetOfTheSameMethodThatDisagreesIsSaid) {
  Sets sets;
  const auto first = sets.add("file_scan", 1, 2);
  const auto doubt = [&] {
    return applying_constants(sets.history, FilterConfiguration::current).doubt;
  };
  EXPECT_EQ(doubt(), "");
  sets.add("file_scan", 2, 2, 15);
  EXPECT_EQ(doubt(), "") << "3 sqrt(2^2 + 2^2) + 10 = 18 mg are allowed";
  const auto other = sets.add("file_scan", 3, 2, 115);
  EXPECT_EQ(sets.history.constants.back().id, other);
  const Applying answer = applying_constants(sets.history, FilterConfiguration::current);
  EXPECT_EQ(sets.history.constants[answer.index.value()].id, other) << "the latest all the same";
  EXPECT_THAT(answer.doubt,
              HasSubstr("the store's set set 0 of 1970-01-02 disagrees with this one"));
  EXPECT_THAT(answer.about[2],
              testing::AllOf(HasSubstr("applies: the latest"), HasSubstr("115.0 mg")));
  sets.correct(first, "prefer");
  EXPECT_EQ(doubt(), "") << "a person has decided";
}

TEST(ApplyingConstants, OfOneMethodTheSmallestUncertaintyThenTheLatest) {
  Sets sets;
  const auto sure = sets.add("jig", 1, 1);
  sets.add("jig", 2, 2);
  EXPECT_EQ(sets.applying(), sure);
  EXPECT_THAT(sets.why(), HasSubstr("smallest uncertainty"));
  const auto equal = sets.add("jig", 3, 1.05);
  EXPECT_EQ(sets.applying(), equal) << "5 % more is no difference";
  sets.add("jig", 4, 0);
  EXPECT_EQ(sets.applying(), equal) << "no stated uncertainty comes last";
}

TEST(ApplyingConstants, WithoutAnyUncertaintyTheLatestAndOfEqualsTheLastStored) {
  Sets sets;
  const auto late = sets.add("jig", 5, 0);
  sets.add("jig", 4, 0);
  EXPECT_EQ(sets.applying(), late);
  const auto same_day = sets.add("jig", 5, 0);
  EXPECT_EQ(sets.applying(), same_day);
  sets.correct(same_day, "withdraw");
  sets.correct(late, "note");
  EXPECT_EQ(sets.applying(), late);
}

TEST(ApplyingConstants, SetsOfEarlierVersionsAreToldByTheirMethod) {
  Sets sets;
  sets.add("", 1, 1);
  EXPECT_EQ(kind_of(sets.history.constants[0]), ConstantsKind::file_scan);
  sets.history.constants[0].method = "six_pose_pair";
  EXPECT_EQ(kind_of(sets.history.constants[0]), ConstantsKind::jig);
  sets.history.constants[0].document = "no JSON";
  EXPECT_EQ(sets.applying(), "set 0") << "what cannot be read is not compared";
}

TEST(ApplyingConstants, WhatIsSaidOfASetThatWasStoredFollowsTheTable) {
  Sets sets;
  const auto said = [&](const std::string& id, int today) {
    return said_of_stored(sets.history, FilterConfiguration::current, id,
                          from_unix_seconds(86'400LL * today));
  };
  const auto first = sets.add("jig", 10, 1);
  EXPECT_EQ(said(first, 10), "");
  const auto other = sets.add("jig", 11, 1, 100);
  EXPECT_THAT(said(other, 11), HasSubstr("disagrees with this one"));
  const auto earlier = sets.add("jig", 9, 1);
  EXPECT_EQ(said(earlier, 11),
            "the set set 2 was stored, but set 1 of 1970-01-12 applies: the latest by jig; where "
            "that one is wrong: 'sixpoint store withdraw set 1 --why TEXT'");
  EXPECT_EQ(said(earlier, 10),
            "the set set 2 was stored, but set 1 of 1970-01-12 applies: the latest by jig, its "
            "date is in the future, so a clock was ahead or this one is behind; where that one is "
            "wrong: 'sixpoint store withdraw set 1 --why TEXT'");
  const auto scan = sets.add("file_scan", 12, 1, -100);
  EXPECT_THAT(said(scan, 12), HasSubstr("'sixpoint store prefer ID --why TEXT'"));
  sets.correct(other, "withdraw");
  sets.correct(scan, "withdraw");
  EXPECT_EQ(said(first, 12), "");
}

}  // namespace
}  // namespace sixpoint::repair
