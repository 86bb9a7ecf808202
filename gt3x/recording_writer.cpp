#include "gt3x/recording_writer.h"

#include <optional>
#include <set>
#include <utility>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "gt3x/container/zip_writer.h"
#include "gt3x/recording_archive.h"

namespace sixpoint::gt3x {

struct RecordingWriter::Archive {
  Archive(AtomicFile&& file, std::string target, const WriterOptions& how)
      : out(std::move(file)),
        path(std::move(target)),
        options(how),
        zip([this](std::span<const std::uint8_t> bytes) { return put(bytes); }, how.jobs) {}
  Archive(const Archive&) = delete;
  Archive& operator=(const Archive&) = delete;

  Status put(std::span<const std::uint8_t> bytes) {
    hash.update(bytes);
    return out.append(bytes);
  }

  Status take_name(const std::string& name) {
    if (!stays_inside(name)) {
      return fail(ErrorCode::usage, "an entry cannot be named '" + printable(name, 60) + "'", path,
                  "use a name inside the archive");
    }
    if (names.size() == ArchiveLimits{}.entries) {
      return fail(ErrorCode::bad_data,
                  "one entry more than the " + std::to_string(ArchiveLimits{}.entries) +
                      " that a recording may have",
                  path, "take out of the original, or a copy, what does not belong to it");
    }
    if (!names.insert(name).second) {
      return fail(ErrorCode::usage, "an entry named " + printable(name, 60) + " was added already",
                  path, "add each entry once");
    }
    return {};
  }

  // After a failure half of an entry stands there: no more than that error comes of the archive.
  Status keep_failure(Status status) {
    if (!status && !failure) {
      failure = status.error();
    }
    return status;
  }

  AtomicFile out;
  std::string path;
  WriterOptions options;
  Sha256 hash;
  std::string sha256;
  std::set<std::string> names;
  std::optional<Error> failure;
  ZipWriter zip;
};

RecordingWriter::RecordingWriter(std::unique_ptr<Archive> archive) : archive_(std::move(archive)) {}
RecordingWriter::RecordingWriter(RecordingWriter&&) noexcept = default;
RecordingWriter& RecordingWriter::operator=(RecordingWriter&&) noexcept = default;
RecordingWriter::~RecordingWriter() = default;

Result<RecordingWriter> RecordingWriter::create(FileSystem& files, const std::string& path,
                                                const WriterOptions& options) {
  SIXPOINT_ASSIGN(auto out, AtomicFile::create(files, path));
  return RecordingWriter(std::make_unique<Archive>(std::move(out), path, options));
}

Status RecordingWriter::add(const std::string& name, ByteSource& source) {
  SIXPOINT_CHECK(archive_->take_name(name));
  return archive_->keep_failure(archive_->zip.add(name, source, archive_->options.packing));
}

Status RecordingWriter::add(const std::string& name, Bytes bytes) {
  MemorySource source(std::move(bytes));
  return add(name, source);
}

Status RecordingWriter::add(const std::string& name, std::string_view text) {
  return add(name, Bytes(text.begin(), text.end()));
}

Status RecordingWriter::copy(Recording& from, const std::string& name) {
  SIXPOINT_ASSIGN(const auto source, from.open_entry(name));
  Bytes piece(std::size_t{64} * 1024);
  std::size_t count = 0;
  do {
    SIXPOINT_ASSIGN(count, source->read(piece));
  } while (count > 0);
  SIXPOINT_CHECK(archive_->take_name(name));
  const std::size_t index = *from.archive_->index_of(name);
  SIXPOINT_ASSIGN(const EntryFacts facts, from.archive_->facts_of(index));
  SIXPOINT_ASSIGN(const auto packed, Recording::Archive::open_packed(from.archive_, index));
  return archive_->keep_failure(archive_->zip.add_packed(name, *packed, facts));
}

Status RecordingWriter::commit() {
  Archive& archive = *archive_;
  if (archive.failure) {
    return fail(*archive.failure);
  }
  if (archive.names.empty() || !archive.sha256.empty()) {
    return fail(ErrorCode::internal, "there is nothing to write", archive.path,
                "please report it with the command line");
  }
  SIXPOINT_CHECK(archive.zip.finish());
  archive.sha256 = to_hex(archive.hash.finish());
  return archive.out.commit();
}

const std::string& RecordingWriter::sha256() const { return archive_->sha256; }

}  // namespace sixpoint::gt3x
