#include "station/records/jig_bundle.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "run_command.h"
#include "station/records/made_run.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

TEST(JigBundle, AStoredRunIsDiagnosed) {
  tests::TemporaryFolder folder;
  const std::string store = folder / "s.db";
  const auto jig =
      tests::run_command(posix_env(), {"jig", "--device", "virtual:seed=9,jig=auto", "--jig",
                                       "virtual", "--store", store, "--json"});
  ASSERT_EQ(jig.exit_code, 0) << jig.people;
  const std::string run = jig.json()["run"].get<std::string>();
  const auto diagnosed = tests::run_command(
      posix_env(), {"gap", "diagnose", "--run", run, "--store", store, "--json"});
  EXPECT_EQ(diagnosed.exit_code, 0) << diagnosed.people;
  const nlohmann::json json = nlohmann::json::parse(diagnosed.out);
  EXPECT_EQ(json["verdict"], "no_gap");
  bool mismatch = false;
  for (const nlohmann::json& hidden : json["not_observable"]) {
    mismatch = mismatch || hidden["name"] == "filter_mismatch";
  }
  EXPECT_TRUE(mismatch) << "raw counts do not show it";
  EXPECT_EQ(tests::run_command(posix_env(), {"gap", "diagnose", "--run", "00ff", "--store", store})
                .exit_code,
            66);
  EXPECT_EQ(tests::run_command(posix_env(), {"gap", "diagnose"}).exit_code, 64);
  const auto trends =
      tests::run_command(posix_env(), {"gap", "trends", "--store", store, "--json"});
  EXPECT_EQ(trends.exit_code, 2) << "one unit is too few";
  EXPECT_EQ(nlohmann::json::parse(trends.out)["jigs"][0]["belongs_to"], "too_few_units");
}

TEST(JigBundle, WhatDoesNotBelongTogetherIsRefused) {
  const StoredRun run = made_run("A", "j", {0, 0, 0}, {0, 0});
  EXPECT_FAILS(bundle_of_run(run, "t,x,y,z,c\n0,1,2,3,25\n"), ErrorCode::bad_data);
  EXPECT_FAILS(bundle_of_run(run, "t,x,y,z,c\n0,1,nan,3,25\n"), ErrorCode::bad_data);
  EXPECT_FAILS(bundle_of_run(run, ""), ErrorCode::bad_data);
  EXPECT_FAILS(bundle_of_run({"i", "s", "jig", "", "", "[]"}, ""), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::station
