#include "device/session/session.h"

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "expect_result.h"
#include "made_session.h"

namespace sixpoint::device {
namespace {

TEST(Session, IsWrittenAndReadBackTheSame) {
  const Session session = tests::made_session();
  ASSERT_GT(session.transfers.size(), 40U);
  MemoryFiles files;
  ASSERT_OK(write_session(files, "s.zip", session));
  const auto back = read_session(files, "s.zip");
  ASSERT_OK(back);
  EXPECT_EQ(back->device, "virtual:seed=7");
  EXPECT_EQ(back->started, session.started);
  EXPECT_EQ(back->transfers, session.transfers);
  ASSERT_OK(write_session(files, "t.zip", *back));
  EXPECT_EQ(*read_file(files, "s.zip"), *read_file(files, "t.zip")) << "the same bytes";
}

// Every byte of the file changed in turn, in steps: an error, or the very same session.
TEST(Session, AChangedFileIsNoticed) {
  const Session session = tests::made_session(3);
  MemoryFiles files;
  ASSERT_OK(write_session(files, "s.zip", session));
  const Bytes whole = *read_file(files, "s.zip");
  int noticed = 0;
  for (std::size_t at = 0; at < whole.size(); at += 7) {
    Bytes bytes = whole;
    bytes[at] ^= 0x10;
    const std::string name = std::to_string(at) + ".zip";
    ASSERT_OK(write_file(files, name, as_text(bytes)));
    const auto back = read_session(files, name);
    if (!back) {
      EXPECT_EQ(back.error().code, ErrorCode::bad_data) << at;
      ++noticed;
    } else {
      EXPECT_EQ(back->transfers, session.transfers) << at;
    }
  }
  EXPECT_GT(noticed, static_cast<int>(whole.size() / 7 / 2));
  ASSERT_OK(write_file(files, "n.zip", "no zip"));
  EXPECT_FAILS(read_session(files, "n.zip"), ErrorCode::bad_data);
  EXPECT_FAILS(read_session(files, "none.zip"), ErrorCode::no_input);
}

TEST(Session, LinesThatAreNoTransfersAreRefused) {
  for (const char* line :
       {"x", "{}", R"({"t_ns":-1,"kind":"out","channel":"bulk"})",
        R"({"t_ns":9223372036854775807,"kind":"out","channel":"bulk"})",
        R"({"t_ns":18446744073709551615,"kind":"out","channel":"bulk"})",
        R"({"t_ns":2592000000000001,"kind":"out","channel":"bulk"})",
        R"({"t_ns":1,"kind":"up","channel":"bulk"})", R"({"t_ns":1,"kind":"in","channel":"x"})",
        R"({"t_ns":1,"kind":"in","channel":"bulk","hex":"0g"})",
        R"({"t_ns":1,"kind":"in","channel":"bulk","hex":"012"})",
        R"({"t_ns":1,"kind":"in","channel":"bulk","error":"fire"})",
        "{\"t_ns\":2,\"kind\":\"reopened\"}\n{\"t_ns\":1,\"kind\":\"reopened\"}"}) {
    SCOPED_TRACE(line);
    EXPECT_FAILS(parse_lines(line), ErrorCode::bad_data);
  }
}

}  // namespace
}  // namespace sixpoint::device
