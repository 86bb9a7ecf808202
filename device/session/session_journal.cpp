#include "device/session/session_journal.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/text/json_text.h"
#include "device/session/session_archive.h"

namespace sixpoint::device {

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kJournalSchema = "sixpoint/session-journal/1";
// A transfer of 1 MiB in hexadecimal, and its keys.
constexpr std::size_t kMostLine_bytes = (2U << 20U) + 4096;

// A part of a file, from front to back.
template <class File>
class PartOfFile final : public gt3x::ByteSource {
 public:
  PartOfFile(std::shared_ptr<File> file, std::uint64_t begin, std::uint64_t end)
      : file_(std::move(file)), at_(begin), begin_(begin), end_(end) {}
  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(out.size(), end_ - at_));
    if (count == 0) {
      return 0;
    }
    SIXPOINT_ASSIGN(const std::size_t got, file_->read_at(at_, out.first(count)));
    at_ += got;
    return got;
  }
  std::optional<std::uint64_t> size() const override { return end_ - begin_; }

 private:
  std::shared_ptr<File> file_;
  std::uint64_t at_;
  std::uint64_t begin_;
  std::uint64_t end_;
};

// Lines of a file that may end anywhere, and hold anything.
class Lines {
 public:
  explicit Lines(const ReadableFile& file) : file_(file) {}

  // Without its end. Empty at the end of the file, where the last line has no end, or where it is
  // longer than any line of a journal.
  Result<std::optional<std::string_view>> next() {
    for (;;) {
      const auto from = text_.begin() + static_cast<std::ptrdiff_t>(at_);
      const auto end = std::find(from, text_.end(), '\n');
      if (end != text_.end()) {
        const std::string_view line(text_.data() + at_, static_cast<std::size_t>(end - from));
        at_ += line.size() + 1;
        consumed_ += line.size() + 1;
        return line;
      }
      text_.erase(0, at_);
      at_ = 0;
      if (text_.size() > kMostLine_bytes) {
        return std::nullopt;
      }
      Bytes piece(std::size_t{64} * 1024);
      SIXPOINT_ASSIGN(const std::size_t count, file_.read_at(read_, piece));
      if (count == 0) {
        return std::nullopt;
      }
      read_ += count;
      text_.append(reinterpret_cast<const char*>(piece.data()), count);
    }
  }
  // Where the next line begins.
  std::uint64_t offset() const { return consumed_; }

 private:
  const ReadableFile& file_;
  std::string text_;
  std::size_t at_ = 0;
  std::uint64_t read_ = 0;
  std::uint64_t consumed_ = 0;
};

Result<SessionHead> parse_first_line(std::string_view line, const std::string& journal) {
  const Json json = parse_json(line);
  const auto text = [&json](const char* key) {
    const bool has = json.is_object() && json.contains(key) && json[key].is_string();
    return has ? json[key].get<std::string>() : std::string();
  };
  const auto started = parse_iso8601(text("started"));
  if (text("schema") != kJournalSchema || !started) {
    return fail(ErrorCode::bad_data, "this is no journal of a session", journal,
                "name the session, or its .journal beside it; one in which nothing was recorded "
                "can be removed");
  }
  SessionHead head;
  head.device = text("device");
  head.started = *started;
  return head;
}

// Null where the disk has no locks. cannot_create where a program still writes this journal.
Result<std::unique_ptr<FileLock>> lock_of_ended(FileSystem& files, const std::string& journal) {
  auto lock = files.lock(journal);
  if (!lock) {
    return nullptr;
  }
  if (*lock == nullptr) {
    return fail(ErrorCode::cannot_create, "this session is still being recorded", journal,
                "wait for its end, or give another name");
  }
  return lock;
}

}  // namespace

std::string journal_of(const std::string& target) { return target + ".journal"; }

Result<SessionJournal> SessionJournal::create(FileSystem& files, const std::string& target) {
  const std::string name = journal_of(target);
  auto file = files.create(name);
  if (!file) {
    if (!files.info(name)) {
      return fail(std::move(file).error());
    }
    SIXPOINT_CHECK(lock_of_ended(files, name));
    return fail(
        ErrorCode::cannot_create, "a recording of this session was broken off", name,
        fmt::format("keep it with 'sixpoint session recover {}', or remove it", printable(target)));
  }
  auto lock = files.lock(name);
  return SessionJournal(files, target, *std::move(file), lock ? *std::move(lock) : nullptr);
}

Status SessionJournal::write(std::string_view text) {
  SIXPOINT_CHECK(file_->write_at(end_, as_bytes(text)));
  end_ += text.size();
  if (end_ - synced_ >= kJournalSync_bytes) {
    SIXPOINT_CHECK(file_->sync());
    synced_ = end_;
  }
  return {};
}

Status SessionJournal::begin(const std::string& device, UtcTime started) {
  head_.device = printable(device);
  head_.started = started;
  Json json;
  json["schema"] = kJournalSchema;
  json["device"] = head_.device;
  json["started"] = to_iso8601(started);
  SIXPOINT_CHECK(write(json.dump() + "\n"));
  lines_begin_ = end_;
  return files_->sync_folder(folder_of(target_));
}

Status SessionJournal::append(const SessionTransfer& transfer) {
  const std::string line = to_line(transfer);
  SIXPOINT_CHECK(write(line));
  hash_.update(line);
  ++head_.transfers;
  return {};
}

Status SessionJournal::finish(bool truncated) {
  const std::string name = journal_of(target_);
  if (lines_begin_ > 0) {
    head_.truncated = truncated;
    const Status made =
        write_archive(*files_, target_, head_, hash_.finish(),
                      std::make_unique<PartOfFile<WritableFile>>(file_, lines_begin_, end_));
    if (!made) {
      Error error = made.error();
      // The command would end with 73 now, for the journal is there.
      error.where = target_;
      error.hint =
          fmt::format("the transfers are in {}; put that right, then: sixpoint session recover {}",
                      printable(name), printable(target_));
      return fail(std::move(error));
    }
  }
  static_cast<void>(file_->close());  // what it held is in the archive
  const Status removed = files_->remove(name);
  // A journal that is gone already is as good.
  return removed || !files_->info(name) ? Status{} : removed;
}

Result<RecoveredSession> recover_session(FileSystem& files, const std::string& journal,
                                         const std::string& target) {
  auto opened = files.open(journal);
  if (!opened) {
    Error error = std::move(opened).error();
    error.hint = "a journal is there only after a recording that was broken off";
    return fail(std::move(error));
  }
  SIXPOINT_ASSIGN(const auto lock, lock_of_ended(files, journal));
  SIXPOINT_CHECK(refuse_existing(files, target));
  const std::shared_ptr<ReadableFile> file = *std::move(opened);
  Lines lines(*file);
  SIXPOINT_ASSIGN(const auto first, lines.next());
  RecoveredSession recovered;
  recovered.target = target;
  SIXPOINT_ASSIGN(recovered.head, parse_first_line(first.value_or(""), journal));
  const std::uint64_t begin = lines.offset();
  std::uint64_t end = begin;
  Sha256 hash;
  std::chrono::nanoseconds last{0};
  for (;;) {
    SIXPOINT_ASSIGN(const auto line, lines.next());
    // After a power cut any bytes may follow the last sync: stop at the first that is no transfer.
    const auto transfer = line ? parse_line(*line, "") : fail(ErrorCode::bad_data, "no line");
    if (!transfer || transfer->time < last || lines.offset() - begin > kMostText_bytes) {
      break;
    }
    last = transfer->time;
    hash.update(*line);
    hash.update(std::string_view("\n"));
    ++recovered.head.transfers;
    end = lines.offset();
  }
  recovered.head.truncated = true;
  recovered.dropped_bytes = file->size() - end;
  SIXPOINT_CHECK(write_archive(files, target, recovered.head, hash.finish(),
                               std::make_unique<PartOfFile<ReadableFile>>(file, begin, end)));
  SIXPOINT_CHECK(files.remove(journal));
  return recovered;
}

}  // namespace sixpoint::device
