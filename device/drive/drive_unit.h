// A unit that offers mass storage and nothing else: a folder with info.txt and log.bin in it
// (docs/devices/file-monitor.md). It is calibrated by files alone.
//
//   Result<std::unique_ptr<Unit>> unit = DriveUnit::open("/media/UNIT", env);
//
// It has one recording to download. It takes no commands: everything else fails with `usage`.
#pragma once

#include "device/unit_registry.h"

namespace sixpoint::device {

class DriveUnit final : public Unit {
 public:
  // `folder` is where the unit is mounted. `env` outlives it. no_input where there is no such
  // folder, bad_data where it holds no info.txt and log.bin of a unit.
  static Result<std::unique_ptr<Unit>> open(std::string folder, Env& env);

  UnitAbilities abilities() const override { return {false, false, false, true}; }
  const Identity& identity() const override { return identity_; }
  Clock& clock() override { return env_.clock; }
  const std::string& address() const override { return address_; }
  Result<Identity> identify() override;
  using Unit::reconnect;
  Status reconnect(std::chrono::nanoseconds patience, const std::function<Status()>& look) override;

  // The one recording; bytes and hash are those of its log.bin.
  Result<std::vector<RecordingInfo>> recordings() override;
  // Makes a .gt3x of log.bin and info.txt, byte for byte as they are in the unit. bad_data when
  // log.bin changes while it is read, or the unit under the folder is another one afterwards.
  Status download(const RecordingInfo& recording, FileSystem& files, const std::string& path,
                  const std::function<void(std::uint64_t)>& progress) override;
  void cancel() override {}

 private:
  DriveUnit(std::string folder, Env& env)
      : folder_(std::move(folder)), address_("drive:" + folder_), env_(env) {}

  std::string path_of(const char* name) const { return folder_ + "/" + name; }
  Result<Identity> read_identity() const;

  std::string folder_;
  std::string address_;
  Env& env_;
  Identity identity_;
};

// Registers "drive:FOLDER".
void register_drive(UnitRegistry& registry);

}  // namespace sixpoint::device
