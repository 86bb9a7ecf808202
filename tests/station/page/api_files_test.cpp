// The files that the page may list: those below one folder.
#include <fstream>

#include <gtest/gtest.h>

#include "station/page/station_in_process.h"

namespace sixpoint::station {
namespace {

TEST(ApiFiles, ListsRecordingsAndFoldersBelowTheStationsFolder) {
  const tests::TemporaryFolder folder;
  ASSERT_OK(posix_env().files.make_folders(folder / "clients/b"));
  std::ofstream(folder / "clients/a.gt3x") << "12345";
  std::ofstream(folder / "clients/notes.txt") << "x";
  std::ofstream(folder / "clients/.hidden.gt3x") << "x";
  Station station({"virtual:seed=7"}, folder.path());
  const Json listed = station.get("/api/files?path=clients");
  EXPECT_EQ(listed["folders"], Json::array({"b"}));
  EXPECT_EQ(listed["files"], Json::array({Json{{"name", "a.gt3x"}, {"bytes", 5}}}));
  EXPECT_EQ(listed["cut"], false);
}

// Stored constants take part in later repairs: nobody stores or repairs without a PIN.
TEST(ApiFiles, WhereThereAreOperatorsOneIsSignedInToStoreAndToRepair) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  EXPECT_OK(Operators(posix_env(), folder / "operators.json")
                .add("Ada", OperatorRole::technician, "471100"));
  const Json save = {{"file", "none.gt3x"}, {"save", true}};
  const Json repair = {{"folder", "none"}, {"output", "out"}};
  EXPECT_EQ(station.post("/api/check", {{"file", "none.gt3x"}}), 404) << "a look needs none";
  EXPECT_EQ(station.post("/api/check", save), 403);
  EXPECT_EQ(station.post("/api/repair", repair), 403);
  EXPECT_EQ(station.post("/api/operator", {{"name", "Ada"}, {"pin", "471100"}}), 200);
  EXPECT_EQ(station.post("/api/check", save), 404);
  EXPECT_EQ(station.post("/api/repair", repair), 404);
}

// The escapes are decoded before the path is checked.
TEST(ApiFiles, PathsThatLeadOutOfTheFolderAreRefused) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  auto client = station.client();
  for (const char* path : {"..", "a%2F..%2F..", "%2e%2e%2f", "%2Fetc", "a%00b", "a%5Cb"}) {
    EXPECT_EQ(client.Get(std::string("/api/files?path=") + path)->status, 403) << path;
  }
  EXPECT_EQ(client.Get("/api/files?path=..a")->status, 404) << "a name that begins with two dots";
}

// What the list offers can be repaired: a path may be longer than a name.
TEST(ApiFiles, PathsOfMoreThan200BytesAreTaken) {
  const tests::TemporaryFolder folder;
  const std::string part(100, 'd');
  const std::string deep = part + "/" + part + "/" + part;
  ASSERT_OK(posix_env().files.make_folders(folder / deep));
  std::ofstream(folder / (deep + "/a.gt3x")) << "no recording";
  Station station({"virtual:seed=7"}, folder.path());
  EXPECT_EQ(station.get("/api/files?path=" + deep)["files"].size(), 1U);
  EXPECT_EQ(station.post("/api/repair", {{"folder", deep}, {"output", deep + "/out"}}), 202);
  EXPECT_EQ(station.post("/api/repair", {{"folder", deep}, {"output", 5}}), 400);
  EXPECT_EQ(station.post("/api/check", {{"file", deep + "/b.gt3x"}}), 404) << "not there";
  EXPECT_EQ(station.post("/api/check", {{"file", std::string(1000, 'd')}}), 403);
  EXPECT_EQ(station.post("/api/check", {{"file", std::string("a\0b", 3)}}), 403);
}

}  // namespace
}  // namespace sixpoint::station
