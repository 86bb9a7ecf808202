#include "mocks/firmware/virtual_drive.h"

#include <algorithm>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "base/time.h"
#include "device/jig.h"
#include "device/wire/payload.h"
#include "gt3x/recording.h"

namespace sixpoint::mocks {

namespace {

void command(VirtualUnit& unit, device::Command number, Bytes payload, nanoseconds now) {
  unit.take_report(device::encode({device::ReportKind::request, 0, number, device::ReplyCode::ok,
                                   std::move(payload)}),
                   now);
}

}  // namespace

Result<Bytes> virtual_drive_recording(const VirtualDriveOptions& options) {
  VirtualUnit unit(options.unit);
  nanoseconds now{0};
  constexpr std::uint32_t kStart_unix_s = 1'400'000'000;
  command(unit, device::Command::start_recording,
          device::payload_of(static_cast<std::uint16_t>(options.rate_hz), kStart_unix_s), now);
  const auto sides = static_cast<std::size_t>(std::clamp(options.sides, 0, 6));
  for (std::size_t i = 0; i < sides; ++i) {
    const auto up = device::direction_of(device::kPoses[i]);
    unit.turn_to({up[0], up[1], up[2]}, now, 2);
    now += from_seconds(options.side_s);
  }
  command(unit, device::Command::stop_recording, {}, now);
  if (unit.recordings().empty()) {
    return fail(ErrorCode::usage, "a unit with these settings records nothing",
                options.unit.truth.serial, "give it charge and room");
  }
  return unit.recordings().front();
}

Status make_virtual_drive(FileSystem& files, const std::string& folder,
                          const VirtualDriveOptions& options) {
  SIXPOINT_ASSIGN(const Bytes image, virtual_drive_recording(options));
  MemoryFiles inside;
  SIXPOINT_CHECK(write_file(inside, "r.gt3x", as_text(image)));
  SIXPOINT_ASSIGN(gt3x::Recording recording, gt3x::Recording::open(inside, "r.gt3x"));
  SIXPOINT_CHECK(files.make_folders(folder));
  for (const char* name : {"info.txt", "log.bin"}) {
    SIXPOINT_ASSIGN(const auto entry, recording.open_entry(name));
    SIXPOINT_ASSIGN(const Bytes bytes, gt3x::read_all(*entry, 1ULL << 30U));
    SIXPOINT_CHECK(write_file(files, folder + "/" + name, as_text(bytes)));
  }
  return {};
}

}  // namespace sixpoint::mocks
