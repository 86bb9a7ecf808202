#include "device/session/session.h"

#include <algorithm>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <zip.h>

#include "base/sha256.h"
#include "base/text/json_keys.h"
#include "base/text/json_text.h"
#include "device/session/session_archive.h"
#include "device/session/session_journal.h"
#include "gt3x/recording_writer.h"

namespace sixpoint::device {

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kSchema = "sixpoint/session/1";
constexpr const char* kHeadName = "session.json";
constexpr const char* kTransfersName = "transfers.jsonl";
constexpr std::size_t kMostTransferBytes = 1U << 20U;

tl::unexpected<Error> broken(std::string what, const std::string& where) {
  return fail(ErrorCode::bad_data, std::move(what), where,
              "record the session again; docs/sessions.md describes the form");
}

constexpr std::array<ErrorCode, 5> kTransferErrors = {ErrorCode::device_unavailable, ErrorCode::io,
                                                      ErrorCode::bad_data, ErrorCode::permission,
                                                      ErrorCode::internal};

struct CloseZip {
  void operator()(zip_t* zip) const { zip_discard(zip); }
};

Result<std::string> entry_of(zip_t& zip, const char* name, const std::string& path) {
  zip_stat_t stat;
  zip_stat_init(&stat);
  if (zip_stat(&zip, name, 0, &stat) != 0 || (stat.valid & ZIP_STAT_SIZE) == 0) {
    return broken(fmt::format("this is no session: it holds no {}", name), path);
  }
  if (stat.size > kMostText_bytes) {
    return broken("the session is larger than any that is made", path);
  }
  zip_file_t* file = zip_fopen(&zip, name, 0);
  if (file == nullptr) {
    return broken(fmt::format("{} cannot be read", name), path);
  }
  // Grows with the data: the size in the archive may be wrong.
  std::string text;
  std::array<char, 65'536> piece{};
  zip_int64_t count = 0;
  while ((count = zip_fread(file, piece.data(), piece.size())) > 0 &&
         text.size() <= kMostText_bytes) {
    text.append(piece.data(), static_cast<std::size_t>(count));
  }
  const bool failed = count != 0;
  zip_fclose(file);
  if (failed) {
    return broken(fmt::format("{} is damaged", name), path);
  }
  return text;
}

Sha256Digest digest_of(std::string_view text) { return sha256(as_bytes(text)); }

}  // namespace

Result<SessionTransfer> parse_line(std::string_view line, const std::string& where) {
  const Json json = parse_json(line);
  if (!json.is_object()) {
    return broken("this line is no transfer", where);
  }
  const auto text = [&json](const char* key) -> std::string {
    const auto found = json.find(key);
    return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  SessionTransfer transfer;
  const auto time = json.find("t_ns");
  if (time == json.end() || !time->is_number_integer() || time->get<std::int64_t>() < 0) {
    return broken("a transfer without its time", where);
  }
  transfer.time = std::chrono::nanoseconds(time->get<std::int64_t>());
  if (transfer.time > kLongestSession) {
    return broken("a transfer more than 30 days after the start", where);
  }
  const std::string kind = text("kind");
  if (kind == "out") {
    transfer.kind = SessionTransfer::Kind::to_device;
  } else if (kind == "in") {
    transfer.kind = SessionTransfer::Kind::from_device;
  } else if (kind == "reopened") {
    transfer.kind = SessionTransfer::Kind::reopened;
  } else {
    return broken("a transfer of no known kind", where);
  }
  const std::string channel = text("channel");
  if (channel != "reports" && channel != "bulk" &&
      !(channel.empty() && transfer.kind == SessionTransfer::Kind::reopened)) {
    return broken("a transfer on no known channel", where);
  }
  transfer.channel = channel == "bulk" ? SessionChannel::bulk : SessionChannel::reports;
  auto bytes = from_hex(text("hex"));
  if (!bytes || bytes->size() > kMostTransferBytes) {
    return broken("a transfer whose bytes are not hexadecimal, or too many", where);
  }
  transfer.bytes = std::move(*bytes);
  if (const std::string error = text("error"); !error.empty()) {
    const auto* const code =
        std::find_if(kTransferErrors.begin(), kTransferErrors.end(),
                     [&](ErrorCode known) { return to_string(known) == error; });
    if (code == kTransferErrors.end()) {
      return broken("a transfer with no known error", where);
    }
    transfer.error = Error{*code, printable(text("what"), 400), "replayed session",
                           "it was so when the session was recorded"};
  }
  return transfer;
}

std::string to_line(const SessionTransfer& transfer) {
  std::string text =
      fmt::format(R"({{"t_ns":{},"kind":"{}")", transfer.time.count(),
                  transfer.kind == SessionTransfer::Kind::to_device     ? "out"
                  : transfer.kind == SessionTransfer::Kind::from_device ? "in"
                                                                        : "reopened");
  if (transfer.kind != SessionTransfer::Kind::reopened) {
    text += transfer.channel == SessionChannel::bulk ? R"(,"channel":"bulk")"
                                                     : R"(,"channel":"reports")";
  }
  if (!transfer.bytes.empty()) {
    text += R"(,"hex":")";
    text += to_hex(transfer.bytes);
    text += '"';
  }
  if (transfer.error) {
    text += fmt::format(
        R"(,"error":"{}","what":{})", to_string(transfer.error->code),
        Json(transfer.error->what).dump(-1, ' ', false, Json::error_handler_t::replace));
  }
  text += "}\n";
  return text;
}

std::string to_lines(const std::vector<SessionTransfer>& transfers) {
  std::string text;
  for (const SessionTransfer& transfer : transfers) {
    text += to_line(transfer);
  }
  return text;
}

Result<std::vector<SessionTransfer>> parse_lines(std::string_view text) {
  std::vector<SessionTransfer> transfers;
  std::size_t number = 0;
  for (const std::string_view line : lines_of(text)) {
    const std::string where = fmt::format("transfer {}", ++number);
    if (line.empty()) {
      continue;
    }
    SIXPOINT_ASSIGN(SessionTransfer transfer, parse_line(line, where));
    if (!transfers.empty() && transfer.time < transfers.back().time) {
      return broken("time goes back", where);
    }
    transfers.push_back(std::move(transfer));
  }
  return transfers;
}

Status write_archive(FileSystem& files, const std::string& path, const SessionHead& head,
                     const Sha256Digest& hash, std::unique_ptr<gt3x::ByteSource> lines) {
  Json json;
  json["schema"] = kSchema;
  json["device"] = printable(head.device);
  json["started"] = to_iso8601(head.started);
  json["transfers"] = head.transfers;
  json["truncated"] = head.truncated;
  json["sha256"] = to_hex(hash);
  // The writer of recordings: one fixed time, so that the same session gives the same bytes.
  SIXPOINT_ASSIGN(auto zip, gt3x::RecordingWriter::create(files, path));
  SIXPOINT_CHECK(zip.add(kHeadName, json.dump(2) + "\n"));
  SIXPOINT_CHECK(zip.add(kTransfersName, *lines));
  return zip.commit();
}

Status write_session(FileSystem& files, const std::string& path, const Session& session) {
  const std::string lines = to_lines(session.transfers);
  return write_archive(
      files, path, {session.device, session.started, session.truncated, session.transfers.size()},
      digest_of(lines), std::make_unique<gt3x::MemorySource>(Bytes(lines.begin(), lines.end())));
}

Result<Session> read_session(FileSystem& files, const std::string& path) {
  if (!files.info(path) && files.info(journal_of(path))) {
    return fail(ErrorCode::no_input, "the recording of this session was broken off", path,
                fmt::format("make it whole with 'sixpoint session recover {}'", printable(path)));
  }
  SIXPOINT_ASSIGN(const Bytes bytes, read_file(files, path, kMostFile_bytes));
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* source = zip_source_buffer_create(bytes.data(), bytes.size(), 0, &error);
  zip_t* opened = source == nullptr ? nullptr : zip_open_from_source(source, ZIP_RDONLY, &error);
  if (opened == nullptr) {
    zip_source_free(source);
    zip_error_fini(&error);
    return broken("this is no session: it is no zip archive", path);
  }
  const std::unique_ptr<zip_t, CloseZip> zip(opened);
  SIXPOINT_ASSIGN(const std::string head_text, entry_of(*zip, kHeadName, path));
  if (const auto doubled = doubled_json_key(head_text)) {
    return broken(fmt::format("session.json has the key {} twice", printable(*doubled, 100)), path);
  }
  const Json head = parse_json(head_text);
  const auto member = [&head](const char* key) {
    return head.is_object() && head.contains(key) ? head[key] : Json();
  };
  if (member("schema") != kSchema) {
    return broken("this is no session of a version that this program reads", path);
  }
  Session session;
  session.device = member("device").is_string() ? member("device").get<std::string>() : "";
  if (!member("started").is_string()) {
    return broken("the session does not say when it began", path);
  }
  SIXPOINT_ASSIGN(session.started, parse_iso8601(member("started").get<std::string>()));
  session.truncated = member("truncated") == true;
  SIXPOINT_ASSIGN(const std::string lines, entry_of(*zip, kTransfersName, path));
  if (member("sha256") != to_hex(digest_of(lines))) {
    return broken(
        "the session was changed after it was recorded: its transfers do not have the "
        "hash that session.json names",
        path);
  }
  auto transfers = parse_lines(lines);
  if (!transfers) {
    Error what = std::move(transfers).error();
    what.where = path + ", " + what.where;
    return fail(std::move(what));
  }
  session.transfers = std::move(*transfers);
  // The hash is of the transfers alone: what session.json says about them is checked by itself.
  if (const Json said = member("transfers");
      !said.is_number_unsigned() || said.get<std::uint64_t>() != session.transfers.size()) {
    return broken(fmt::format("session.json does not say that there are {} transfers",
                              session.transfers.size()),
                  path);
  }
  return session;
}

}  // namespace sixpoint::device
