// The folder that a unit with mass storage and nothing else shows when it is plugged in.
#pragma once

#include <string>

#include "mocks/virtual_unit.h"

namespace sixpoint::mocks {

struct VirtualDriveOptions {
  VirtualUnitOptions unit;
  int rate_hz = 30;
  double side_s = 45;  // how long it lies on each of its sides
  int sides = 6;       // fewer: the person left some out
};

// A .gt3x file of a unit that recorded while it lay on its sides, one after the other. usage where
// a unit of these settings records nothing.
Result<Bytes> virtual_drive_recording(const VirtualDriveOptions& options);

// Makes `folder` with info.txt and log.bin of that recording. cannot_create where they cannot be
// made.
Status make_virtual_drive(FileSystem& files, const std::string& folder,
                          const VirtualDriveOptions& options);

}  // namespace sixpoint::mocks
