#include "gt3x/second_order.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

namespace sixpoint::gt3x {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::size_t kSecondOf = 3;  // samples

// A record of the second `time`, with `samples` equal samples of `value`; 0: a one-byte record.
Second record(std::uint32_t time, std::size_t samples = kSecondOf, std::int16_t value = 1,
              GapKind missing_before = GapKind::unexplained) {
  Second second;
  second.unix_time = time;
  second.offset = time;
  second.counts.assign(samples, Counts{value, value, value});
  second.missing_before = missing_before;
  return second;
}

// What comes out: "5", "6 usb", "7+3 unexplained", "10+9000 unexplained left out", "3 leapt".
std::vector<std::string> given(SecondOrder& order) {
  std::vector<std::string> out;
  while (const auto ordered = order.next()) {
    std::string text = std::to_string(ordered->unix_time);
    if (ordered->missing > 0) {
      text += fmt::format("+{} {}{}", ordered->missing, to_string(ordered->gap),
                          ordered->filled ? "" : " left out");
    } else {
      text += ordered->second.counts.empty() ? " usb" : "";
    }
    text += ordered->leapt ? " leapt" : "";
    out.push_back(std::move(text));
  }
  return out;
}

std::vector<std::string> said(const SecondOrder& order) {
  std::vector<std::string> out;
  for (const Irregular::Place& place : order.irregular().places) {
    out.push_back(fmt::format("{} {}{}", to_string(place.kind), place.unix_time,
                              place.value != 0 ? fmt::format(" {}", place.value) : ""));
  }
  return out;
}

struct Answer {
  std::vector<std::string> given;
  std::vector<std::string> said;
};

Answer ordered(std::vector<Second> records, std::uint64_t limit_s = kUsualFillLimit_s) {
  SecondOrder order(kSecondOf, limit_s);
  for (Second& second : records) {
    order.push(std::move(second));
  }
  order.end();
  Answer answer;
  answer.given = given(order);
  answer.said = said(order);
  return answer;
}

TEST(SecondOrder, SecondsThatFollowEachOtherComeAsTheyAre) {
  SecondOrder order(kSecondOf);
  order.push(record(5));
  order.push(record(6));
  order.push(record(7));
  EXPECT_THAT(given(order), ElementsAre("5", "6")) << "the last may still be repeated";
  order.end();
  EXPECT_THAT(given(order), ElementsAre("7"));
  EXPECT_FALSE(order.irregular().any());
}

TEST(SecondOrder, SecondsThatAreMissingAreAGap) {
  const Answer answer = ordered({record(5), record(9)});
  EXPECT_THAT(answer.given, ElementsAre("5", "6+3 unexplained", "9"));
  EXPECT_THAT(answer.said, IsEmpty());
}

TEST(SecondOrder, ALeapThatNothingExplainsIsNotFilled) {
  EXPECT_THAT(ordered({record(5), record(5 + 3601)}).given,
              ElementsAre("5", "6+3600 unexplained", "3606"));
  const Answer leap = ordered({record(5), record(5 + 3602)});
  EXPECT_THAT(leap.given, ElementsAre("5", "6+3601 unexplained left out", "3607"));
  EXPECT_THAT(leap.said, ElementsAre("jump 3607 3602"));
}

// The table of fills_gap().
TEST(SecondOrder, FillsGapsByTheTable) {
  for (const GapKind kind : {GapKind::idle_sleep, GapKind::usb}) {
    EXPECT_TRUE(fills_gap(kind, 1'000'000, kUsualFillLimit_s));
    EXPECT_TRUE(fills_gap(kind, 10, 0)) << "the limit is for what is not explained";
  }
  for (const GapKind kind : {GapKind::damaged, GapKind::unexplained}) {
    EXPECT_TRUE(fills_gap(kind, 3600, kUsualFillLimit_s));
    EXPECT_FALSE(fills_gap(kind, 3601, kUsualFillLimit_s));
    EXPECT_TRUE(fills_gap(kind, 3601, 3601));
    EXPECT_FALSE(fills_gap(kind, 11, 10));
  }
}

TEST(SecondOrder, SleepExplainsALeapAndTheLimitMovesIt) {
  EXPECT_THAT(ordered({record(5), record(90'006, 3, 1, GapKind::idle_sleep)}).given,
              ElementsAre("5", "6+90000 idle_sleep", "90006"));
  EXPECT_THAT(ordered({record(5), record(90'006)}, 90'000).given,
              ElementsAre("5", "6+90000 unexplained", "90006"));
  const Answer lowered = ordered({record(5), record(9), record(12)}, 2);
  EXPECT_THAT(lowered.given,
              ElementsAre("5", "6+3 unexplained left out", "9", "10+2 unexplained", "12"));
  EXPECT_THAT(lowered.said, IsEmpty()) << "so short a gap is no leap of the clock";
}

TEST(SecondOrder, OfASecondThatIsRepeatedOneRecordIsWritten) {
  const Answer same = ordered({record(5), record(6), record(6), record(7)});
  EXPECT_THAT(same.given, ElementsAre("5", "6", "7"));
  EXPECT_THAT(same.said, ElementsAre("repeated 6"));

  SecondOrder order(kSecondOf);
  order.push(record(5, 3, 1));
  order.push(record(5, 3, 2));
  order.end();
  EXPECT_EQ(order.next()->second.counts, record(5, 3, 1).counts) << "the first of two equal ones";
  EXPECT_THAT(said(order), ElementsAre("repeated_otherwise 5"));

  SecondOrder longer(kSecondOf);
  longer.push(record(5, 1, 1));
  longer.push(record(5, 3, 2));
  longer.end();
  EXPECT_EQ(longer.next()->second.counts, record(5, 3, 2).counts) << "the one with more samples";
}

TEST(SecondOrder, ARepetitionMayComeLongAfter) {
  const Answer answer = ordered({record(5), record(6), record(7), record(8), record(6), record(9)});
  EXPECT_THAT(answer.given, ElementsAre("5", "6", "7", "8", "9"));
  EXPECT_THAT(answer.said, ElementsAre("repeated 6"));
}

TEST(SecondOrder, OfAOneByteRecordAndSamplesTheSamplesAreWritten) {
  for (const bool usb_first : {true, false}) {
    const Answer answer =
        ordered({record(5), record(6, usb_first ? 0 : 3), record(6, usb_first ? 3 : 0), record(7)});
    EXPECT_THAT(answer.given, ElementsAre("5", "6", "7"));
    EXPECT_THAT(answer.said, ElementsAre("usb_and_samples 6"));
  }
  const Answer alone = ordered({record(5), record(6, 0), record(7)});
  EXPECT_THAT(alone.given, ElementsAre("5", "6 usb", "7"));
  EXPECT_THAT(ordered({record(6, 0), record(6, 0)}).said, ElementsAre("repeated 6"));
}

// What was said about the seconds before it holds for whichever record is written.
TEST(SecondOrder, TheReasonForAGapSurvivesARepetition) {
  EXPECT_THAT(ordered({record(5), record(9, 0, 1, GapKind::idle_sleep), record(9)}).given,
              ElementsAre("5", "6+3 idle_sleep", "9"));
}

TEST(SecondOrder, RecordsThatChangedPlacesArePutInOrder) {
  const Answer answer = ordered({record(5), record(7), record(6), record(8)});
  EXPECT_THAT(answer.given, ElementsAre("5", "6", "7", "8"));
  EXPECT_THAT(answer.said, ElementsAre("out_of_order 6"));
  const Answer first = ordered({record(6), record(5), record(7)});
  EXPECT_THAT(first.given, ElementsAre("5", "6", "7"));
  EXPECT_THAT(first.said, ElementsAre("out_of_order 5"));
}

TEST(SecondOrder, ALateRecordIsPutInItsPlaceAsLongAsTheOthersWait) {
  std::vector<Second> records;
  for (std::uint32_t time = 0; time < 3000; ++time) {
    if (time != 10) {
      records.push_back(record(time));
    }
  }
  records.push_back(record(10));
  const Answer late = ordered(records);
  EXPECT_EQ(late.given.size(), 3000U);
  EXPECT_THAT(late.said, ElementsAre("out_of_order 10"));

  records.pop_back();
  for (std::uint32_t time = 3000; time < 4000; ++time) {
    records.push_back(record(time));
  }
  records.push_back(record(10));
  const Answer too_late = ordered(records);
  EXPECT_EQ(too_late.given.size(), 4000U);
  EXPECT_EQ(too_late.given[10], "10+1 unexplained");
  EXPECT_THAT(too_late.said, ElementsAre("late 10"));
}

// A clock that is set back, by little or much, loses nothing that is of a time of its own.
TEST(SecondOrder, WhatComesBeforeTheFirstWhenThatIsGivenIsAJump) {
  const Answer answer = ordered(
      {record(100), record(101), record(98), record(99), record(100), record(101), record(102)});
  EXPECT_THAT(answer.given, ElementsAre("100", "101", "98 leapt", "99", "102 leapt"));
  EXPECT_THAT(answer.said, ElementsAre("jump 98 -3", "repeated 100", "repeated 101"));
}

// No second is missing that was written before the clock was set back, however far it then goes.
TEST(SecondOrder, SecondsThatWereWrittenBeforeAreNoGap) {
  for (const std::uint64_t limit_s :
       {std::uint64_t{0}, kUsualFillLimit_s, std::uint64_t{100'000}}) {
    const Answer answer = ordered({record(20'000), record(20'001), record(20'003), record(5000),
                                   record(5001), record(20'000), record(20'003), record(20'004)},
                                  limit_s);
    const char* const between =
        limit_s > 14'998 ? "5002+14998 unexplained" : "5002+14998 unexplained left out";
    const char* const hole = limit_s > 0 ? "20002+1 unexplained" : "20002+1 unexplained left out";
    EXPECT_THAT(answer.given, ElementsAre("20000", "20001", hole, "20003", "5000 leapt", "5001",
                                          between, "20004 leapt"));
  }
}

// A clock that was wrong for one record, ahead or back; the others go on as if it were not there.
TEST(SecondOrder, OneWrongTimeIsTwoJumps) {
  const Answer ahead = ordered({record(5000), record(5001), record(264'201), record(5003)});
  EXPECT_THAT(ahead.given, ElementsAre("5000", "5001", "5002+259199 unexplained left out", "264201",
                                       "5003 leapt"));
  EXPECT_THAT(ahead.said, ElementsAre("jump 264201 259200", "jump 5003 -259198"));
  const Answer back = ordered({record(5000), record(5001), record(7), record(5003)});
  EXPECT_THAT(back.given, ElementsAre("5000", "5001", "7 leapt", "8+4992 unexplained left out",
                                      "5002+1 unexplained left out leapt", "5003"));
}

// A clock that was set back goes on, and no second is written twice.
TEST(SecondOrder, AClockThatIsSetBackWritesNoSecondTwice) {
  std::vector<Second> records;
  for (std::uint32_t time = 10'000; time < 10'010; ++time) {
    records.push_back(record(time));
  }
  records.push_back(record(5000));
  records.push_back(record(5001));
  records.push_back(record(10'003));
  records.push_back(record(10'010));
  const Answer answer = ordered(records);
  std::vector<std::string> sorted = answer.given;
  std::ranges::sort(sorted);
  EXPECT_EQ(std::ranges::adjacent_find(sorted), sorted.end());
  EXPECT_THAT(answer.said, ElementsAre("jump 5000 -5009", "repeated 10003", "jump 10010 7"));
  EXPECT_THAT(answer.given, testing::Contains("5002+4998 unexplained left out"));
}

TEST(SecondOrder, SecondsOfAnotherSizeAreSaid) {
  const Answer answer = ordered({record(5, 3), record(6, 2), record(7, 4)});
  EXPECT_THAT(answer.given, ElementsAre("5", "6", "7"));
  EXPECT_THAT(answer.said, ElementsAre("odd_size 6 2", "odd_size 7 4"));
  SecondOrder any(0);
  any.push(record(5, 2));
  any.end();
  EXPECT_FALSE(any.irregular().any());
}

// Hostile input costs bounded memory: the places that are listed, the runs of a clock that leaps at
// every record, what waits.
TEST(SecondOrder, HostileTimesCostBoundedWork) {
  SecondOrder order(kSecondOf);
  std::uint32_t time = 0;
  std::size_t seconds = 0;
  for (std::uint32_t i = 0; i < 50'000; ++i) {
    time = (time + 1'000'000'007U) & 0xFFFFFFFFU;
    order.push(record(time));
    while (const auto one = order.next()) {
      seconds += one->missing == 0 ? 1 : 0;
    }
  }
  order.end();
  EXPECT_LE(seconds, SecondOrder::kMostRuns + 1);
  EXPECT_GT(order.irregular().count(IrregularKind::jump), 40'000U);
  EXPECT_LE(order.irregular().places.size(), Irregular::kKinds * Irregular::kMostListed);
  // The last second that there is.
  EXPECT_THAT(ordered({record(0xFFFFFFFE), record(0xFFFFFFFF)}).given,
              ElementsAre("4294967294", "4294967295"));
}

}  // namespace
}  // namespace sixpoint::gt3x
