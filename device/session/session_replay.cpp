#include "device/session/session_replay.h"

#include <algorithm>
#include <deque>
#include <map>
#include <mutex>

#include <fmt/format.h>

#include "base/memory_env.h"
#include "device/corner.h"
#include "device/wire/protocol.h"

namespace sixpoint::device {

namespace {

using std::chrono::nanoseconds;
using Kind = SessionTransfer::Kind;

// What a request is compared by.
Bytes masked(std::span<const std::uint8_t> bytes) {
  Bytes copy(bytes.begin(), bytes.end());
  const Result<Message> message = decode(bytes);
  if (message && message->kind == ReportKind::request &&
      message->command == Command::start_recording && message->payload.size() == 6) {
    Message without_time = *message;
    std::fill(without_time.payload.begin() + 2, without_time.payload.end(), std::uint8_t{0});
    const Report report = encode(without_time);
    copy.assign(report.begin(), report.end());
  }
  return copy;
}

std::string key_of(std::span<const std::uint8_t> bytes) {
  const Bytes whole = masked(bytes);
  const Result<Message> message = decode(whole);
  if (!message) {
    return {whole.begin(), whole.end()};
  }
  std::string key(1, static_cast<char>(message->command));
  key.append(message->payload.begin(), message->payload.end());
  return key;
}

std::string message_name(std::span<const std::uint8_t> bytes) {
  const Result<Message> message = decode(bytes);
  return message ? fmt::format("'{}'", to_string(message->command))
                 : fmt::format("{} bytes that are no request", bytes.size());
}

// Of two requests of one name; empty where their names say it, or where one is no request.
std::string what_differs(std::span<const std::uint8_t> sent,
                         std::span<const std::uint8_t> recorded) {
  const Result<Message> ours = decode(sent);
  const Result<Message> theirs = decode(recorded);
  if (!ours || !theirs || ours->command != theirs->command) {
    return {};
  }
  const Bytes& one = ours->payload;
  const Bytes& other = theirs->payload;
  const auto [at, there] = std::mismatch(one.begin(), one.end(), other.begin(), other.end());
  if (at == one.end() && there == other.end()) {
    return ours->sequence == theirs->sequence
               ? std::string()
               : fmt::format(": its sequence number is {}, in the session {}", ours->sequence,
                             theirs->sequence);
  }
  const auto byte = [](auto place, auto end) {
    return place == end ? std::string("not there") : fmt::format("{:#04x}", *place);
  };
  return fmt::format(": byte {} of its payload is {}, in the session {}", at - one.begin(),
                     byte(at, one.end()), byte(there, other.end()));
}

class Player {
 public:
  Player(Session session, SessionMatch match)
      : session_(std::move(session)),
        match_(match),
        clock_(std::make_shared<ManualClock>(session_.started)),
        consumed_(session_.transfers.size(), false) {
    if (match_ == SessionMatch::by_key) {
      for (std::size_t i = 0; i < session_.transfers.size(); ++i) {
        const SessionTransfer& transfer = session_.transfers[i];
        if (transfer.kind == Kind::to_device && !transfer.error) {
          answers_[key_of(transfer.bytes)].push_back(i);
        }
      }
    }
  }

  std::shared_ptr<Clock> clock() const { return clock_; }

  Status write(std::span<const std::uint8_t> bytes) {
    const std::lock_guard lock(mutex_);
    if (cancelled_) {
      return ended();
    }
    if (diverged_) {
      return fail(*diverged_);
    }
    Status status = match_ == SessionMatch::strict ? write_strictly(bytes) : write_by_key(bytes);
    if (!status && status.error().code == ErrorCode::bad_data) {
      diverged_ = status.error();
    }
    return status;
  }

  Result<std::size_t> read(SessionChannel channel, std::span<std::uint8_t> out,
                           nanoseconds time_out) {
    const std::lock_guard lock(mutex_);
    if (cancelled_) {
      return ended();
    }
    if (diverged_) {
      return fail(*diverged_);
    }
    return match_ == SessionMatch::strict ? read_strictly(channel, out, time_out)
                                          : read_by_key(channel, out, time_out);
  }

  // Whether the device came back at this place of the recording.
  Status reopen() {
    const std::lock_guard lock(mutex_);
    if (match_ == SessionMatch::by_key) {
      return reopen_by_key();
    }
    const std::size_t next = next_step();
    if (next == session_.transfers.size() || session_.transfers[next].kind != Kind::reopened) {
      return ended();
    }
    const SessionTransfer& transfer = session_.transfers[next];
    consume(next);
    advance_to(transfer.time);
    return transfer.error ? Status(fail(*transfer.error)) : Status{};
  }

  void cancel() {
    const std::lock_guard lock(mutex_);
    cancelled_ = true;
  }

 private:
  struct Held {
    nanoseconds due;
    std::size_t index;  // of the transfer in the session
    SessionTransfer transfer;
  };

  static tl::unexpected<Error> ended() {
    return fail(ErrorCode::device_unavailable, "the recorded session ends here", "replayed session",
                "record a longer one, or use match=key");
  }

  void advance_to(nanoseconds time) {
    if (const nanoseconds now = clock_->elapsed(); time > now) {
      clock_->sleep(time - now);
    }
  }

  void consume(std::size_t index) {
    consumed_[index] = true;
    while (first_ < consumed_.size() && consumed_[first_]) {
      ++first_;
    }
  }

  // The next write or reopening.
  std::size_t next_step() {
    step_ = std::max(step_, first_);
    while (step_ < session_.transfers.size() &&
           (consumed_[step_] || session_.transfers[step_].kind == Kind::from_device)) {
      ++step_;
    }
    return step_;
  }

  Status write_strictly(std::span<const std::uint8_t> bytes) {
    std::size_t next = next_step();
    if (next == session_.transfers.size()) {
      return ended();
    }
    const SessionTransfer& transfer = session_.transfers[next];
    if (transfer.kind == Kind::reopened || masked(transfer.bytes) != masked(bytes)) {
      return fail(ErrorCode::bad_data,
                  transfer.kind == Kind::reopened
                      ? fmt::format("the program sends {} where the session has the device opened "
                                    "again",
                                    message_name(bytes))
                      : fmt::format("the program sends {} where the session has {}{}",
                                    message_name(bytes), message_name(transfer.bytes),
                                    what_differs(masked(bytes), masked(transfer.bytes))),
                  fmt::format("replayed session, transfer {}", next + 1),
                  "use the options of the recording, or match=key");
    }
    consume(next);
    advance_to(transfer.time);
    return transfer.error ? Status(fail(*transfer.error)) : Status{};
  }

  Result<std::size_t> read_strictly(SessionChannel channel, std::span<std::uint8_t> out,
                                    nanoseconds time_out) {
    const std::size_t end = next_step();
    const nanoseconds until = clock_->elapsed() + time_out;
    std::size_t& cursor = cursors_[static_cast<std::size_t>(channel)];
    for (cursor = std::max(cursor, first_); cursor < end; ++cursor) {
      const SessionTransfer& transfer = session_.transfers[cursor];
      if (consumed_[cursor] || transfer.kind != Kind::from_device || transfer.channel != channel) {
        continue;
      }
      if (transfer.time > until) {
        break;
      }
      const std::size_t index = cursor;
      consume(index);
      advance_to(transfer.time);
      return give(transfer, out);
    }
    if (first_ == session_.transfers.size()) {
      return ended();
    }
    advance_to(until);
    return 0;
  }

  // The next attempt to open the device after it went away.
  Status reopen_by_key() {
    if (!gone_at_) {
      return ended();
    }
    while (++*gone_at_ < session_.transfers.size()) {
      const SessionTransfer& transfer = session_.transfers[*gone_at_];
      if (transfer.kind == Kind::reopened) {
        if (transfer.error) {
          return fail(*transfer.error);
        }
        gone_at_.reset();
        return {};
      }
    }
    return ended();
  }

  Status write_by_key(std::span<const std::uint8_t> bytes) {
    if (gone_at_) {
      return fail(gone_with_);
    }
    const auto found = answers_.find(key_of(bytes));
    if (found == answers_.end()) {
      return fail(
          ErrorCode::bad_data,
          fmt::format("the session has no answer to {} with this content", message_name(bytes)),
          "replayed session", "record a session in which it is asked");
    }
    std::deque<std::size_t>& uses = found->second;
    const std::size_t index = uses.front();
    if (uses.size() > 1) {
      uses.pop_front();  // the last answers again and again
    }
    const SessionTransfer& request = session_.transfers[index];
    const Result<Message> asked = decode(bytes);
    const Result<Message> recorded = decode(request.bytes);
    const nanoseconds now = clock_->elapsed();
    for (std::size_t i = index + 1; i < session_.transfers.size(); ++i) {
      const SessionTransfer& transfer = session_.transfers[i];
      if (transfer.kind != Kind::from_device) {
        break;
      }
      Held held{now + (transfer.time - request.time), i, transfer};
      const Result<Message> reply = decode(transfer.bytes);
      if (reply && asked && recorded && reply->kind == ReportKind::reply &&
          reply->sequence == recorded->sequence) {
        Message renewed = *reply;
        renewed.sequence = asked->sequence;
        const Report report = encode(renewed);
        held.transfer.bytes.assign(report.begin(), report.end());
      }
      held_[static_cast<std::size_t>(transfer.channel)].push_back(std::move(held));
    }
    return {};
  }

  Result<std::size_t> read_by_key(SessionChannel channel, std::span<std::uint8_t> out,
                                  nanoseconds time_out) {
    if (gone_at_) {
      return fail(gone_with_);
    }
    const nanoseconds until = clock_->elapsed() + time_out;
    std::deque<Held>& held = held_[static_cast<std::size_t>(channel)];
    if (held.empty() || held.front().due > until) {
      advance_to(until);
      return 0;
    }
    const Held next = std::move(held.front());
    held.pop_front();
    advance_to(next.due);
    if (next.transfer.error && next.transfer.error->code == ErrorCode::device_unavailable) {
      gone_at_ = next.index;
      gone_with_ = *next.transfer.error;
      held_ = {};
    }
    return give(next.transfer, out);
  }

  static Result<std::size_t> give(const SessionTransfer& transfer, std::span<std::uint8_t> out) {
    if (transfer.error) {
      return fail(*transfer.error);
    }
    const std::size_t count = std::min(out.size(), transfer.bytes.size());
    std::copy_n(transfer.bytes.begin(), count, out.begin());
    return count;
  }

  Session session_;
  SessionMatch match_;
  std::shared_ptr<ManualClock> clock_;
  std::mutex mutex_;
  bool cancelled_ = false;
  // Where the program left the recording: from there on every answer would be a guess.
  std::optional<Error> diverged_;
  // strict
  std::vector<bool> consumed_;
  std::size_t first_ = 0;  // all before it are consumed
  std::size_t step_ = 0;
  std::array<std::size_t, 2> cursors_{};
  // by_key
  std::map<std::string, std::deque<std::size_t>> answers_;
  std::array<std::deque<Held>, 2> held_;
  std::optional<std::size_t> gone_at_;  // the transfer at which the device went away
  Error gone_with_;
};

class ReplayedTransport final : public Transport {
 public:
  ReplayedTransport(std::shared_ptr<Player> player, SessionChannel channel)
      : player_(std::move(player)), channel_(channel) {}
  Status write(std::span<const std::uint8_t> bytes, nanoseconds /*time_out*/) override {
    return player_->write(bytes);
  }
  Result<std::size_t> read(std::span<std::uint8_t> out, nanoseconds time_out) override {
    return player_->read(channel_, out, time_out);
  }
  void cancel() override { player_->cancel(); }

 private:
  std::shared_ptr<Player> player_;
  SessionChannel channel_;
};

// The unit was turned during the recording: no person is asked again.
class ReplayedJig final : public Jig, public CornerJig {
 public:
  std::string name() const override { return "replayed session"; }
  bool turns_by_itself() const override { return true; }
  Status go_to(Pose /*pose*/) override { return {}; }
  bool can_half_turn() const override { return true; }
  Status go_to_half_turned(Pose /*pose*/) override { return {}; }
  Status go_to_corner(const Corner& /*corner*/) override { return {}; }
  Result<JigPosition> position() override { return JigPosition{}; }
  Status stop() override { return {}; }
  Status release() override { return {}; }
};

Link link_to(const std::shared_ptr<Player>& player, bool with_bulk) {
  Link link;
  link.address = "replay:";
  link.clock = player->clock();
  link.reports = std::make_unique<ReplayedTransport>(player, SessionChannel::reports);
  if (with_bulk) {
    link.bulk = std::make_unique<ReplayedTransport>(player, SessionChannel::bulk);
  }
  link.jig = std::make_unique<ReplayedJig>();
  link.reopen = [player, with_bulk]() -> Result<Link> {
    SIXPOINT_CHECK(player->reopen());
    return link_to(player, with_bulk);
  };
  return link;
}

}  // namespace

Link replay_link(Session session, SessionMatch match) {
  return link_to(std::make_shared<Player>(std::move(session), match), true);
}

void register_replay(TransportRegistry& registry) {
  registry.add("replay", "replay:session.zip", [](std::string_view rest, Env& env) -> Result<Link> {
    constexpr std::string_view kMatch = ",match=";
    SessionMatch match = SessionMatch::strict;
    if (const std::size_t at = rest.rfind(kMatch); at != std::string_view::npos) {
      const std::string_view mode = rest.substr(at + kMatch.size());
      if (mode != "key" && mode != "strict") {
        return fail(ErrorCode::usage,
                    fmt::format("match={} is neither strict nor key", printable(mode, 40)), {},
                    "docs/sessions.md describes both");
      }
      match = mode == "key" ? SessionMatch::by_key : SessionMatch::strict;
      rest = rest.substr(0, at);
    }
    SIXPOINT_ASSIGN(Session session, read_session(env.files, std::string(rest)));
    return replay_link(std::move(session), match);
  });
}

}  // namespace sixpoint::device
