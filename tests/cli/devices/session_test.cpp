// --record, replay: and `sixpoint session` through the program.
#include "device/session/session.h"

#include <fstream>
#include <map>

#include <gmock/gmock.h>

#include "cli/devices/session_fixture.h"
#include "device/session/session_journal.h"
#include "expect_result.h"

namespace sixpoint::cli {
namespace {

using testing::HasSubstr;

// Oracle: the run that was recorded.
TEST_F(SessionCommand, AReplayedJigRunGivesTheSameConstants) {
  for (const bool write : {false, true}) {
    const std::string file = path(write ? "w.zip" : "r.zip");
    std::vector<std::string> more;
    if (write) {
      more.emplace_back("--write");
    }
    auto recording = more;
    recording.insert(recording.end(), {"--record", file});
    const auto first = jig("virtual:seed=7,jig=auto", recording);
    ASSERT_EQ(first.exit_code, 0) << first.people;
    const auto again = jig("replay:" + file, more);
    EXPECT_EQ(again.exit_code, 0) << again.people;
    for (const char* key : {"serial", "constants", "poses", "verification", "as_found"}) {
      EXPECT_EQ(again.json()[key], first.json()[key]) << key;
    }
    EXPECT_EQ(jig("replay:" + file + ",match=key", more).json()["constants"],
              first.json()["constants"]);
  }
  EXPECT_EQ(jig("replay:" + path("r.zip"), {"--write"}).exit_code, 69)
      << "the recording ends before the write";
}

// Constants of another day would apply, with a certificate of today.
TEST_F(SessionCommand, AReplayMeasuresNothing) {
  const std::string file = path("r.zip");
  const auto first = jig("virtual:seed=7,jig=auto", {"--write", "--record", file});
  ASSERT_EQ(first.exit_code, 0) << first.people;
  const auto serial = first.json()["serial"].get<std::string>();
  const auto again = jig("replay:" + file, {"--write"});
  EXPECT_EQ(again.exit_code, 0) << again.people;
  EXPECT_TRUE(again.json()["stored_id"].is_null());
  const Json history = run({"history", serial, "--store", path("s.db"), "--json"}).json();
  std::map<std::string, int> kinds;
  for (const Json& entry : history["runs"]) {
    ++kinds[entry["kind"].get<std::string>()];
  }
  EXPECT_EQ(kinds, (std::map<std::string, int>{{"jig", 1}, {"replay", 1}}));
  EXPECT_EQ(history["constants"].size(), 1U);
  EXPECT_EQ(history["writes"].size(), 1U);
  EXPECT_EQ(jig("replay:" + file, {"--certificate", path("c.pdf")}).exit_code, 64);
  EXPECT_EQ(jig("replay:" + file, {"--write", "--label", path("l.zpl")}).exit_code, 64);
  EXPECT_EQ(jig("replay:" + file, {"--study", "spring", "--operator", "Ada"}).exit_code, 64);
  EXPECT_EQ(run({"station", "--device", "replay:" + file}).exit_code, 64);
  EXPECT_EQ(
      run({"capture", "--device", "replay:" + file, "--constants-out", path("c.json")}).exit_code,
      64);
}

TEST_F(SessionCommand, AReplayedCaptureGivesTheSameFile) {
  const auto capture = [&](const std::string& device, const std::string& output,
                           const std::string& record) {
    std::vector<std::string> arguments = {"capture",    "--device", device,      "--store",
                                          path("s.db"), "-o",       path(output)};
    if (!record.empty()) {
      arguments.insert(arguments.end(), {"--record", path(record)});
    }
    return run(arguments).exit_code;
  };
  ASSERT_EQ(capture("virtual:seed=7,jig=auto", "a.gt3x", "c.zip"), 0);
  ASSERT_EQ(capture("replay:" + path("c.zip"), "b.gt3x", ""), 0);
  EXPECT_EQ(*read_file(posix_env().files, path("a.gt3x")),
            *read_file(posix_env().files, path("b.gt3x")));
}

// What goes wrong is in the session too, and goes wrong again.
TEST_F(SessionCommand, AFailedRunIsReplayedAsItFailed) {
  std::ofstream(path("f.json"))
      << R"({"schema": "sixpoint/faults/1", "faults": [{"fault": "unplug", "at_s": 25}]})";
  const auto first =
      jig("virtual:seed=7,jig=auto,faults=" + path("f.json"), {"--record", path("f.zip")});
  EXPECT_EQ(first.exit_code, 69);
  const auto again = jig("replay:" + path("f.zip"));
  EXPECT_EQ(again.exit_code, 69) << again.people;
  EXPECT_EQ(again.json()["poses"], first.json()["poses"]);
  EXPECT_EQ(again.json()["error"]["what"], first.json()["error"]["what"]);
  const auto by_key = jig("replay:" + path("f.zip") + ",match=key");
  EXPECT_EQ(by_key.exit_code, 69) << "away is away: " << by_key.people;
  EXPECT_EQ(by_key.json()["poses"], first.json()["poses"]);
}

// Away and back: by key the unit comes back as it did, too.
TEST_F(SessionCommand, AUnitThatCameBackComesBackInBothReplays) {
  std::ofstream(path("f.json")) << R"({"schema": "sixpoint/faults/1",
      "faults": [{"fault": "unplug", "at_s": 25, "seconds": 3}]})";
  const auto first =
      jig("virtual:seed=7,jig=auto,faults=" + path("f.json"), {"--record", path("f.zip")});
  ASSERT_EQ(first.exit_code, 0) << first.people;
  for (const char* match : {"", ",match=key"}) {
    const auto again = jig("replay:" + path("f.zip") + match);
    EXPECT_EQ(again.exit_code, 0) << again.people;
    EXPECT_EQ(again.json()["constants"], first.json()["constants"]) << match;
  }
}

TEST_F(SessionCommand, ATamperedSessionIsAClearError) {
  ASSERT_EQ(jig("virtual:seed=7,jig=auto", {"--record", path("r.zip")}).exit_code, 0);
  auto session = *device::read_session(posix_env().files, path("r.zip"));
  // Changed with a right hash: the protocol notices, for the request is no answer's any more.
  for (device::SessionTransfer& transfer : session.transfers) {
    if (transfer.kind == device::SessionTransfer::Kind::to_device && transfer.bytes[4] == 2) {
      transfer.bytes[10] ^= 1;
      break;
    }
  }
  ASSERT_OK(device::write_session(posix_env().files, path("t.zip"), session));
  const auto answer = jig("replay:" + path("t.zip"));
  EXPECT_EQ(answer.exit_code, 65);
  EXPECT_THAT(answer.people, HasSubstr("the program sends 'read_page' where the session has"));
  // Changed in the file.
  Bytes bytes = *read_file(posix_env().files, path("r.zip"));
  bytes[bytes.size() / 2] ^= 1;
  std::ofstream(path("u.zip"), std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  EXPECT_EQ(jig("replay:" + path("u.zip")).exit_code, 65);
  EXPECT_EQ(jig("replay:" + path("none.zip")).exit_code, 66);
  EXPECT_EQ(jig("replay:" + path("r.zip") + ",match=loosely").exit_code, 64);
}

// What a killed program leaves (device/session/session_journal.h): the next open says what to do,
// recover does it, and the run is replayed as far as it went.
TEST_F(SessionCommand, ABrokenOffRecordingIsRecovered) {
  ASSERT_EQ(jig("virtual:seed=7,jig=auto", {"--record", path("r.zip")}).exit_code, 0);
  const auto whole = *device::read_session(posix_env().files, path("r.zip"));
  {
    auto journal = *device::SessionJournal::create(posix_env().files, path("k.zip"));
    ASSERT_OK(journal.begin(whole.device, whole.started));
    for (std::size_t i = 0; i < whole.transfers.size() / 2; ++i) {
      ASSERT_OK(journal.append(whole.transfers[i]));
    }
  }
  std::ofstream(path("k.zip.journal"), std::ios::app) << "{\"t_ns\":12";
  const auto unread = jig("replay:" + path("k.zip"));
  EXPECT_EQ(unread.exit_code, 66);
  EXPECT_THAT(unread.people, HasSubstr("sixpoint session recover"));
  const auto again = jig("virtual:seed=7,jig=auto", {"--record", path("k.zip")});
  EXPECT_EQ(again.exit_code, 73) << "what is there is not overwritten";
  EXPECT_THAT(again.people, HasSubstr("sixpoint session recover"));

  const auto recovered = run({"session", "recover", path("k.zip"), "--json"});
  EXPECT_EQ(recovered.exit_code, 0) << recovered.people;
  EXPECT_EQ(recovered.json()["transfers"], whole.transfers.size() / 2);
  EXPECT_EQ(recovered.json()["truncated"], true);
  EXPECT_THAT(recovered.json()["summary"].get<std::string>(), HasSubstr("10 bytes"));
  EXPECT_EQ(jig("replay:" + path("k.zip")).exit_code, 69) << "the unit is gone where it was killed";
  EXPECT_EQ(run({"session", "recover", path("k.zip")}).exit_code, 66) << "the journal is used up";
  // By the journal's own name, to another place.
  { ASSERT_OK(device::SessionJournal::create(posix_env().files, path("k.zip"))->begin("x", {})); }
  EXPECT_EQ(run({"session", "recover", path("k.zip.journal")}).exit_code, 73);
  EXPECT_EQ(run({"session", "recover", path("k.zip.journal"), "-o", path("l.zip")}).exit_code, 0);
  EXPECT_EQ(device::read_session(posix_env().files, path("l.zip"))->transfers.size(), 0U);
}

TEST_F(SessionCommand, FromPcapRefusesWhatIsNoCapture) {
  std::ofstream(path("x.pcap")) << "no capture at all, but longer than a header";
  EXPECT_EQ(run({"session", "from-pcap", path("x.pcap"), "-o", path("x.zip")}).exit_code, 65);
  EXPECT_EQ(run({"session", "from-pcap", path("none"), "-o", path("x.zip")}).exit_code, 66);
}

}  // namespace
}  // namespace sixpoint::cli
