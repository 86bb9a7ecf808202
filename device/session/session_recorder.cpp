#include "device/session/session_recorder.h"

#include <optional>

#include "device/session/session_journal.h"

namespace sixpoint::device {

using std::chrono::nanoseconds;

struct SessionRecorder::Log {
  std::mutex mutex;
  std::optional<SessionJournal> journal;
  std::string target;
  Status written;  // the first thing that went wrong with it
  bool truncated = false;
  std::uint64_t bytes = 0;
  std::uint64_t most_bytes = 0;
  std::shared_ptr<Clock> clock;
  nanoseconds start{0};

  void add(SessionTransfer transfer) {
    const std::lock_guard lock(mutex);
    if (!journal || !written || truncated) {
      return;
    }
    constexpr std::uint64_t kPerTransfer = 64;
    bytes += transfer.bytes.size() + kPerTransfer;
    if (bytes > most_bytes) {
      truncated = true;
      return;
    }
    transfer.time = clock->elapsed() - start;
    written = journal->append(transfer);
  }
};

namespace {

using Kind = SessionTransfer::Kind;

class RecordedTransport final : public Transport {
 public:
  RecordedTransport(std::unique_ptr<Transport> inner, SessionChannel channel,
                    std::shared_ptr<SessionRecorder::Log> log)
      : inner_(std::move(inner)), channel_(channel), log_(std::move(log)) {}

  Status write(std::span<const std::uint8_t> bytes, nanoseconds time_out) override {
    Status status = inner_->write(bytes, time_out);
    SessionTransfer transfer{Kind::to_device, channel_, {}, Bytes(bytes.begin(), bytes.end()), {}};
    if (!status) {
      transfer.error = status.error();
    }
    log_->add(std::move(transfer));
    return status;
  }
  Result<std::size_t> read(std::span<std::uint8_t> out, nanoseconds time_out) override {
    Result<std::size_t> count = inner_->read(out, time_out);
    if (!count) {
      log_->add({Kind::from_device, channel_, {}, {}, count.error()});
    } else if (*count > 0) {
      const auto bytes = out.first(std::min(*count, out.size()));
      log_->add({Kind::from_device, channel_, {}, Bytes(bytes.begin(), bytes.end()), {}});
    }
    return count;
  }
  void cancel() override { inner_->cancel(); }

 private:
  std::unique_ptr<Transport> inner_;
  SessionChannel channel_;
  std::shared_ptr<SessionRecorder::Log> log_;
};

void wrap(Link& link, const std::shared_ptr<SessionRecorder::Log>& log) {
  link.reports =
      std::make_unique<RecordedTransport>(std::move(link.reports), SessionChannel::reports, log);
  if (link.bulk) {
    link.bulk =
        std::make_unique<RecordedTransport>(std::move(link.bulk), SessionChannel::bulk, log);
  }
}

}  // namespace

SessionRecorder::SessionRecorder(std::uint64_t most_bytes) : log_(std::make_shared<Log>()) {
  log_->most_bytes = most_bytes;
}

Status SessionRecorder::begin(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(auto journal, SessionJournal::create(files, path));
  const std::lock_guard lock(log_->mutex);
  log_->journal.emplace(std::move(journal));
  log_->target = path;
  return {};
}

void SessionRecorder::attach(Link& link) {
  {
    const std::lock_guard lock(log_->mutex);
    if (!log_->journal) {
      return;
    }
    log_->clock = link.clock;
    log_->start = link.clock->elapsed();
    log_->written = log_->journal->begin(link.address, link.clock->now());
  }
  wrap(link, log_);
  if (link.reopen) {
    link.reopen = [reopen = std::move(link.reopen), log = log_]() -> Result<Link> {
      Result<Link> again = reopen();
      SessionTransfer transfer;
      transfer.kind = Kind::reopened;
      if (!again) {
        transfer.error = again.error();
      } else {
        wrap(*again, log);
      }
      log->add(std::move(transfer));
      return again;
    };
  }
}

Status SessionRecorder::finish() {
  const std::lock_guard lock(log_->mutex);
  if (!log_->journal) {
    return {};
  }
  SessionJournal journal = *std::move(log_->journal);
  log_->journal.reset();
  if (!log_->written) {
    Error error = log_->written.error();
    error.what = "the session could not be recorded to its end: " + error.what;
    error.hint = "what was recorded before: 'sixpoint session recover " + printable(log_->target) +
                 "'; " + error.hint;
    return fail(std::move(error));
  }
  return journal.finish(log_->truncated);
}

bool SessionRecorder::truncated() const {
  const std::lock_guard lock(log_->mutex);
  return log_->truncated;
}

}  // namespace sixpoint::device
