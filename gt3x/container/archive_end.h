// Where a zip archive ends within its file: bytes that stand behind it are not its own.
//
//   SIXPOINT_ASSIGN(const std::uint64_t end, archive_end(*file));
//   const std::uint64_t behind = file->size() - end;  // not read
//
// The archive ends with the last record of its kind (APPNOTE 4.3.16) that is true: the list of
// entries that it names ends where it, or its zip64 form, begins. Whatever stands behind it and its
// comment is ignored, any number of bytes. Where there is no such record the end is the file's.
// The file is read once, backwards, and only as far as the record.
#pragma once

#include <cstdint>

#include "base/env.h"

namespace sixpoint::gt3x {

// Errors of the disk only.
Result<std::uint64_t> archive_end(const ReadableFile& file);

}  // namespace sixpoint::gt3x
