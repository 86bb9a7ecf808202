// A recorded session: every transfer between a program and a device, with its time
// (docs/sessions.md).
//
//   SIXPOINT_ASSIGN(const Session session, read_session(env.files, "session.zip"));
//   for (const SessionTransfer& transfer : session.transfers) {
//     std::cout << to_hex(transfer.bytes) << '\n';
//   }
//
// A session file is a zip of session.json (what it is, and the SHA-256 of the rest) and
// transfers.jsonl, one line per transfer. session_recorder.h makes one, by way of a journal
// (session_journal.h), session_replay.h plays one back, pcap.h makes one of a USB capture.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/env.h"
#include "base/time.h"

namespace sixpoint::device {

enum class SessionChannel : std::uint8_t { reports, bulk };

// A transfer's time is at most this: sums of two such times cannot overflow.
inline constexpr std::chrono::nanoseconds kLongestSession = std::chrono::hours(24 * 30);

struct SessionTransfer {
  enum class Kind : std::uint8_t {
    to_device,    // a write
    from_device,  // a read that gave something; a time-out is no transfer
    reopened,     // the device was opened again after it went away; bytes are empty
  };
  Kind kind = Kind::to_device;
  SessionChannel channel = SessionChannel::reports;
  std::chrono::nanoseconds time{0};  // since the session's start
  Bytes bytes;
  std::optional<Error> error;  // where it failed

  bool operator==(const SessionTransfer& other) const {
    return kind == other.kind && channel == other.channel && time == other.time &&
           bytes == other.bytes && error.has_value() == other.error.has_value() &&
           (!error || error->code == other.error->code);
  }
};

// The content of session.json without the hash.
struct SessionHead {
  std::string device;  // as it was addressed; of a capture: its place on the bus
  UtcTime started{};
  bool truncated = false;  // the device went on, the session did not
  std::uint64_t transfers = 0;
};

struct Session {
  std::string device;  // as SessionHead
  UtcTime started{};
  bool truncated = false;
  std::vector<SessionTransfer> transfers;
};

// Whole or not at all (base/atomic_file.h).
Status write_session(FileSystem& files, const std::string& path, const Session& session);

// no_input, and where a journal lies beside it (session_journal.h) what to do with that; bad_data
// when it is no session, is damaged, or was changed after it was made (hash).
Result<Session> read_session(FileSystem& files, const std::string& path);

// The text of transfers.jsonl, and back: bad_data with the line's number.
std::string to_lines(const std::vector<SessionTransfer>& transfers);
Result<std::vector<SessionTransfer>> parse_lines(std::string_view text);

}  // namespace sixpoint::device
