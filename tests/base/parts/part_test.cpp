#include "base/parts/part.h"

#include <gmock/gmock.h>

#include "expect_result.h"

namespace sixpoint {
namespace {

using testing::HasSubstr;

struct Table {
  int (*answer)();
};
const Table kInside = {[] { return 6; }};

TEST(Part, WhatIsLinkedInIsUsedAndNothingIsLoaded) {
  const auto table = part("of no such name", &kInside);
  ASSERT_OK(table);
  EXPECT_EQ((*table)->answer(), 6);
}

TEST(Part, APartThatIsNotInstalledIsNamedAndTheHintSaysWhatToDo) {
  const auto table = part<Table>("nowhere", nullptr);
  ASSERT_FALSE(table.has_value());
  EXPECT_FAILS(table, ErrorCode::cannot_create);
  EXPECT_EQ(table.error().where, "nowhere");
  EXPECT_THAT(table.error().what, HasSubstr("libsixpoint-nowhere-" SIXPOINT_VERSION ".so"));
  EXPECT_THAT(table.error().hint, HasSubstr("install"));
}

// Oracle: db/postgres, which defines its table. Twice: it stays loaded.
TEST(Part, APartIsFoundByTheFolderOfTheRunpath) {
  const auto once = load_part("postgres");
  ASSERT_OK(once);
  const auto again = load_part("postgres");
  ASSERT_OK(again);
  EXPECT_NE(*once, nullptr);
  EXPECT_EQ(*once, *again);
}

}  // namespace
}  // namespace sixpoint
