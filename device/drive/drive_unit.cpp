#include "device/drive/drive_unit.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/serial.h"
#include "base/sha256.h"
#include "gt3x/forms/info.h"
#include "gt3x/forms/model.h"
#include "gt3x/recording_writer.h"

namespace sixpoint::device {

namespace {

constexpr const char* kInfoName = "info.txt";
constexpr const char* kLogName = "log.bin";
constexpr std::uint64_t kMostInfo_bytes = 1U << 20U;

// log.bin, piece by piece, and its hash on the way.
class LogSource final : public gt3x::ByteSource {
 public:
  LogSource(std::unique_ptr<ReadableFile> file, Sha256& hash,
            const std::function<void(std::uint64_t)>& progress)
      : file_(std::move(file)), hash_(hash), progress_(progress) {}
  Result<std::size_t> read(std::span<std::uint8_t> out) override {
    SIXPOINT_ASSIGN(const std::size_t count, file_->read_at(offset_, out));
    hash_.update(std::span<const std::uint8_t>(out.first(count)));
    offset_ += count;
    if (progress_) {
      progress_(offset_);
    }
    return count;
  }
  std::optional<std::uint64_t> size() const override { return file_->size(); }

 private:
  std::unique_ptr<ReadableFile> file_;
  Sha256& hash_;
  const std::function<void(std::uint64_t)>& progress_;
  std::uint64_t offset_ = 0;
};

// A name as Identity wants it: printable, without blanks, not too long.
std::string plain(std::string_view text, std::size_t limit) {
  std::string name;
  for (const char c : text.substr(0, limit)) {
    name += c > 0x20 && c < 0x7F ? c : '_';
  }
  return name;
}

}  // namespace

Result<std::unique_ptr<Unit>> DriveUnit::open(std::string folder, Env& env) {
  while (folder.size() > 1 && folder.back() == '/') {
    folder.pop_back();
  }
  const auto info = env.files.info(folder);
  if (!info || !info->is_folder) {
    return fail(ErrorCode::no_input, "there is no such folder", folder.empty() ? "drive:" : folder,
                "name the folder where the unit is mounted");
  }
  std::unique_ptr<DriveUnit> unit(new DriveUnit(std::move(folder), env));
  SIXPOINT_ASSIGN(unit->identity_, unit->read_identity());
  return std::unique_ptr<Unit>(std::move(unit));
}

Result<Identity> DriveUnit::read_identity() const {
  for (const char* name : {kInfoName, kLogName}) {
    if (!env_.files.info(path_of(name))) {
      return fail(
          ErrorCode::bad_data, fmt::format("this folder holds no {}", name), folder_,
          "a unit's folder holds info.txt and log.bin: is it mounted? A .gt3x file needs no "
          "unit: 'sixpoint solve FILE'");
    }
  }
  SIXPOINT_ASSIGN(const Bytes text, read_file(env_.files, path_of(kInfoName), kMostInfo_bytes));
  SIXPOINT_ASSIGN(const gt3x::Info info, gt3x::Info::parse(as_text(text)));
  Identity identity;
  identity.serial = gt3x::unit_serial(info.serial());
  if (!is_serial(identity.serial)) {
    return fail(ErrorCode::bad_data, "info.txt names no serial number of a unit",
                path_of(kInfoName), "copy the recording with the vendor's software");
  }
  identity.firmware = plain(info.firmware(), 12);
  identity.model = plain(info.device_type(), 12);
  // 0 where info.txt names none: such a unit takes no command that needs charge.
  identity.battery_mv = static_cast<std::uint16_t>(
      std::lround(std::clamp(info.battery_v().value_or(0), 0.0, 60.0) * 1000));
  identity.accel_scale_lsb_per_g = static_cast<std::uint16_t>(
      std::lround(std::clamp(info.accel_scale_lsb_per_g().value_or(256), 1.0, 65'535.0)));
  return identity;
}

Result<Identity> DriveUnit::identify() {
  SIXPOINT_ASSIGN(Identity identity, read_identity());
  if (identity.serial != identity_.serial) {
    return fail(ErrorCode::device_unavailable,
                fmt::format("the unit was {} and is now {}", identity_.serial, identity.serial),
                address_, "put the first unit back, or begin anew with this one");
  }
  identity_ = identity;
  return identity;
}

Status DriveUnit::reconnect(std::chrono::nanoseconds patience,
                            const std::function<Status()>& look) {
  const auto deadline = env_.clock.elapsed() + patience;
  for (;;) {
    const auto identity = identify();
    if (identity || identity.error().code == ErrorCode::device_unavailable) {
      return identity ? Status{} : Status(fail(identity.error()));
    }
    if (env_.clock.elapsed() >= deadline) {
      return fail(ErrorCode::device_unavailable, "the unit's folder did not come back", address_,
                  "mount it again");
    }
    if (look) {
      SIXPOINT_CHECK(look());
    }
    env_.clock.sleep(std::chrono::milliseconds(200));
  }
}

Result<std::vector<RecordingInfo>> DriveUnit::recordings() {
  SIXPOINT_ASSIGN(const FileInfo log, env_.files.info(path_of(kLogName)));
  RecordingInfo info;
  info.id = 1;
  info.bytes = log.size;
  SIXPOINT_ASSIGN(info.sha256, file_digest(env_.files, path_of(kLogName)));
  return std::vector<RecordingInfo>{info};
}

Status DriveUnit::download(const RecordingInfo& recording, FileSystem& files,
                           const std::string& path,
                           const std::function<void(std::uint64_t)>& progress) {
  if (files.info(path)) {
    return fail(ErrorCode::cannot_create, "the file exists already", path,
                "choose another name or remove it");
  }
  SIXPOINT_ASSIGN(Bytes info, read_file(env_.files, path_of(kInfoName), kMostInfo_bytes));
  SIXPOINT_ASSIGN(auto log, env_.files.open(path_of(kLogName)));
  Sha256 hash;
  LogSource source(std::move(log), hash, progress);
  SIXPOINT_ASSIGN(auto writer, gt3x::RecordingWriter::create(files, path));
  SIXPOINT_CHECK(writer.add(kLogName, source));
  SIXPOINT_CHECK(writer.add(kInfoName, std::move(info)));
  // Before the file has its name: a recording that is not the announced one never has it.
  SIXPOINT_CHECK(identify());
  if (hash.finish() != recording.sha256) {
    return fail(ErrorCode::bad_data, "log.bin changed while it was read", address_,
                "stop the unit's recording, then copy it again");
  }
  return writer.commit();
}

void register_drive(UnitRegistry& registry) {
  registry.add("drive", "drive:/media/UNIT", [](std::string_view rest, Env& env) {
    return DriveUnit::open(std::string(rest), env);
  });
}

}  // namespace sixpoint::device
