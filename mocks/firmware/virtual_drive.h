// The folder of a unit with mass storage and nothing else.
//
//   Status made = make_virtual_drive(env.files, "/media/UNIT", {});  // info.txt and log.bin
#pragma once

#include <string>

#include "mocks/firmware/virtual_unit.h"

namespace sixpoint::mocks {

struct VirtualDriveOptions {
  VirtualUnitOptions unit;
  int rate_hz = 30;
  double side_s = 45;  // how long it lies on each side
  int sides = 6;       // fewer: some sides are missing
};

// A .gt3x file of a unit that recorded while it lay on its sides, one after the other. usage where
// a unit of these settings records nothing.
Result<Bytes> virtual_drive_recording(const VirtualDriveOptions& options);

// Makes `folder` with info.txt and log.bin of that recording. cannot_create where they cannot be
// made.
Status make_virtual_drive(FileSystem& files, const std::string& folder,
                          const VirtualDriveOptions& options);

}  // namespace sixpoint::mocks
