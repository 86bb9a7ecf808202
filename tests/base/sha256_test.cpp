#include "base/sha256.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint {
namespace {

TEST(Sha256, PublishedVectors) {
  EXPECT_EQ(to_hex(sha256({})), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  Sha256 hash;
  hash.update("a");
  hash.update("bc");
  EXPECT_EQ(to_hex(hash.finish()),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

// FIPS 180-4, example of one block: "abc".
TEST(Sha256, TextsAndFiles) {
  const std::string abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
  EXPECT_EQ(text_sha256("abc"), abc);
  MemoryFiles files;
  ASSERT_OK(files.create("f").value()->write_at(0, Bytes{'a', 'b', 'c'}));
  EXPECT_EQ(file_sha256(files, "f").value(), abc);
  EXPECT_EQ(to_hex(file_digest(files, "f").value()), abc);
  EXPECT_FAILS(file_sha256(files, "none"), ErrorCode::no_input);
}

}  // namespace
}  // namespace sixpoint
