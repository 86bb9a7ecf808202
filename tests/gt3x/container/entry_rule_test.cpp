#include "gt3x/container/entry_rule.h"

#include <gmock/gmock.h>

namespace sixpoint::gt3x {
namespace {

using testing::HasSubstr;

TEST(EntryRule, NamesStayInside) {
  for (const char* name : {"log.bin", "notes/extra.bin", ".DS_Store", "__MACOSX/._log.bin", "a b",
                           "a..b", "notes\\extra.bin", "./a", "ab:c"}) {
    EXPECT_TRUE(stays_inside(name)) << name;
  }
  for (const char* name : {"", "/a", "\\a", "../a", "a/../b", "a/..", "..\\a", "a\\..\\b", "C:a",
                           "c:\\a", "..", "a\nb"}) {
    EXPECT_FALSE(stays_inside(name)) << name;
  }
  EXPECT_TRUE(stays_inside(std::string(255, 'a')));
  EXPECT_FALSE(stays_inside(std::string(256, 'a')));
  EXPECT_FALSE(stays_inside("a/"));
}

TEST(EntryRule, FollowsTheTable) {
  const ArchiveLimits limits;
  EntryHeader header;
  header.name = "log.bin";
  header.size = 1000;
  header.packed_size = 400;
  header.method = kMethodDeflate;
  EXPECT_FALSE(why_refused(header, limits));
  EntryHeader outside = header;
  outside.name = "../log.bin";
  EXPECT_THAT(why_refused(outside, limits)->what, HasSubstr("path leaves it"));
  EntryHeader link = header;
  link.symbolic_link = true;
  EXPECT_THAT(why_refused(link, limits)->what, HasSubstr("symbolic link"));
  EntryHeader secret = header;
  secret.encrypted = true;
  EXPECT_THAT(why_refused(secret, limits)->what, HasSubstr("encrypted"));
  EntryHeader packed = header;
  packed.method = 9;
  EXPECT_THAT(why_refused(packed, limits)->what, HasSubstr("deflate64"));
  packed.method = 97;
  EXPECT_THAT(why_refused(packed, limits)->what, HasSubstr("method 97"));
  for (const EntryHeader& refused : {outside, link, secret, packed}) {
    EXPECT_FALSE(why_refused(refused, limits)->hint.empty());
  }
}

TEST(EntryRule, LimitsAreOptions) {
  ArchiveLimits limits;
  EXPECT_TRUE(limits.allow(limits.ratio_matters_from_bytes, 1));
  EXPECT_FALSE(limits.allow(limits.ratio_matters_from_bytes * 2, 1));
  EXPECT_TRUE(limits.allow(300'000'000, 1'000'000));
  EXPECT_FALSE(limits.allow(302'000'000, 1'000'000));
  EXPECT_FALSE(limits.allow(limits.entry_bytes + 1, limits.entry_bytes));
  limits.entry_bytes = 999;
  EntryHeader header;
  header.name = "log.bin";
  header.size = header.packed_size = 1000;
  EXPECT_THAT(why_refused(header, limits)->what, HasSubstr("claims 1000 bytes"));
}

}  // namespace
}  // namespace sixpoint::gt3x
