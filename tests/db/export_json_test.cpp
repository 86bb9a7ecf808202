#include "db/export_json.h"

#include <string>

#include <gtest/gtest.h>

#include "base/sha256.h"
#include "expect_result.h"

namespace sixpoint::db {
namespace {

using Json = nlohmann::ordered_json;

TEST(ExportJson, ARowComesBackInEitherForm) {
  const Table& units = table("units");
  const Row row = {std::string("MOS2A1"), std::string("Zo\xc3\xab"), std::int64_t{-5}};
  const Json text = row_to_json(units, row);
  EXPECT_EQ(text.dump(), R"({"serial":"MOS2A1","model":"Zoë","first_seen_ns":-5})");
  const Json hex = row_to_json(units, row, TextForm::hex);
  EXPECT_EQ(hex["serial"].dump(), R"({"bytes":"4d4f53324131"})");
  EXPECT_EQ(row_from_json(units, text).value(), row);
  EXPECT_EQ(row_from_json(units, hex).value(), row);
}

TEST(ExportJson, RefusesRowsOfAnotherForm) {
  for (const char* bad :
       {"[]", R"({"serial":"M","model":"w"})", R"({"serial":"M","model":"w","first_seen_ns":null})",
        R"({"serial":"M","model":"w","first_seen_ns":1.5})",
        R"({"serial":"M","model":"w","first_seen_ns":9223372036854775808})",
        R"({"serial":1,"model":"w","first_seen_ns":1})",
        R"({"serial":{"bytes":"4"},"model":"w","first_seen_ns":1})",
        R"({"serial":"M","model":"w","first_seen_ns":1,"more":2})"}) {
    EXPECT_FAILS(row_from_json(table("units"), Json::parse(bad)), ErrorCode::bad_data);
  }
}

TEST(ExportJson, AnAttachmentMustHaveTheHashThatIsItsName) {
  const std::string name = to_hex(sha256(Bytes{1, 2}));
  const Json json = attachment_to_json(name, {1, 2});
  EXPECT_EQ(json["bytes"], "0102");
  EXPECT_EQ(attachment_from_json(json)->second, (Bytes{1, 2}));
  Json bad = json;
  bad["bytes"] = "0103";
  EXPECT_FAILS(attachment_from_json(bad), ErrorCode::bad_data);
  EXPECT_FAILS(attachment_from_json(Json::object()), ErrorCode::bad_data);
  for (const char* key : {"attachment", "bytes"}) {
    Json other_type = json;
    other_type[key] = 1;
    EXPECT_FAILS(attachment_from_json(other_type), ErrorCode::bad_data);
  }
}

TEST(ExportJson, TheFirstLineNamesFormatAndVersion) {
  const Json json = to_json(ExportHeader{3, 17, "00"});
  EXPECT_EQ(json["schema"], "sixpoint/store-export/1");
  EXPECT_EQ(header_from_json(json)->rows, 17);
  Json newer = json;
  newer["store_version"] = 4;
  EXPECT_FAILS(header_from_json(newer), ErrorCode::configuration);
  EXPECT_FAILS(header_from_json(Json{{"schema", "other"}}), ErrorCode::bad_data);
  for (const char* key : {"schema", "store_version", "rows", "head"}) {
    SCOPED_TRACE(key);
    Json bad = json;
    bad[key] = Json::array();
    EXPECT_FAILS(header_from_json(bad), ErrorCode::bad_data);
    bad.erase(key);
    EXPECT_FAILS(header_from_json(bad), ErrorCode::bad_data);
  }
}

TEST(ExportJson, ALineIsAnObjectAndNotDeep) {
  EXPECT_OK(parse_json_line(R"({"a":{"b":{"c":1}}})"));
  std::string deep = "1";
  for (int level = 0; level < 101; ++level) {
    deep = R"({"a":)" + deep + "}";
  }
  for (const std::string& bad : {std::string(), std::string("[1]"), std::string("{"), deep}) {
    EXPECT_FAILS(parse_json_line(bad), ErrorCode::bad_data);
  }
}

}  // namespace
}  // namespace sixpoint::db
