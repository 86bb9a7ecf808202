#include "device/session/session.h"

#include <gmock/gmock.h>

#include "base/atomic_file.h"
#include "expect_result.h"
#include "gt3x/recording_writer.h"
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

// An archive whose parts are written here: each of the rows is a session but for one thing.
TEST(Session, AnArchiveThatContradictsItselfIsRefusedByName) {
  const std::string lines =
      "{\"t_ns\":5,\"kind\":\"reopened\"}\n\n{\"t_ns\":7,\"kind\":\"reopened\"}\n";
  const std::string back = "{\"t_ns\":5,\"kind\":\"reopened\"}\n{\"t_ns\":4,\"kind\":\"reopened\"}";
  const auto schema_of = [](const std::string& transfers) {
    return R"("schema":"sixpoint/session/1","transfers":)" + transfers;
  };
  const std::string schema = schema_of("2");
  const std::string started = R"(,"started":"2020-09-13T12:26:40Z")";
  const auto hash = [](const std::string& text) {
    return R"(,"sha256":")" + to_hex(sha256(as_bytes(text))) + "\"";
  };
  const auto read = [](const std::string& head, const std::optional<std::string>& transfers) {
    MemoryFiles files;
    auto zip = *gt3x::RecordingWriter::create(files, "s.zip");
    EXPECT_OK(zip.add("session.json", head));
    if (transfers) {
      EXPECT_OK(zip.add("transfers.jsonl", *transfers));
    }
    EXPECT_OK(zip.commit());
    return read_session(files, "s.zip");
  };
  const auto whole = read("{" + schema + started + hash(lines) + "}", lines);
  ASSERT_OK(whole);
  EXPECT_EQ(whole->transfers.size(), 2U) << "an empty line is none";
  EXPECT_EQ(whole->device, "");
  EXPECT_FALSE(whole->truncated);
  struct Row {
    std::string head;
    std::optional<std::string> transfers;
    const char* what;
  };
  const char* const twice = "session.json has the key /schema twice";
  const char* const count = "session.json does not say that there are 2 transfers";
  const std::string version = "no session of a version that this program reads";
  const std::vector<Row> rows = {
      {"no JSON", lines, version.c_str()},
      {"[1]", lines, version.c_str()},
      {R"({"schema":"sixpoint/session/2")" + started + hash(lines) + "}", lines, version.c_str()},
      {"{" + schema + hash(lines) + "}", lines, "does not say when it began"},
      {"{" + schema + R"(,"started":7)" + hash(lines) + "}", lines, "does not say when it began"},
      {"{" + schema + R"(,"started":"today")" + hash(lines) + "}", lines, "today"},
      {"{" + schema + started + hash(lines) + "}", std::nullopt, "holds no transfers.jsonl"},
      {"{" + schema + started + "}", lines, "was changed after it was recorded"},
      {"{" + schema + started + hash(lines) + "}", back, "was changed after it was recorded"},
      {"{" + schema + started + hash(lines) + "," + schema_of("2") + "}", lines, twice},
      {"{" + schema_of("-1") + started + hash(lines) + "}", lines, count},
      {"{" + schema_of("3") + started + hash(lines) + "}", lines, count},
      {"{" + schema_of("2.0") + started + hash(lines) + "}", lines, count},
      {"{" + schema_of("\"2\"") + started + hash(lines) + "}", lines, count},
      {R"({"schema":"sixpoint/session/1")" + started + hash(lines) + "}", lines, count},
      {"{" + schema + started + hash(back) + "}", back, "time goes back"},
  };
  for (const Row& row : rows) {
    const auto session = read(row.head, row.transfers);
    EXPECT_FAILS(session, ErrorCode::bad_data);
    EXPECT_THAT(session.error().what, testing::HasSubstr(row.what));
  }
  EXPECT_EQ(read(rows.back().head, back).error().where, "s.zip, transfer 2");
}

// What is compared where sessions are compared: every part of a transfer.
TEST(Session, TransfersThatDifferInOnePartDiffer) {
  const SessionTransfer one{SessionTransfer::Kind::to_device, SessionChannel::reports,
                            std::chrono::nanoseconds(1), Bytes{1},
                            Error{ErrorCode::io, "a", "b", "c"}};
  std::vector<SessionTransfer> others(6, one);
  others[0].kind = SessionTransfer::Kind::from_device;
  others[1].channel = SessionChannel::bulk;
  others[2].time = std::chrono::nanoseconds(2);
  others[3].bytes = {2};
  others[4].error.reset();
  others[5].error->code = ErrorCode::bad_data;
  for (std::size_t i = 0; i < others.size(); ++i) {
    EXPECT_FALSE(one == others[i]) << i;
    EXPECT_EQ(parse_lines(to_lines({others[i]}))->front(), others[i]) << "none is lost in the file";
  }
}

TEST(Session, ATransferLargerThanAnyIsRefused) {
  const auto line = [](std::size_t bytes) {
    return R"({"t_ns":1,"kind":"in","channel":"bulk","hex":")" + std::string(2 * bytes, '0') +
           "\"}";
  };
  EXPECT_OK(parse_lines(line(1U << 20U)));
  EXPECT_FAILS(parse_lines(line((1U << 20U) + 1)), ErrorCode::bad_data);
}

}  // namespace
}  // namespace sixpoint::device
