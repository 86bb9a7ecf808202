#include "repair/rescale/repair_report.h"

#include <gtest/gtest.h>

#include "gt3x/container/delivery.h"

namespace sixpoint::repair {
namespace {

NextRun of(ErrorCode code, const std::string& hint = "", const std::string& what = "",
           bool salvage = false) {
  return next_run(Error{code, what, "a.gt3x", hint}, salvage);
}

TEST(NextRunOfAFile, FollowsTheTable) {
  for (const char* hint : {kAnotherFolder, kFolderWithoutRecordings, kSeparateRuns}) {
    EXPECT_EQ(of(ErrorCode::cannot_create, hint), NextRun::none) << hint;
  }
  for (const ErrorCode code :
       {ErrorCode::no_input, ErrorCode::permission, ErrorCode::io, ErrorCode::cannot_create}) {
    EXPECT_EQ(of(code, "remove it"), NextRun::same) << to_string(code);
  }
  EXPECT_EQ(of(ErrorCode::bad_data, "repair it again", kChangedMeanwhile), NextRun::same);
  const std::string damaged = gt3x::hint_about(gt3x::Damage::wrong_crc);
  EXPECT_EQ(of(ErrorCode::bad_data, damaged), NextRun::with_salvage);
  EXPECT_EQ(of(ErrorCode::bad_data, damaged, "", true), NextRun::none) << "it was given";
  EXPECT_EQ(of(ErrorCode::bad_data, gt3x::hint_about(gt3x::Damage::refused)), NextRun::none);
  EXPECT_EQ(of(ErrorCode::internal), NextRun::none);
}

}  // namespace
}  // namespace sixpoint::repair
