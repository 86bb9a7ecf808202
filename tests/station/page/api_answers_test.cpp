#include "station/page/api_answers.h"

#include <gtest/gtest.h>

namespace sixpoint::station {

using Json = nlohmann::ordered_json;

namespace {

// Oracle: the statuses of docs/station.md, by the meaning of RFC 9110.
TEST(ApiAnswers, ErrorsHaveTheStatusOfTheirKind) {
  EXPECT_EQ(refusal(Error{ErrorCode::usage, "", "", ""}).status, 400);
  EXPECT_EQ(refusal(Error{ErrorCode::no_input, "", "", ""}).status, 404);
  EXPECT_EQ(refusal(Error{ErrorCode::permission, "", "", ""}).status, 403);
  EXPECT_EQ(refusal(Error{ErrorCode::cannot_create, "", "", ""}).status, 409);
  EXPECT_EQ(refusal(Error{ErrorCode::device_unavailable, "", "", ""}).status, 503);
  EXPECT_EQ(refusal(Error{ErrorCode::io, "", "", ""}).status, 500);
  EXPECT_EQ(refusal(Error{ErrorCode::io, "full", "disk", "clean up"}).body,
            R"({"error":{"code":"io","what":"disk: full","hint":"clean up"}})");
}

TEST(ApiAnswers, TextFieldsAreTextsOfAtMost200Bytes) {
  EXPECT_EQ(text_of(Json::object(), "name"), "");
  EXPECT_EQ(text_of(Json{{"name", nullptr}}, "name"), "");
  EXPECT_EQ(text_of(Json{{"name", "Ada"}}, "name"), "Ada");
  EXPECT_EQ(text_of(Json{{"name", std::string(200, 'x')}}, "name"), std::string(200, 'x'));
  EXPECT_FALSE(text_of(Json{{"name", std::string(201, 'x')}}, "name"));
  EXPECT_FALSE(text_of(Json{{"name", 7}}, "name"));
  EXPECT_FALSE(text_of(Json{{"name", std::string("A\0da", 4)}}, "name")) << "no store takes a NUL";
}

// Oracle: the bodies of the routes in docs/station.md.
TEST(ApiAnswers, KeysAreThoseOfTheRouteAlone) {
  const Json started = {{"lane", 2}, {"operator", "Ada"}, {"serial", ""}, {"write", true}};
  EXPECT_FALSE(refused_key("run", started));
  EXPECT_FALSE(refused_key("code", Json::object()));
  EXPECT_FALSE(refused_key("nothing", started)) << "is not found, and that is said";
  EXPECT_FALSE(refused_key("lanes/hand", {{"do", "turn"}, {"pose", "+z"}, {"tilt_deg", 3}}));
  EXPECT_EQ(refused_key("lanes/take", {{"operator", "Ada"}, {"name", "Bo"}})->body,
            R"({"error":{"code":"bad_request","what":"'name' is no key of this request",)"
            R"("hint":"its keys are operator"}})");
  EXPECT_EQ(refused_key("lanes/stop", {{"lane", 2}})->body,
            R"({"error":{"code":"bad_request","what":"'lane' is no key of this request",)"
            R"("hint":"it has none"}})");
}

// JSON has no bytes that are not UTF-8: they become the replacement character.
TEST(ApiAnswers, BytesThatAreNoUtf8AreReplaced) {
  EXPECT_EQ(dump(Json{{"serial", "A\xff"}}), "{\"serial\":\"A\xEF\xBF\xBD\"}");
}

}  // namespace
}  // namespace sixpoint::station
