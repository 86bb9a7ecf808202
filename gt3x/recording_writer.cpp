#include "gt3x/recording_writer.h"

#include <cerrno>
#include <cstdio>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <zip.h>

#include "base/atomic_file.h"
#include "gt3x/container/zip_bridge.h"
#include "gt3x/recording_archive.h"

namespace sixpoint::gt3x {
namespace {

// 1980-01-01 00:00:00, the zero of MS-DOS time: the same for every entry of every run.
constexpr zip_uint16_t kDosDate = 0x21;
constexpr zip_uint16_t kDosTime = 0;

}  // namespace

struct RecordingWriter::Archive {
  Archive(AtomicFile&& file, std::string target) : out(std::move(file)), path(std::move(target)) {}
  Archive(const Archive&) = delete;
  Archive& operator=(const Archive&) = delete;
  ~Archive() {
    if (zip != nullptr) {
      zip_discard(zip);
    }
  }

  static zip_int64_t destination(void* user, void* data, zip_uint64_t length,
                                 zip_source_cmd_t command);

  // What libzip says goes behind what a source or the disk said: that came first and says more.
  tl::unexpected<Error> failed(const std::string& doing) {
    if (failure) {
      return fail(*failure);
    }
    return fail(ErrorCode::io, fmt::format("{}: {}", doing, zip_strerror(zip)), path,
                "check the disk and run the command again");
  }

  Status take_name(const std::string& name) {
    if (name.empty() || name.size() > 255 || name.find_first_of("/\\:") != std::string::npos ||
        name.starts_with('.')) {
      return fail(ErrorCode::usage, "an entry cannot be named '" + printable(name, 60) + "'", path,
                  "use a plain file name");
    }
    if (!names.insert(name).second) {
      return fail(ErrorCode::usage, "an entry named " + printable(name, 60) + " was added already",
                  path, "add each entry once");
    }
    return {};
  }

  // Takes `source` along, also when it fails.
  Status add(const std::string& name, zip_source_t* source, int method) {
    if (source == nullptr) {
      return failed("adding " + name);
    }
    const zip_int64_t index = zip_file_add(zip, name.c_str(), source, ZIP_FL_ENC_UTF_8);
    if (index < 0) {
      zip_source_free(source);
      return failed("adding " + name);
    }
    const auto entry = static_cast<zip_uint64_t>(index);
    if (zip_set_file_compression(zip, entry, method, 6) != 0 ||
        zip_file_set_dostime(zip, entry, kDosTime, kDosDate, 0) != 0) {
      return failed("adding " + name);
    }
    return {};
  }

  AtomicFile out;
  std::string path;
  std::set<std::string> names;
  std::vector<std::shared_ptr<void>> origins;  // archives that entries are copied from at commit()
  std::optional<Error> failure;
  zip_t* zip = nullptr;
  std::uint64_t at = 0;
  std::uint64_t end = 0;
  zip_error_t error{};
};

zip_int64_t RecordingWriter::Archive::destination(void* user, void* data, zip_uint64_t length,
                                                  zip_source_cmd_t command) {
  auto* self = static_cast<Archive*>(user);
  switch (command) {
    case ZIP_SOURCE_WRITE: {
      const std::span bytes(static_cast<const std::uint8_t*>(data), length);
      if (auto status = self->out.file().write_at(self->at, bytes); !status) {
        return refuse(std::move(status).error(), self->failure, ZIP_ER_WRITE, self->error);
      }
      self->at += length;
      self->end = std::max(self->end, self->at);
      return static_cast<zip_int64_t>(length);
    }
    case ZIP_SOURCE_SEEK_WRITE:
      return seek(self->at, self->end, data, length, self->error);
    case ZIP_SOURCE_TELL_WRITE:
      return static_cast<zip_int64_t>(self->at);
    case ZIP_SOURCE_BEGIN_WRITE:
    case ZIP_SOURCE_COMMIT_WRITE:  // commit() does it, behind libzip's back
    case ZIP_SOURCE_ROLLBACK_WRITE:
    case ZIP_SOURCE_REMOVE:
    case ZIP_SOURCE_CLOSE:
    case ZIP_SOURCE_FREE:  // the archive owns itself
      return 0;
    case ZIP_SOURCE_STAT:  // nothing there yet
      zip_error_set(&self->error, ZIP_ER_READ, ENOENT);
      return -1;
    case ZIP_SOURCE_ERROR:
      return zip_error_to_data(&self->error, data, length);
    case ZIP_SOURCE_SUPPORTS:
      return ZIP_SOURCE_SUPPORTS_WRITABLE;
    default:
      zip_error_set(&self->error, ZIP_ER_OPNOTSUPP, 0);
      return -1;
  }
}

RecordingWriter::RecordingWriter(std::unique_ptr<Archive> archive) : archive_(std::move(archive)) {}
RecordingWriter::RecordingWriter(RecordingWriter&&) noexcept = default;
RecordingWriter& RecordingWriter::operator=(RecordingWriter&&) noexcept = default;
RecordingWriter::~RecordingWriter() = default;

Result<RecordingWriter> RecordingWriter::create(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(auto out, AtomicFile::create(files, path));
  auto archive = std::make_unique<Archive>(std::move(out), path);
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* destination =
      zip_source_function_create(&Archive::destination, archive.get(), &error);
  if (destination != nullptr) {
    archive->zip = zip_open_from_source(destination, ZIP_CREATE | ZIP_TRUNCATE, &error);
    if (archive->zip == nullptr) {
      zip_source_free(destination);
    }
  }
  if (archive->zip == nullptr) {
    return fail(ErrorCode::internal, "libzip: " + describe(&error), path,
                "please report it with the command line");
  }
  zip_error_fini(&error);
  return RecordingWriter(std::move(archive));
}

Status RecordingWriter::add(const std::string& name, Bytes bytes, Compression compression) {
  return add(name, std::make_unique<MemorySource>(std::move(bytes)), compression);
}

Status RecordingWriter::add(const std::string& name, std::string_view text,
                            Compression compression) {
  return add(name, Bytes(text.begin(), text.end()), compression);
}

Status RecordingWriter::add(const std::string& name, std::unique_ptr<ByteSource> source,
                            Compression compression) {
  SIXPOINT_CHECK(archive_->take_name(name));
  zip_source_t* pulled = make_pulling_source(std::move(source), &archive_->failure);
  return archive_->add(name, pulled,
                       compression == Compression::store ? ZIP_CM_STORE : ZIP_CM_DEFLATE);
}

Status RecordingWriter::copy(Recording& from, const std::string& name) {
  SIXPOINT_ASSIGN(const auto source, from.open_entry(name));
  Bytes piece(std::size_t{64} * 1024);
  for (;;) {
    SIXPOINT_ASSIGN(const std::size_t count, source->read(piece));
    if (count == 0) {
      break;
    }
  }
  SIXPOINT_CHECK(archive_->take_name(name));
  const std::size_t index = *from.archive_->index_of(name);
  zip_stat_t stat;
  zip_stat_init(&stat);
  if (zip_stat_index(from.archive_->zip, index, 0, &stat) != 0) {
    return archive_->failed("copying " + name);
  }
  archive_->origins.push_back(from.archive_);
  zip_source_t* compressed =
      zip_source_zip(archive_->zip, from.archive_->zip, index, ZIP_FL_COMPRESSED, 0, -1);
  return archive_->add(name, compressed, stat.comp_method);
}

Status RecordingWriter::commit() {
  Archive& archive = *archive_;
  if (archive.zip == nullptr || archive.names.empty()) {
    return fail(ErrorCode::internal, "there is nothing to write", archive.path,
                "please report it with the command line");
  }
  if (zip_close(archive.zip) != 0) {
    auto failure = archive.failed("writing failed");
    zip_discard(std::exchange(archive.zip, nullptr));
    return failure;
  }
  archive.zip = nullptr;
  return archive.out.commit();
}

}  // namespace sixpoint::gt3x
