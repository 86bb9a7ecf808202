#include "repair/batch/manifest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint::repair {
namespace {

using testing::HasSubstr;

RepairReport repaired(const std::string& input) {
  RepairReport report;
  report.input = input;
  report.output = "out/" + input;
  report.status = RepairStatus::repaired;
  report.still_error_before_mg = 112.34567;
  report.still_error_after_mg = 0.8;
  report.source = SourceUsed{"store", "0123", std::nullopt, 1.5};
  report.input_sha256 = "aa";
  report.output_sha256 = "bb";
  return report;
}

class Manifest : public testing::Test {
 protected:
  Manifest() { EXPECT_OK(memory_.files.make_folders("out")); }
  std::string text(const std::string& path) {
    const Bytes bytes = read_file(memory_.files, path).value();
    return {bytes.begin(), bytes.end()};
  }
  void write(const std::vector<RepairReport>& reports) {
    ASSERT_OK(check_manifest(memory_.files, "out"));
    ASSERT_OK(write_manifest(memory_.files, "out", reports, from_unix_seconds(0), "sixpoint"));
  }
  MemoryEnv memory_;
};

TEST_F(Manifest, HasALinePerFile) {
  RepairReport refused;
  refused.input = "b.gt3x";
  refused.status = RepairStatus::not_repairable;
  write({repaired("a.gt3x"), refused});
  EXPECT_EQ(text("out/manifest.csv"),
            "input,output,status,source,source_id,still_error_before_mg,still_error_after_mg,"
            "input_sha256,output_sha256\r\n"
            "a.gt3x,out/a.gt3x,repaired,store,0123,112.346,0.800,aa,bb\r\n"
            "b.gt3x,,not_repairable,,,,,,\r\n");
  const auto json = nlohmann::json::parse(text("out/manifest.json"));
  EXPECT_EQ(json["schema"], "sixpoint/repair-manifest/1");
  ASSERT_EQ(json["files"].size(), 2U);
  EXPECT_EQ(json["files"][0]["source"]["standard_uncertainty_mg"], 1.5);
  EXPECT_EQ(json["files"][0]["still_error_mg"]["before"], 112.34567);
  EXPECT_TRUE(json["files"][1]["output"].is_null());
}

TEST_F(Manifest, QuotesAndEscapesNames) {
  write({repaired("a,\"b\".gt3x"), repaired("\xff\xfe.gt3x")});
  const std::string csv = text("out/manifest.csv");
  EXPECT_THAT(csv, HasSubstr("\"a,\"\"b\"\".gt3x\",\"out/a,\"\"b\"\".gt3x\",repaired"));
  EXPECT_THAT(csv, HasSubstr("\\xff\\xfe.gt3x,out/\\xff\\xfe.gt3x,repaired"));
  EXPECT_TRUE(nlohmann::json::accept(text("out/manifest.json")));
}

TEST_F(Manifest, KeepsTheFilesOfEarlierRuns) {
  write({repaired("a.gt3x"), repaired("b.gt3x")});
  RepairReport again = repaired("b.gt3x");
  again.status = RepairStatus::outdated;
  write({again, repaired("c.gt3x")});
  const auto json = nlohmann::json::parse(text("out/manifest.json"));
  ASSERT_EQ(json["files"].size(), 3U);
  EXPECT_EQ(json["files"][0]["input"], "a.gt3x");
  EXPECT_EQ(json["files"][1]["status"], "outdated");
  EXPECT_EQ(json["files"][2]["input"], "c.gt3x");
}

TEST_F(Manifest, AnOutputThatIsOutdatedKeepsWhatIsKnownOfIt) {
  write({repaired("a.gt3x"), repaired("b.gt3x")});
  const auto outdated = [](const std::string& input) {
    RepairReport report;
    report.input = input;
    report.status = RepairStatus::outdated;
    report.still_error_before_mg = 112.34567;
    report.input_sha256 = "aa";
    return report;
  };
  for (int i = 0; i < 2; ++i) {
    write({outdated("a.gt3x"), repaired("b.gt3x"), outdated("c.gt3x")});
    EXPECT_THAT(text("out/manifest.csv"),
                testing::EndsWith("output_sha256\r\n"
                                  "a.gt3x,out/a.gt3x,outdated,store,0123,112.346,0.800,aa,bb\r\n"
                                  "b.gt3x,out/b.gt3x,repaired,store,0123,112.346,0.800,aa,bb\r\n"
                                  "c.gt3x,,outdated,,,112.346,,aa,\r\n"));
  }
}

TEST_F(Manifest, KnowsItsOutputsByTheirHashes) {
  EXPECT_FALSE(KnownOutputs(memory_.files, "out").of("out/a.gt3x")) << "there is no manifest";
  RepairReport refused = repaired("b.gt3x");
  refused.output.clear();
  refused.output_sha256.clear();
  write({repaired("a.gt3x"), refused});
  const KnownOutputs known(memory_.files, "out");
  const auto output = known.of("out/a.gt3x");
  ASSERT_TRUE(output);
  EXPECT_EQ(output->input_sha256, "aa");
  EXPECT_EQ(output->sha256, "bb");
  EXPECT_EQ(output->as_of, from_unix_seconds(0));
  EXPECT_FALSE(known.of("out/b.gt3x"));
  EXPECT_FALSE(known.of(""));
}

TEST_F(Manifest, WithoutItsJsonTheCsvIsSaidToBeHalf) {
  write({repaired("a.gt3x")});
  ASSERT_OK(memory_.files.remove("out/manifest.json"));
  const auto half = check_manifest(memory_.files, "out");
  EXPECT_FAILS(half, ErrorCode::cannot_create);
  EXPECT_THAT(half.error().what, HasSubstr("manifest.json"));
  EXPECT_THAT(half.error().what, HasSubstr("missing"));
}

// The table of manifest.h: a.gt3x was refused because its output is there, b.gt3x cannot be read,
// c.gt3x has another input than its output was made of, d.gt3x has no earlier line.
TEST_F(Manifest, WhatFailedInThisRunStandsAsFailed) {
  write({repaired("a.gt3x"), repaired("b.gt3x"), repaired("c.gt3x"), repaired("e.gt3x")});
  const auto failed = [](const std::string& input, ErrorCode code, const std::string& hash) {
    RepairReport report;
    report.input = input;
    report.status = RepairStatus::failed;
    report.error = Error{code, "", "", ""};
    report.input_sha256 = hash;
    return report;
  };
  write({failed("a.gt3x", ErrorCode::cannot_create, "aa"),
         failed("b.gt3x", ErrorCode::bad_data, "aa"),
         failed("c.gt3x", ErrorCode::cannot_create, "cc"),
         failed("d.gt3x", ErrorCode::cannot_create, "")});
  EXPECT_THAT(text("out/manifest.csv"),
              testing::EndsWith("output_sha256\r\n"
                                "a.gt3x,out/a.gt3x,failed,store,0123,112.346,0.800,aa,bb\r\n"
                                "e.gt3x,out/e.gt3x,repaired,store,0123,112.346,0.800,aa,bb\r\n"
                                "b.gt3x,,failed,,,,,aa,\r\n"
                                "c.gt3x,,failed,,,,,cc,\r\n"
                                "d.gt3x,,failed,,,,,,\r\n"));
}

// The same with outputs that lie in the folder, by the rows of the table. c.gt3x was replaced; d.gt3x
// is the output of another file by now.
TEST_F(Manifest, NoOutputThatLiesInTheFolderLosesItsLine) {
  write({repaired("a.gt3x"), repaired("b.gt3x"), repaired("c.gt3x"), repaired("d.gt3x"),
         repaired("e.gt3x"), repaired("f.gt3x")});
  for (const std::string name : {"a", "b", "c", "d", "e"}) {
    ASSERT_OK(write_file(memory_.files, "out/" + name + ".gt3x", "x"));
  }
  const auto other = [](const std::string& input, RepairStatus status, const std::string& hash) {
    RepairReport report;
    report.input = input;
    report.status = status;
    report.input_sha256 = hash;
    return report;
  };
  RepairReport outdated = other("b.gt3x", RepairStatus::outdated, "aa");
  RepairReport moved = repaired("elsewhere/d.gt3x");
  moved.output = "out/d.gt3x";
  for (int i = 0; i < 2; ++i) {
    write({other("./a.gt3x", RepairStatus::not_affected, ""), outdated,
           other("c.gt3x", RepairStatus::outdated, "cc"), moved,
           other("f.gt3x", RepairStatus::not_affected, "")});
    EXPECT_THAT(
        text("out/manifest.csv"),
        testing::EndsWith("output_sha256\r\n"
                          "a.gt3x,out/a.gt3x,repaired,store,0123,112.346,0.800,aa,bb\r\n"
                          "b.gt3x,out/b.gt3x,outdated,store,0123,112.346,0.800,aa,bb\r\n"
                          "c.gt3x,out/c.gt3x,repaired,store,0123,112.346,0.800,aa,bb\r\n"
                          "e.gt3x,out/e.gt3x,repaired,store,0123,112.346,0.800,aa,bb\r\n"
                          "a.gt3x,,not_affected,,,,,,\r\n"
                          "c.gt3x,,outdated,,,,,cc,\r\n"
                          "elsewhere/d.gt3x,out/d.gt3x,repaired,store,0123,112.346,0.800,aa,bb\r\n"
                          "f.gt3x,,not_affected,,,,,,\r\n"));
  }
}

TEST_F(Manifest, AnOutputWhoseNameWasEscapedKeepsItsLine) {
  write({repaired("\xff\xfe.gt3x")});
  RepairReport again;
  again.input = "\xff\xfe.gt3x";
  again.status = RepairStatus::not_affected;
  write({again});
  EXPECT_THAT(text("out/manifest.csv"), HasSubstr("\\xff\\xfe.gt3x,out/\\xff\\xfe.gt3x,repaired"));
}

TEST_F(Manifest, LeavesAFileOfThatNameThatIsNotOursAlone) {
  ASSERT_OK(write_file(memory_.files, "out/manifest.csv", "mine"));
  EXPECT_FAILS(check_manifest(memory_.files, "out"), ErrorCode::cannot_create);
  ASSERT_OK(memory_.files.remove("out/manifest.csv"));
  ASSERT_OK(write_file(memory_.files, "out/manifest.json", R"({"files": []})"));
  EXPECT_FAILS(check_manifest(memory_.files, "out"), ErrorCode::cannot_create);
}

}  // namespace
}  // namespace sixpoint::repair
