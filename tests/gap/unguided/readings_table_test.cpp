#include "gap/unguided/readings_table.h"

#include <string>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <zlib.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"
#include "gap/unguided/made_table.h"
#include "shared_data.h"

namespace sixpoint::gap {
namespace {

using testing::HasSubstr;

using tests::diagnosed_table;
using tests::table_of;

TEST(ReadingsTable, NamesOfTables) {
  EXPECT_TRUE(is_readings_table("a/b.txt.gz"));
  EXPECT_TRUE(is_readings_table("b.csv"));
  EXPECT_FALSE(is_readings_table("b.gt3x"));
  EXPECT_FALSE(is_readings_table("b.gz"));
}

TEST(ReadingsTable, BadTablesAreNamed) {
  const std::string good = table_of({}, 1);
  const auto message = [](const std::string& text) {
    const auto d = diagnosed_table(text);
    EXPECT_FALSE(d);
    return d ? std::string() : d.error().what;
  };
  EXPECT_THAT(message(""), HasSubstr("no readings"));
  EXPECT_THAT(message("t,x,y,z\n"), HasSubstr("no readings"));
  EXPECT_THAT(message("1,2\n"), HasSubstr("line 1"));
  EXPECT_THAT(message("0,1,2,3\n0.01,1,2,3\n0.02,1,2\n"), HasSubstr("line 3"));
  EXPECT_THAT(message("0,1,2,3\n0.01,nan,2,3\n"), HasSubstr("line 2"));
  EXPECT_THAT(message("0,1,2,3\n0.01,1e400,2,3\n"), HasSubstr("line 2"));
  EXPECT_THAT(message("0,1,2,3\n0.01,1,2,3x\n"), HasSubstr("line 2"));
  EXPECT_THAT(message("0,1,2,3,4,5,6\n0,1,2,3,4,5,6\n"), HasSubstr("line 2"));
  EXPECT_THAT(message(std::string(100'000, '1')), HasSubstr("longer than 4096"));
  EXPECT_THAT(message("3,1,2,3\n2,1,2,3\n1,1,2,3\n"), HasSubstr("rate"));  // time goes back
  EXPECT_THAT(message("5,1,2,3\n5,1,2,3\n5,1,2,3\n"), HasSubstr("rate"));  // or stands
  EXPECT_THAT(message("1,2,3\n1,2,3\n"), HasSubstr("rate must be given"));
  EXPECT_THAT(message(std::string("\x1F\x8B\x08 broken", 10)), HasSubstr("gzip"));
}

std::string gzipped(const std::string& text) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 1, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  Bytes in(text.begin(), text.end());
  Bytes out(deflateBound(&stream, static_cast<uLong>(in.size())));
  stream.next_in = in.data();
  stream.avail_in = static_cast<uInt>(in.size());
  stream.next_out = out.data();
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  const std::string packed(out.begin(),
                           out.begin() + static_cast<std::ptrdiff_t>(stream.total_out));
  deflateEnd(&stream);
  return packed;
}

// RFC 1952, 2.2: bgzip cuts a file into members of 64 kB, 'cat a.gz b.gz' joins two. Oracle: the
// same table in one piece.
TEST(ReadingsTable, EveryMemberOfAGzipIsRead) {
  const std::string text = table_of({}, 1);
  const auto whole = diagnosed_table(text);
  ASSERT_OK(whole);
  const auto json_of = [](const std::string& packed) {
    const auto diagnosis = diagnosed_table(packed);
    EXPECT_OK(diagnosis);
    return diagnosis ? diagnosis->to_json() : nlohmann::ordered_json();
  };
  std::string members;
  constexpr std::size_t kPiece = 65'280;  // cuts lines, too
  for (std::size_t at = 0; at < text.size(); at += kPiece) {
    members += gzipped(text.substr(at, kPiece));
  }
  members += gzipped("");  // as bgzip ends a file
  EXPECT_EQ(json_of(members), whole->to_json());
  EXPECT_EQ(json_of(members + std::string(100'000, '\0')), whole->to_json());
  for (const std::string& behind :
       {std::string("x"), std::string("\0x", 2), members.substr(0, 9), std::string("\x1F\x8B")}) {
    EXPECT_FAILS(diagnosed_table(members + behind), ErrorCode::bad_data);
  }
}

TEST(ReadingsTable, ACutGzipIsAnError) {
  const char* name = "data/multiposition/xsens_acc.txt.gz";
  SIXPOINT_NEED_SHARED(name);
  const auto bytes = read_file(posix_env().files, tests::shared_file(name));
  ASSERT_OK(bytes);
  MemoryEnv memory;
  const std::string cut(bytes->begin(), bytes->begin() + static_cast<std::ptrdiff_t>(50'000));
  ASSERT_OK(write_file(memory.files, "cut.txt.gz", cut));
  EXPECT_FAILS(diagnose_table(memory.files, "cut.txt.gz"), ErrorCode::bad_data);
  EXPECT_FAILS(diagnose_table(memory.files, "none.txt"), ErrorCode::no_input);
}

}  // namespace
}  // namespace sixpoint::gap
