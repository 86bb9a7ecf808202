#include "base/memory_env.h"

#include <algorithm>

namespace sixpoint {

UtcTime ManualClock::now() {
  const std::lock_guard lock(mutex_);
  return now_;
}

std::chrono::nanoseconds ManualClock::elapsed() {
  const std::lock_guard lock(mutex_);
  return elapsed_;
}

void ManualClock::sleep(std::chrono::nanoseconds duration) {
  const std::lock_guard lock(mutex_);
  now_ += duration;
  elapsed_ += duration;
}

void ManualClock::set(UtcTime time) {
  const std::lock_guard lock(mutex_);
  now_ = time;
}

struct MemoryFiles::Node {
  std::mutex mutex;
  Bytes seen;
  Bytes synced;
  std::int64_t modified = 0;
};

namespace {

std::size_t copy_out(const Bytes& bytes, std::uint64_t offset, std::span<std::uint8_t> out) {
  if (offset >= bytes.size()) {
    return 0;
  }
  const std::size_t count = std::min<std::size_t>(out.size(), bytes.size() - offset);
  std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(offset), count, out.begin());
  return count;
}

class MemoryReadableFile final : public ReadableFile {
 public:
  explicit MemoryReadableFile(std::shared_ptr<MemoryFiles::Node> node) : node_(std::move(node)) {}
  std::uint64_t size() const override {
    const std::lock_guard lock(node_->mutex);
    return node_->seen.size();
  }
  Result<std::size_t> read_at(std::uint64_t offset, std::span<std::uint8_t> out) const override {
    const std::lock_guard lock(node_->mutex);
    return copy_out(node_->seen, offset, out);
  }

 private:
  std::shared_ptr<MemoryFiles::Node> node_;
};

}  // namespace

class MemoryWritableFile final : public WritableFile {
 public:
  MemoryWritableFile(MemoryFiles& disk, std::string path, std::shared_ptr<MemoryFiles::Node> node)
      : disk_(disk), path_(std::move(path)), node_(std::move(node)) {}
  Status write_at(std::uint64_t offset, std::span<const std::uint8_t> bytes) override {
    SIXPOINT_CHECK(disk_.may_change(path_));
    const std::int64_t modified = disk_.next_change();
    const std::lock_guard lock(node_->mutex);
    node_->modified = modified;
    node_->seen.resize(std::max<std::size_t>(node_->seen.size(), offset + bytes.size()));
    std::copy(bytes.begin(), bytes.end(),
              node_->seen.begin() + static_cast<std::ptrdiff_t>(offset));
    return {};
  }
  Result<std::size_t> read_at(std::uint64_t offset, std::span<std::uint8_t> out) override {
    const std::lock_guard lock(node_->mutex);
    return copy_out(node_->seen, offset, out);
  }
  Status sync() override {
    SIXPOINT_CHECK(disk_.may_change(path_));
    const std::lock_guard lock(node_->mutex);
    node_->synced = node_->seen;
    return {};
  }
  Status close() override { return {}; }

 private:
  MemoryFiles& disk_;
  std::string path_;
  std::shared_ptr<MemoryFiles::Node> node_;
};

std::int64_t MemoryFiles::next_change() {
  const std::lock_guard lock(mutex_);
  return ++changes_;
}

Status MemoryFiles::may_change(const std::string& path) {
  const std::lock_guard lock(mutex_);
  if (const std::size_t operation = operations_++; fail_from_ && operation >= *fail_from_) {
    return fail(ErrorCode::io, "the disk fails, as this test asked", path, "stop failing");
  }
  return {};
}

Result<std::unique_ptr<ReadableFile>> MemoryFiles::open(const std::string& path) {
  const std::lock_guard lock(mutex_);
  const auto found = seen_.find(path);
  if (found == seen_.end()) {
    return fail(ErrorCode::no_input, "no such file", path, "check the path");
  }
  return std::make_unique<MemoryReadableFile>(found->second);
}

Result<std::unique_ptr<WritableFile>> MemoryFiles::create(const std::string& path) {
  SIXPOINT_CHECK(may_change(path));
  const std::lock_guard lock(mutex_);
  if (seen_.contains(path)) {
    return fail(ErrorCode::cannot_create, "the file exists", path, "choose another name");
  }
  auto node = std::make_shared<Node>();
  seen_[path] = node;
  return std::make_unique<MemoryWritableFile>(*this, path, node);
}

Result<FileInfo> MemoryFiles::info(const std::string& path) {
  const std::lock_guard lock(mutex_);
  if (folders_.contains(path)) {
    FileInfo info;
    info.is_folder = true;
    info.kind = FileKind::folder;
    return info;
  }
  const auto found = seen_.find(path);
  if (found == seen_.end()) {
    return fail(ErrorCode::no_input, "no such file", path, "check the path");
  }
  const std::lock_guard node_lock(found->second->mutex);
  FileInfo info;
  info.size = found->second->seen.size();
  info.modified_ns = found->second->modified;
  return info;
}

Result<std::vector<std::string>> MemoryFiles::list(const std::string& folder) {
  const std::lock_guard lock(mutex_);
  std::set<std::string> names;
  const std::string prefix = folder == "." ? "" : folder + "/";
  const auto add = [&](const std::string& path) {
    if (path.starts_with(prefix) && path.size() > prefix.size()) {
      names.insert(path.substr(prefix.size(), path.find('/', prefix.size()) - prefix.size()));
    }
  };
  for (const auto& [path, node] : seen_) {
    add(path);
  }
  for (const auto& path : folders_) {
    add(path);
  }
  return std::vector<std::string>(names.begin(), names.end());
}

Status MemoryFiles::make_folders(const std::string& path) {
  SIXPOINT_CHECK(may_change(path));
  const std::lock_guard lock(mutex_);
  for (auto end = path.find('/', 1);; end = path.find('/', end + 1)) {
    folders_.insert(path.substr(0, end));
    if (end == std::string::npos) {
      return {};
    }
  }
}

Status MemoryFiles::rename(const std::string& from, const std::string& to) {
  return rename_unless(from, to, /*keep=*/false);
}

Status MemoryFiles::rename_new(const std::string& from, const std::string& to) {
  return rename_unless(from, to, /*keep=*/true);
}

Status MemoryFiles::rename_unless(const std::string& from, const std::string& to, bool keep) {
  SIXPOINT_CHECK(may_change(to));
  const std::lock_guard lock(mutex_);
  if (keep && (seen_.contains(to) || folders_.contains(to))) {
    return fail(ErrorCode::cannot_create, "the file exists", to, "choose another name");
  }
  const auto found = seen_.find(from);
  if (found == seen_.end()) {
    return fail(ErrorCode::cannot_create, "no such file to rename", from, "check the path");
  }
  seen_[to] = found->second;
  seen_.erase(from);
  return {};
}

Status MemoryFiles::remove(const std::string& path) {
  SIXPOINT_CHECK(may_change(path));
  const std::lock_guard lock(mutex_);
  const bool holds_files = std::ranges::any_of(
      seen_, [&](const auto& item) { return item.first.starts_with(path + "/"); });
  if (seen_.erase(path) == 0 && (holds_files || folders_.erase(path) == 0)) {
    return fail(ErrorCode::io, "no such file to remove", path, "check the path");
  }
  return {};
}

Status MemoryFiles::sync_folder(const std::string& path) {
  SIXPOINT_CHECK(may_change(path));
  const std::lock_guard lock(mutex_);
  std::erase_if(medium_, [&](const auto& item) { return folder_of(item.first) == path; });
  for (const auto& item : seen_) {
    if (folder_of(item.first) == path) {
      medium_.insert(item);
    }
  }
  return {};
}

struct MemoryFiles::LockedPaths {
  std::mutex mutex;
  std::set<std::string> paths;
};

MemoryFiles::MemoryFiles() : locked_(std::make_shared<LockedPaths>()) {}

namespace {

class MemoryLock final : public FileLock {
 public:
  MemoryLock(std::shared_ptr<MemoryFiles::LockedPaths> locked, std::string path)
      : locked_(std::move(locked)), path_(std::move(path)) {}
  MemoryLock(const MemoryLock&) = delete;
  MemoryLock& operator=(const MemoryLock&) = delete;
  ~MemoryLock() override {
    const std::lock_guard lock(locked_->mutex);
    locked_->paths.erase(path_);
  }

 private:
  std::shared_ptr<MemoryFiles::LockedPaths> locked_;
  std::string path_;
};

}  // namespace

Result<std::unique_ptr<FileLock>> MemoryFiles::lock(const std::string& path) {
  SIXPOINT_CHECK(may_change(path));
  {
    const std::lock_guard lock(mutex_);
    seen_.try_emplace(path, std::make_shared<Node>());
  }
  const std::lock_guard lock(locked_->mutex);
  if (!locked_->paths.insert(path).second) {
    return nullptr;
  }
  return std::make_unique<MemoryLock>(locked_, path);
}

void MemoryFiles::lose_power() {
  const std::lock_guard lock(mutex_);
  std::map<std::string, std::shared_ptr<Node>> survivors;
  for (const auto& [path, node] : medium_) {
    const std::lock_guard node_lock(node->mutex);
    auto survivor = std::make_shared<Node>();
    survivor->seen = node->synced;
    survivor->synced = node->synced;
    survivor->modified = node->modified;
    survivors[path] = std::move(survivor);
  }
  seen_ = survivors;
  medium_ = std::move(survivors);
}

void MemoryFiles::fail_after(std::size_t operations) {
  const std::lock_guard lock(mutex_);
  fail_from_ = operations_ + operations;
}

void MemoryFiles::stop_failing() {
  const std::lock_guard lock(mutex_);
  fail_from_.reset();
}

std::size_t MemoryFiles::changing_operations() const {
  const std::lock_guard lock(mutex_);
  return operations_;
}

}  // namespace sixpoint
