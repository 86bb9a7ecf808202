// The archive of a session, piece by piece: what session.cpp and session_journal.cpp share.
//
//   const std::string line = to_line(transfer);
//   SIXPOINT_ASSIGN(const SessionTransfer same, parse_line(line, "session.zip"));
#pragma once

#include <memory>

#include "base/sha256.h"
#include "device/session/session.h"
#include "gt3x/container/byte_source.h"

namespace sixpoint::device {

// A jig run is half a megabyte; a download of a month at 100 Hz, in hexadecimal, two gigabytes,
// which is more than a session is for.
inline constexpr std::uint64_t kMostFile_bytes = 128ULL << 20U;
inline constexpr std::uint64_t kMostText_bytes = 512ULL << 20U;

// One line of transfers.jsonl, with its end; and back, without it. `where` is for the error.
std::string to_line(const SessionTransfer& transfer);
Result<SessionTransfer> parse_line(std::string_view line, const std::string& where);

// Whole or not at all. `hash` is that of the lines.
Status write_archive(FileSystem& files, const std::string& path, const SessionHead& head,
                     const Sha256Digest& hash, std::unique_ptr<gt3x::ByteSource> lines);

}  // namespace sixpoint::device
