// The real clock and disk behind Env.
#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/env.h"
#include "base/rename_new.h"

namespace sixpoint {
namespace {

// One errno, three kinds of answer: what was asked for decides between "no such input" and "cannot
// create"; permission and a full disk are the same for both. There is "no such input" only where the
// name leads to nothing: a disk that fails, or no free descriptor, does not mean that a file is not
// there.
tl::unexpected<Error> system_failure(int error, ErrorCode otherwise, const std::string& doing,
                                     const std::string& path) {
  const std::string what = fmt::format("{}: {}", doing, std::strerror(error));
  switch (error) {
    case EACCES:
    case EPERM:
    case EROFS:
      return fail(ErrorCode::permission, what, path,
                  "check who owns the path and whether the disk is mounted read-only");
    case ENOSPC:
    case EDQUOT:
      return fail(ErrorCode::io, what, path, "free some space and run the command again");
    case EFBIG:
      return fail(ErrorCode::io, what, path,
                  "raise the limit of a file's size ('ulimit -f'), or choose a disk that takes "
                  "larger files, and run the command again");
    case ENOENT:
    case ENOTDIR:
    case ENAMETOOLONG:
      return fail(otherwise, what, path, "check the path");
    case EEXIST:
      return fail(otherwise, what, path, "choose another name");
    default:
      return fail(otherwise == ErrorCode::no_input ? ErrorCode::io : otherwise, what, path,
                  "check the path and the disk");
  }
}

// Of a system call that answers 0 where it succeeded.
Status done_unless(int result, ErrorCode otherwise, const std::string& doing,
                   const std::string& path) {
  return result == 0 ? Status() : Status(system_failure(errno, otherwise, doing, path));
}

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (fd_ >= 0) {
      ::close(fd_);
    }
  }
  int get() const { return fd_; }
  int close() {
    const int result = ::close(fd_);
    fd_ = -1;
    return result;
  }

 private:
  int fd_;
};

Result<std::size_t> pread_all(int fd, std::uint64_t offset, std::span<std::uint8_t> out,
                              const std::string& path) {
  std::size_t done = 0;
  while (done < out.size()) {
    const ssize_t count =
        ::pread(fd, out.data() + done, out.size() - done, static_cast<off_t>(offset + done));
    if (count < 0) {
      if (errno == EINTR) {
        continue;
      }
      return system_failure(errno, ErrorCode::io, "reading failed", path);
    }
    if (count == 0) {
      break;
    }
    done += static_cast<std::size_t>(count);
  }
  return done;
}

class PosixReadableFile final : public ReadableFile {
 public:
  PosixReadableFile(int fd, std::uint64_t size, std::string path)
      : fd_(fd), size_(size), path_(std::move(path)) {}
  std::uint64_t size() const override { return size_; }
  Result<std::size_t> read_at(std::uint64_t offset, std::span<std::uint8_t> out) const override {
    return pread_all(fd_.get(), offset, out, path_);
  }

 private:
  Descriptor fd_;
  std::uint64_t size_;
  std::string path_;
};

class PosixWritableFile final : public WritableFile {
 public:
  PosixWritableFile(int fd, std::string path) : fd_(fd), path_(std::move(path)) {}
  Status write_at(std::uint64_t offset, std::span<const std::uint8_t> bytes) override {
    std::size_t done = 0;
    while (done < bytes.size()) {
      const ssize_t count = ::pwrite(fd_.get(), bytes.data() + done, bytes.size() - done,
                                     static_cast<off_t>(offset + done));
      if (count < 0) {
        if (errno == EINTR) {
          continue;
        }
        return system_failure(errno, ErrorCode::io, "writing failed", path_);
      }
      done += static_cast<std::size_t>(count);
    }
    return {};
  }
  Result<std::size_t> read_at(std::uint64_t offset, std::span<std::uint8_t> out) override {
    return pread_all(fd_.get(), offset, out, path_);
  }
  Status sync() override {
    return done_unless(::fsync(fd_.get()), ErrorCode::io, "syncing failed", path_);
  }
  Status close() override {
    return done_unless(fd_.close(), ErrorCode::io, "closing failed", path_);
  }

 private:
  Descriptor fd_;
  std::string path_;
};

// A device or a pipe: it takes bytes in their order, and has nothing to sync.
class PosixThroughFile final : public WritableFile {
 public:
  PosixThroughFile(int fd, std::string path) : fd_(fd), path_(std::move(path)) {}
  Status write_at(std::uint64_t /*offset*/, std::span<const std::uint8_t> bytes) override {
    std::size_t done = 0;
    while (done < bytes.size()) {
      const ssize_t count = ::write(fd_.get(), bytes.data() + done, bytes.size() - done);
      if (count < 0 && errno != EINTR) {
        return system_failure(errno, ErrorCode::io, "writing failed", path_);
      }
      done += count < 0 ? 0 : static_cast<std::size_t>(count);
    }
    return {};
  }
  Result<std::size_t> read_at(std::uint64_t /*offset*/, std::span<std::uint8_t> /*out*/) override {
    return std::size_t{0};
  }
  Status sync() override { return {}; }
  Status close() override {
    return done_unless(fd_.close(), ErrorCode::io, "closing failed", path_);
  }

 private:
  Descriptor fd_;
  std::string path_;
};

// 0, or an errno: EWOULDBLOCK where another holds it.
int try_lock(int fd) {
  while (::flock(fd, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EINTR) {
      return errno;
    }
  }
  return 0;
}

bool is_named(int fd, const std::string& path) {
  struct stat opened {};
  struct stat named {};
  return ::fstat(fd, &opened) == 0 && ::stat(path.c_str(), &named) == 0 &&
         opened.st_ino == named.st_ino && opened.st_dev == named.st_dev;
}

class PosixLock final : public FileLock {
 public:
  explicit PosixLock(int fd) : fd_(fd) {}

 private:
  Descriptor fd_;  // closing it gives the lock back
};

class PosixFileSystem final : public FileSystem {
 public:
  Result<std::unique_ptr<ReadableFile>> open(const std::string& path) override {
    // O_NONBLOCK: opening a FIFO by mistake must not hang; it changes nothing for a regular file.
    const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0) {
      return system_failure(errno, ErrorCode::no_input, "cannot open", path);
    }
    struct stat status {};
    if (::fstat(fd, &status) != 0 || !S_ISREG(status.st_mode)) {
      ::close(fd);
      return fail(ErrorCode::no_input, "not a regular file", path, "name a file");
    }
    return std::make_unique<PosixReadableFile>(fd, static_cast<std::uint64_t>(status.st_size),
                                               path);
  }

  // Locked as by lock() until it is closed, so that other processes see that it is being written
  // (atomic_file.cpp). One that looks at just this moment may take it for abandoned and remove it:
  // then once more, and again while it holds the lock and has not removed the name yet.
  Result<std::unique_ptr<WritableFile>> create(const std::string& path) override {
    constexpr int kMostTries = 10;
    for (int tries = 1;; ++tries) {
      const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
      if (fd < 0 && errno == EEXIST && tries > 1 && tries < kMostTries) {
        std::this_thread::sleep_for(std::chrono::milliseconds(tries));
        continue;
      }
      if (fd < 0) {
        return system_failure(errno, ErrorCode::cannot_create, "cannot create", path);
      }
      auto file = std::make_unique<PosixWritableFile>(fd, path);
      const int error = try_lock(fd);
      const bool has_no_locks = error != 0 && error != EWOULDBLOCK;
      if (has_no_locks || (error == 0 && is_named(fd, path)) || tries == kMostTries) {
        return file;
      }
    }
  }

  Result<FileInfo> info(const std::string& path) override { return info_by(::stat, path); }
  Result<FileInfo> link_info(const std::string& path) override { return info_by(::lstat, path); }

  Result<std::string> real_path(const std::string& path) override {
    std::error_code error;
    const auto real = std::filesystem::canonical(path, error);
    if (error) {
      return system_failure(error.value(), ErrorCode::no_input, "cannot look at", path);
    }
    return real.string();
  }

  // flock() belongs to the open file: it also keeps two threads of one process apart, and Linux
  // takes it as a byte-range lock to the server of an NFS folder. A file that lost its name between
  // open() and flock() says nothing about the one that has the name now: then once more.
  Result<std::unique_ptr<FileLock>> lock(const std::string& path) override {
    constexpr int kMostTries = 100;
    for (int tries = 1; tries <= kMostTries; ++tries) {
      const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
      if (fd < 0) {
        return system_failure(errno, ErrorCode::cannot_create, "cannot make the lock", path);
      }
      std::unique_ptr<FileLock> held = std::make_unique<PosixLock>(fd);
      const int error = try_lock(fd);
      if (error == EWOULDBLOCK) {
        return nullptr;
      }
      if (error != 0) {
        return system_failure(error, ErrorCode::io, "cannot lock", path);
      }
      if (is_named(fd, path)) {
        return held;
      }
    }
    return nullptr;  // others are at it all the time
  }

  Result<std::vector<std::string>> list(const std::string& folder) override {
    std::error_code error;
    std::filesystem::directory_iterator entry(folder, error);
    std::vector<std::string> names;
    for (; !error && entry != std::filesystem::directory_iterator(); entry.increment(error)) {
      names.push_back(entry->path().filename().string());
    }
    if (error) {
      return system_failure(error.value(), ErrorCode::no_input, "cannot list", folder);
    }
    std::sort(names.begin(), names.end());
    return names;
  }

  Status make_folders(const std::string& path) override {
    std::error_code error;
    std::filesystem::create_directories(path, error);
    if (error) {
      return system_failure(error.value(), ErrorCode::cannot_create, "cannot make the folder",
                            path);
    }
    return {};
  }

  Status rename(const std::string& from, const std::string& to) override {
    return done_unless(::rename(from.c_str(), to.c_str()), ErrorCode::cannot_create,
                       "cannot put in place", to);
  }

  Status rename_new(const std::string& from, const std::string& to) override {
    const int error = sixpoint::rename_new(from, to);
    return error == 0
               ? Status()
               : Status(system_failure(error, ErrorCode::cannot_create, "cannot put in place", to));
  }

  Result<std::unique_ptr<WritableFile>> open_through(const std::string& path) override {
    // Without O_CREAT and O_TRUNC: a file that came to this name meanwhile stays as it is.
    const int fd = ::open(path.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY);
    if (fd < 0) {
      return system_failure(errno, ErrorCode::cannot_create, "cannot open", path);
    }
    std::unique_ptr<WritableFile> file = std::make_unique<PosixThroughFile>(fd, path);
    struct stat status {};
    if (::fstat(fd, &status) != 0 || !(S_ISCHR(status.st_mode) || S_ISFIFO(status.st_mode))) {
      return fail(ErrorCode::cannot_create, "this is no device and no pipe any more", path,
                  "run the command again");
    }
    return file;
  }

  Status remove(const std::string& path) override {
    return done_unless(std::remove(path.c_str()), ErrorCode::io, "cannot remove", path);
  }

  Status restrict_to_owner(const std::string& path) override {
    struct stat status {};
    int result = ::stat(path.c_str(), &status);
    if (result == 0) {
      result = ::chmod(path.c_str(), status.st_mode & S_IRWXU);
    }
    return done_unless(result, ErrorCode::permission, "cannot make private", path);
  }

  Status sync_folder(const std::string& path) override {
    const Descriptor folder(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    return done_unless(folder.get() < 0 ? -1 : ::fsync(folder.get()), ErrorCode::io,
                       "cannot sync the folder", path);
  }

 private:
  static FileKind kind_of(mode_t mode) {
    if (S_ISDIR(mode)) {
      return FileKind::folder;
    }
    if (S_ISCHR(mode)) {
      return FileKind::device;
    }
    if (S_ISFIFO(mode)) {
      return FileKind::pipe;
    }
    if (S_ISBLK(mode)) {
      return FileKind::disk;
    }
    return S_ISSOCK(mode) ? FileKind::socket : FileKind::file;
  }

  static Result<FileInfo> info_by(int (*call)(const char*, struct stat*), const std::string& path) {
    struct stat status {};
    if (call(path.c_str(), &status) != 0) {
      return system_failure(errno, ErrorCode::no_input, "cannot look at", path);
    }
    FileInfo info;
    info.is_folder = S_ISDIR(status.st_mode);
    info.kind = kind_of(status.st_mode);
    info.is_link = S_ISLNK(status.st_mode);
    info.size = static_cast<std::uint64_t>(status.st_size);
    info.modified_ns =
        std::int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + std::int64_t{status.st_mtim.tv_nsec};
    info.device = status.st_dev;
    info.inode = status.st_ino;
    return info;
  }
};

class PosixClock final : public Clock {
 public:
  UtcTime now() override {
    return std::chrono::time_point_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now());
  }
  std::chrono::nanoseconds elapsed() override {
    return std::chrono::steady_clock::now().time_since_epoch();
  }
  void sleep(std::chrono::nanoseconds duration) override { std::this_thread::sleep_for(duration); }
};

}  // namespace

Env& posix_env() {
  static PosixClock clock;
  static PosixFileSystem files;
  static Env env{clock, files};
  return env;
}

}  // namespace sixpoint
