#include "base/atomic_file.h"

#include <algorithm>

#include <fmt/format.h>

#include "base/temporaries.h"

namespace sixpoint {

// A device or a pipe: bytes go through as they come, or, once the writer seeks, all of them at the
// end.
class AtomicFile::Held final : public WritableFile {
 public:
  explicit Held(std::unique_ptr<WritableFile> through) : through_(std::move(through)) {}
  void hold() { holds_ = true; }
  Status write_at(std::uint64_t offset, std::span<const std::uint8_t> bytes) override {
    if (!holds_) {
      return through_->write_at(offset, bytes);
    }
    bytes_.resize(std::max<std::size_t>(bytes_.size(), offset + bytes.size()));
    std::copy(bytes.begin(), bytes.end(), bytes_.begin() + static_cast<std::ptrdiff_t>(offset));
    return {};
  }
  Result<std::size_t> read_at(std::uint64_t offset, std::span<std::uint8_t> out) override {
    const std::size_t from = std::min<std::size_t>(offset, bytes_.size());
    const std::size_t count = std::min(out.size(), bytes_.size() - from);
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(from), count, out.begin());
    return count;
  }
  Status sync() override {
    SIXPOINT_CHECK(through_->write_at(0, bytes_));
    bytes_.clear();
    return through_->sync();
  }
  Status close() override { return through_->close(); }

 private:
  std::unique_ptr<WritableFile> through_;
  Bytes bytes_;
  bool holds_ = false;
};

AtomicFile::AtomicFile(FileSystem& files, std::string path, std::string temporary,
                       std::unique_ptr<WritableFile> file)
    : files_(&files),
      path_(std::move(path)),
      temporary_(std::move(temporary)),
      file_(std::move(file)) {}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : files_(other.files_),
      path_(std::move(other.path_)),
      temporary_(std::move(other.temporary_)),
      file_(std::move(other.file_)),
      held_(other.held_),
      size_(other.size_) {}

AtomicFile::~AtomicFile() {
  if (file_ != nullptr && !temporary_.empty()) {
    // While the lock is held: afterwards another process may have the name. Nothing can be done about
    // a failure here: the name says that the file is temporary.
    static_cast<void>(files_->remove(temporary_));
    file_.reset();
    forget_temporary(temporary_);
  }
}

namespace {

constexpr int kMostAttempts = 100;
constexpr std::size_t kLongestName_bytes = 255;    // of Linux's file systems
constexpr std::size_t kLongestTarget_bytes = 248;  // of NAME in .NAME.0.tmp

std::string temporary_name(const std::string& path, int attempt) {
  return fmt::format("{}/.{}.{}.tmp", folder_of(path), file_name_of(path), attempt);
}

// Removes what processes that are gone left for this target: a file that is being written is noted
// by this process, and locked by another one until it has its name (posix_env.cpp). Where the file
// system has no locks, nothing is known and everything stays. Where its locks hold on one machine
// only (NFS with nolock or local_lock, Lustre with localflock), a file that another machine is
// writing looks abandoned. Its age would not tell: what is left after a kill is as young when the
// same command is run again, and no later run looks at this target.
void remove_abandoned(FileSystem& files, const std::string& path) {
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    const std::string temporary = temporary_name(path, attempt);
    const auto info = files.link_info(temporary);
    if (!info) {
      return;
    }
    if (info->is_link || info->kind != FileKind::file || is_noted_temporary(temporary)) {
      continue;
    }
    if (const auto lock = files.lock(temporary); lock && *lock != nullptr) {
      static_cast<void>(files.remove(temporary));
    }
  }
}

}  // namespace

void AtomicFile::remove_left_over(FileSystem& files, const std::string& path) {
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    if (!files.info(temporary_name(path, attempt)) ||
        !files.remove(temporary_name(path, attempt))) {
      return;
    }
  }
}

Result<AtomicFile> AtomicFile::create(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(const Placement placement, files.placement(path));
  if (placement.how == Placing::through) {
    SIXPOINT_ASSIGN(auto through, files.open_through(placement.path));
    auto held = std::make_unique<Held>(std::move(through));
    Held* const whole = held.get();
    AtomicFile file(files, path, {}, std::move(held));
    file.held_ = whole;
    return file;
  }
  return create_temporary(files, placement.path);
}

Result<AtomicFile> AtomicFile::create_temporary(FileSystem& files, const std::string& path) {
  remove_abandoned(files, path);
  // The first free name: two processes that write the same target must not share a temporary file.
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    const std::string temporary = temporary_name(path, attempt);
    const UntilNoted until_noted;
    auto file = files.create(temporary);
    if (file) {
      note_temporary(temporary);
      return AtomicFile(files, path, temporary, *std::move(file));
    }
    if (file_name_of(temporary).size() > kLongestName_bytes) {
      return fail(
          ErrorCode::cannot_create,
          "the name is too long: until the file is whole, it has a temporary name beside it, "
          "which is longer",
          path, fmt::format("choose a name of at most {} bytes", kLongestTarget_bytes));
    }
    if (!files.info(temporary)) {
      return fail(std::move(file).error());
    }
  }
  return fail(ErrorCode::cannot_create, "100 temporary files of this name are in the way", path,
              "remove the .tmp files in its folder");
}

WritableFile& AtomicFile::file() {
  if (held_ != nullptr) {
    held_->hold();
  }
  return *file_;
}

Status AtomicFile::append(std::span<const std::uint8_t> bytes) {
  SIXPOINT_CHECK(file_->write_at(size_, bytes));
  size_ += bytes.size();
  return {};
}

Status AtomicFile::restrict_to_owner() {
  return temporary_.empty() ? Status{} : files_->restrict_to_owner(temporary_);
}

Status AtomicFile::append(std::string_view text) { return append(as_bytes(text)); }

Status AtomicFile::commit() {
  SIXPOINT_CHECK(file_->sync());
  if (temporary_.empty()) {
    SIXPOINT_CHECK(file_->close());
    file_.reset();
    return {};
  }
  // Closing it gives the lock back, so it has its name before: no other process takes it for one
  // that was left behind. It is on the medium already; closing adds nothing.
  SIXPOINT_CHECK(put_in_place(*files_, temporary_, path_));
  file_.reset();
  forget_temporary(temporary_);
  return {};
}

Status put_in_place(FileSystem& files, const std::string& temporary, const std::string& path) {
  SIXPOINT_ASSIGN(const Placement placement, files.placement(path));
  switch (placement.how) {
    case Placing::unruled:
    case Placing::replace:
      SIXPOINT_CHECK(files.rename(temporary, placement.path));
      break;
    case Placing::keep:
      SIXPOINT_CHECK(files.rename_new(temporary, placement.path));
      break;
    case Placing::through:
      return fail(ErrorCode::cannot_create, "this became a device or a pipe meanwhile", path,
                  "name a file");
  }
  return files.sync_folder(folder_of(placement.path));
}

Status refuse_existing(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(const Placement placement, files.placement(path));
  if (placement.how == Placing::unruled && files.info(path)) {
    return fail(ErrorCode::cannot_create, "the file exists already", path,
                "choose another name, or remove it");
  }
  return {};
}

namespace {

Status make_each_folder(FileSystem& files, const std::string& path, bool is_private) {
  if (files.info(path)) {
    return files.make_folders(path);  // says so where it is no folder
  }
  const std::string parent = folder_of(path);
  if (parent != path && parent != ".") {
    SIXPOINT_CHECK(make_each_folder(files, parent, is_private));
  }
  SIXPOINT_CHECK(files.make_folders(path));
  if (is_private) {
    SIXPOINT_CHECK(files.restrict_to_owner(path));
  }
  return files.sync_folder(parent);
}

}  // namespace

Status make_synced_folders(FileSystem& files, const std::string& path) {
  return make_each_folder(files, path, /*is_private=*/false);
}

Status make_private_folders(FileSystem& files, const std::string& path) {
  return make_each_folder(files, path, /*is_private=*/true);
}

Status write_file(FileSystem& files, const std::string& path, std::string_view text) {
  SIXPOINT_ASSIGN(auto out, AtomicFile::create(files, path));
  SIXPOINT_CHECK(out.append(text));
  return out.commit();
}

Status write_private_file(FileSystem& files, const std::string& path, std::string_view text) {
  SIXPOINT_ASSIGN(auto out, AtomicFile::create(files, path));
  SIXPOINT_CHECK(out.restrict_to_owner());
  SIXPOINT_CHECK(out.append(text));
  return out.commit();
}

}  // namespace sixpoint
