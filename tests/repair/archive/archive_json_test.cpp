#include "repair/archive/archive_json.h"

#include "repair/archive/archive_fixture.h"

namespace sixpoint::repair {
namespace {

TEST_F(Archive, PathsOfAnyBytesComeBack) {
  Random random(2);
  for (int trial = 0; trial < 200; ++trial) {
    std::string path;
    for (std::uint64_t i = random.below(30); i > 0; --i) {
      path += static_cast<char>(random.below(256));
    }
    const std::string text = encode_path(path);
    for (const char c : text) {
      EXPECT_TRUE(c >= 0x20 && c < 0x7f);
    }
    EXPECT_EQ(decode_path(text).value(), path);
  }
  for (const char* damaged : {"%", "%4", "%4g", "a%zz"}) {
    EXPECT_FALSE(decode_path(damaged)) << damaged;
  }
}

TEST(ArchiveJson, AnErrorComesBack) {
  const Error error{ErrorCode::no_input, "gone", "/a/\xff b", "look"};
  const auto back = error_from_json(error_to_json(error));
  ASSERT_OK(back);
  EXPECT_EQ(back->code, ErrorCode::no_input);
  EXPECT_EQ(back->where, "/a/\xff b");
  EXPECT_EQ(error_to_json(error)["where"], "/a/%FF b");
  auto json = error_to_json(error);
  json["code"] = 3;
  EXPECT_FAILS(error_from_json(json), ErrorCode::bad_data);
}

TEST(ArchiveJson, IntegersAreNotRounded) {
  using Json = nlohmann::ordered_json;
  EXPECT_EQ(integer_of<std::uint8_t>(Json(255)), 255);
  for (const Json& bad : {Json(256), Json(-1), Json(1.5), Json("1"), Json(nullptr)}) {
    EXPECT_THROW(integer_of<std::uint8_t>(bad), Json::exception) << bad;
  }
}

}  // namespace
}  // namespace sixpoint::repair
