#include "station/capture/recording_pieces.h"

#include <optional>

#include <fmt/format.h>

#include "gt3x/recording.h"
#include "gt3x/recording_writer.h"

namespace sixpoint::station {

namespace {

// The logs of the pieces, read one after the other.
class Chain final : public gt3x::ByteSource {
 public:
  explicit Chain(std::vector<std::unique_ptr<gt3x::ByteSource>> sources)
      : sources_(std::move(sources)) {}

  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    for (; at_ < sources_.size(); ++at_) {
      SIXPOINT_ASSIGN(const std::size_t count, sources_[at_]->read(out));
      if (count > 0) {
        return count;
      }
    }
    return 0;
  }
  std::optional<std::uint64_t> size() const override {
    std::uint64_t sum = 0;
    for (const auto& source : sources_) {
      const auto one = source->size();
      if (!one) {
        return std::nullopt;
      }
      sum += *one;
    }
    return sum;
  }

 private:
  std::vector<std::unique_ptr<gt3x::ByteSource>> sources_;
  std::size_t at_ = 0;
};

}  // namespace

std::string piece_name(const std::string& output, std::size_t number) {
  const std::size_t dot = output.rfind('.');
  const std::size_t end =
      dot == std::string::npos || output.find('/', dot) != std::string::npos ? output.size() : dot;
  return fmt::format("{}-{}{}", output.substr(0, end), number, output.substr(end));
}

Status join_recordings(FileSystem& files, const std::vector<std::string>& pieces,
                       const std::string& output) {
  std::optional<gt3x::Info> info;
  std::vector<std::unique_ptr<gt3x::ByteSource>> logs;
  for (const std::string& piece : pieces) {
    SIXPOINT_ASSIGN(gt3x::Recording recording, gt3x::Recording::open(files, piece));
    if (!info) {
      info = recording.info();
    } else if (info->serial() != recording.info().serial()) {
      return fail(ErrorCode::bad_data,
                  fmt::format("the recording is of {}", printable(recording.info().serial(), 40)),
                  piece, "another unit was plugged in; begin anew");
    }
    for (const char* key : {"Stop Date", "Last Sample Time", "Download Date"}) {
      if (const auto value = recording.info().get(key)) {
        info->set(key, std::string(*value));
      }
    }
    SIXPOINT_ASSIGN(auto log, recording.open_entry("log.bin"));
    logs.push_back(std::move(log));
  }
  if (!info) {
    return fail(ErrorCode::internal, "no pieces to join", output);
  }
  SIXPOINT_ASSIGN(auto writer, gt3x::RecordingWriter::create(files, output));
  Chain log(std::move(logs));
  SIXPOINT_CHECK(writer.add("log.bin", log));
  SIXPOINT_CHECK(writer.add("info.txt", info->serialise()));
  return writer.commit();
}

}  // namespace sixpoint::station
