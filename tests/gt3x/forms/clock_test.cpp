#include "gt3x/forms/clock.h"

#include <gmock/gmock.h>

#include "base/bytes.h"
#include "expect_result.h"

namespace sixpoint::gt3x {
namespace {

using testing::HasSubstr;

// What METADATA records and lines of info.txt say together.
Clock clock_of(const std::vector<std::string>& metadata, const std::string& info = "Sex: x\r\n",
               bool raw_counts = false, bool old_form = false) {
  ClockEvidence evidence;
  evidence.raw_counts = raw_counts;
  evidence.old_form = old_form;
  const auto parsed = Info::parse(info);
  EXPECT_OK(parsed);
  evidence.take_info(*parsed);
  for (const std::string& text : metadata) {
    evidence.take_metadata(as_bytes(text));
  }
  return which_clock(evidence);
}

constexpr const char* kLocalTimeLog =
    R"({"MetadataType":"LocalTimeLog","UtcOffset":"-04:00:00","Parsed":true})";
constexpr const char* kUsedUtc = R"({"MetadataType":"LocalTimeLog","UsedUtc":true})";
constexpr const char* kSubjectTimeLog =
    R"({"MetadataType":"SubjectTimeLog","UtcOffset":"-06:00:00","Name":"(UTC-06:00) Central"})";
constexpr const char* kTimeZone = "TimeZone: -05:00:00\r\n";

std::string owner(const std::string& system) {
  return R"({"MetadataType":"InitOwner","System":")" + system + "\"}";
}

// The table in the header, row by row.
TEST(Clock, FollowsTheTable) {
  const Clock used_utc = clock_of({kUsedUtc, kSubjectTimeLog, owner("ActiLife")}, kTimeZone);
  EXPECT_EQ(used_utc.kind, ClockKind::utc) << "the record says so, any program may have written it";
  EXPECT_EQ(used_utc.offset_minutes, -360);
  EXPECT_EQ(clock_of({kUsedUtc}, kTimeZone).offset_minutes, -300);
  EXPECT_EQ(clock_of({kUsedUtc}).offset_minutes, std::nullopt);

  const Clock not_utc =
      clock_of({R"({"MetadataType":"LocalTimeLog","UtcOffset":"02:00:00","UsedUtc":false})",
                owner("CentrePoint")},
               kTimeZone);
  EXPECT_EQ(not_utc.kind, ClockKind::local);
  EXPECT_EQ(not_utc.offset_minutes, 120);

  for (const char* system : {"CentrePoint", "Centre Point 3", "StudyAdmin", "Study Admin"}) {
    const Clock portal = clock_of({owner(system)}, kTimeZone);
    EXPECT_EQ(portal.kind, ClockKind::utc) << system;
    EXPECT_EQ(portal.offset_minutes, -300);
    EXPECT_THAT(portal.why, HasSubstr(system));
  }
  EXPECT_EQ(clock_of({}, "Download Software: CentrePoint\r\nTimeZone: 01:30:00\r\n").offset_minutes,
            90);

  EXPECT_EQ(clock_of({kLocalTimeLog}).kind, ClockKind::local);
  EXPECT_EQ(clock_of({kLocalTimeLog}, kTimeZone).offset_minutes, -240);
  EXPECT_EQ(clock_of({owner("ActiLife")}, kTimeZone).kind, ClockKind::local);
  EXPECT_EQ(clock_of({owner("ActiLife")}, kTimeZone).offset_minutes, -300);

  EXPECT_EQ(clock_of({}, kTimeZone, /*raw_counts=*/true).kind, ClockKind::utc);
  EXPECT_EQ(clock_of({}, kTimeZone, true).offset_minutes, -300);

  const Clock old = clock_of({}, "Sex: x\r\n", false, /*old_form=*/true);
  EXPECT_EQ(old.kind, ClockKind::local);
  EXPECT_EQ(old.offset_minutes, std::nullopt);

  ClockEvidence offset_only;
  offset_only.unit_offset_minutes = 60;
  EXPECT_EQ(which_clock(offset_only).kind, ClockKind::utc);
  EXPECT_EQ(which_clock(offset_only).offset_minutes, 60);

  EXPECT_EQ(clock_of({}, kTimeZone).kind, ClockKind::unknown);
  EXPECT_EQ(clock_of({}, kTimeZone).offset_minutes, std::nullopt);
}

TEST(Clock, HostileMetadataSaysNothing) {
  for (const std::string& text :
       {std::string("no JSON"), std::string("[1]"), std::string("{\"MetadataType\":7}"),
        std::string(R"({"MetadataType":"LocalTimeLogs","UsedUtc":true})"), std::string(60'000, '['),
        std::string(R"({"MetadataType":"SubjectTimeLog","UtcOffset":"99:00:00"})")}) {
    EXPECT_EQ(clock_of({text}).kind, ClockKind::unknown) << text.substr(0, 40);
  }
  const Clock odd = clock_of({R"({"MetadataType":"LocalTimeLog","UsedUtc":"true"})"});
  EXPECT_EQ(odd.kind, ClockKind::local) << "only true is true";
}

TEST(Clock, TimesAreSaidWithTheirOffset) {
  constexpr std::int64_t kTime = 1'428'588'240;  // 14:04 as the file has it
  EXPECT_EQ(clock_time({ClockKind::local, -240, ""}, kTime), "2015-04-09T14:04:00-04:00");
  EXPECT_EQ(clock_time({ClockKind::local, std::nullopt, ""}, kTime), "2015-04-09T14:04:00");
  EXPECT_EQ(clock_time({ClockKind::utc, -300, ""}, kTime), "2015-04-09T09:04:00-05:00");
  EXPECT_EQ(clock_time({ClockKind::utc, 330, ""}, kTime), "2015-04-09T19:34:00+05:30");
  EXPECT_EQ(clock_time({ClockKind::utc, 0, ""}, kTime), "2015-04-09T14:04:00+00:00");
  EXPECT_EQ(clock_time({ClockKind::utc, std::nullopt, ""}, kTime), "2015-04-09T14:04:00Z");
  EXPECT_EQ(clock_time({ClockKind::unknown, std::nullopt, ""}, kTime), "2015-04-09T14:04:00");
  const UtcTime half = from_unix_seconds(kTime) + from_seconds(0.5);
  EXPECT_EQ(clock_time({ClockKind::utc, -300, ""}, half), "2015-04-09T09:04:00.5-05:00");
  EXPECT_EQ(clock_time({ClockKind::unknown, std::nullopt, ""}, half), "2015-04-09T14:04:00.5");
}

TEST(Clock, OffsetsAreReadInTheirForms) {
  EXPECT_EQ(parse_offset("-05:00:00"), -300);
  EXPECT_EQ(parse_offset("02:00:00"), 120);
  EXPECT_EQ(parse_offset("+05:30"), 330);
  EXPECT_EQ(parse_offset("14:00:00"), 840);
  for (const char* text :
       {"", "-", "5", "05:", "05:00:00:00", "14:01:00", "05:60:00", "UTC", "--5:00"}) {
    EXPECT_EQ(parse_offset(text), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace sixpoint::gt3x
