// WireUnit: downloads over the bulk channel, continued where an earlier one ended.
#include <algorithm>
#include <vector>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "device/wire/payload.h"
#include "device/wire/wire_unit.h"

namespace sixpoint::device {

Status WireUnit::download_from(const RecordingInfo& recording, std::uint64_t& offset,
                               WritableFile& file, Sha256& hash,
                               const std::function<void(std::uint64_t)>& progress) {
  constexpr std::uint64_t kPerRequest = 64ULL << 20U;
  // Blocks of an earlier request may still be in the pipe and in the carrier's transfers: so many
  // are dropped before the first block of the new request must come.
  constexpr int kStaleBlocks = 64;
  std::vector<std::uint8_t> buffer(kBulkBlockBytes + 1);
  int without_progress = 0;
  while (offset < recording.bytes) {
    const std::uint64_t length = std::min(kPerRequest, recording.bytes - offset);
    const std::uint64_t end = offset + length;
    const std::uint64_t begin = offset;
    SIXPOINT_ASSIGN(const Bytes payload,
                    ask(Command::download,
                        payload_of(recording.id, offset, static_cast<std::uint32_t>(length))));
    PayloadReader reader(payload);
    if (reader.get<std::uint64_t>() != length || !reader.ok()) {
      return bad_answer("the unit offers another length than its list says");
    }
    int stale = 0;
    while (offset < end) {
      const Result<std::size_t> count = link_.bulk->read(buffer, options_.bulk_time_out);
      if (!count && count.error().code != ErrorCode::io) {
        return fail(count.error());
      }
      if (!count || *count == 0) {
        break;  // a failed transfer or none: ask again from here
      }
      const Result<BulkBlock> block =
          decode_bulk(std::span(buffer).first(std::min(*count, buffer.size())));
      if (!block || block->recording != recording.id || block->offset != offset ||
          block->content.size() > end - offset) {
        if (offset == begin && ++stale <= kStaleBlocks) {
          continue;
        }
        break;
      }
      SIXPOINT_CHECK(file.write_at(offset, block->content));
      hash.update(block->content);
      offset += block->content.size();
      if (progress) {
        progress(offset);
      }
    }
    without_progress = offset > begin ? 0 : without_progress + 1;
    if (without_progress >= options_.download_attempts) {
      return fail(ErrorCode::device_unavailable,
                  fmt::format("the download stopped at byte {} of {}", offset, recording.bytes),
                  link_.address, "plug the unit in again and repeat: the download continues");
    }
  }
  return {};
}

Status WireUnit::download(const RecordingInfo& recording, FileSystem& files,
                          const std::string& path,
                          const std::function<void(std::uint64_t)>& progress) {
  if (!link_.bulk) {
    return fail(ErrorCode::device_unavailable, "this device offers no download", link_.address,
                "connect the unit by USB");
  }
  SIXPOINT_CHECK(refuse_existing(files, path));
  const std::string part = fmt::format("{}.{}.part", path, to_hex(recording.sha256).substr(0, 12));
  const std::string before = part + ".before";

  // The part of an earlier call is renamed and copied, so that a loss of power now loses nothing.
  // Where that happened in mid-copy both are there, and the longer one is the one to go on from.
  if (const auto kept = files.info(part); kept) {
    const auto older = files.info(before);
    if (older && older->size > kept->size) {
      SIXPOINT_CHECK(files.remove(part));
    } else {
      SIXPOINT_CHECK(files.rename(part, before));
    }
  }
  SIXPOINT_ASSIGN(auto file, files.create(part));
  Sha256 hash;
  std::uint64_t offset = 0;
  if (const auto earlier = files.open(before); earlier) {
    Bytes chunk(kBulkContentBytes);
    while (offset < recording.bytes) {
      const std::uint64_t wanted = std::min<std::uint64_t>(chunk.size(), recording.bytes - offset);
      SIXPOINT_ASSIGN(const std::size_t count,
                      (*earlier)->read_at(offset, std::span(chunk).first(wanted)));
      if (count == 0) {
        break;
      }
      const auto bytes = std::span(chunk).first(count);
      SIXPOINT_CHECK(file->write_at(offset, bytes));
      hash.update(bytes);
      offset += count;
    }
  }
  const Status came = download_from(recording, offset, *file, hash, progress);
  SIXPOINT_CHECK(file->sync());
  SIXPOINT_CHECK(file->close());
  SIXPOINT_CHECK(files.sync_folder(folder_of(path)));
  if (files.info(before)) {
    SIXPOINT_CHECK(files.remove(before));
  }
  SIXPOINT_CHECK(came);
  if (hash.finish() != recording.sha256) {
    SIXPOINT_CHECK(files.remove(part));
    return fail(ErrorCode::bad_data, "what came is not the recording that the unit announced",
                link_.address, "download it again");
  }
  return put_in_place(files, part, path);
}

}  // namespace sixpoint::device
