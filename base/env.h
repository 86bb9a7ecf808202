// Env: the only way in which a library reaches the clock and the disk.
//
//   SIXPOINT_ASSIGN(const Bytes bytes, read_file(env.files, "unit.gt3x"));
//   SIXPOINT_ASSIGN(const FileInfo info, env.files.info("unit.gt3x"));
//   env.clock.sleep(std::chrono::milliseconds(100));
//
// A library that needs time or files takes an Env (or just its Clock or FileSystem). The program
// passes posix_env(); tests pass a MemoryEnv (memory_env.h), whose clock moves on command and
// whose disk forgets on command what was not synced.
//
// Paths are strings as the operating system takes them. All functions are safe to call from several
// threads; one file object belongs to one thread at a time.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/bytes.h"
#include "base/result.h"
#include "base/time.h"

namespace sixpoint {

class Clock {
 public:
  virtual ~Clock() = default;
  virtual UtcTime now() = 0;                       // calendar time; may be set back by the system
  virtual std::chrono::nanoseconds elapsed() = 0;  // since an arbitrary start; never goes back
  virtual void sleep(std::chrono::nanoseconds duration) = 0;
};

class ReadableFile {
 public:
  virtual ~ReadableFile() = default;
  virtual std::uint64_t size() const = 0;
  // Reads up to out.size() bytes at `offset`; returns how many there were (0 at the end).
  virtual Result<std::size_t> read_at(std::uint64_t offset, std::span<std::uint8_t> out) const = 0;
};

class WritableFile {
 public:
  virtual ~WritableFile() = default;  // closes; what was not synced may be lost
  virtual Status write_at(std::uint64_t offset, std::span<const std::uint8_t> bytes) = 0;
  virtual Result<std::size_t> read_at(std::uint64_t offset, std::span<std::uint8_t> out) = 0;
  virtual Status sync() = 0;   // the bytes are on the medium when this returns
  virtual Status close() = 0;  // reports what the destructor could not
};

enum class FileKind : std::uint8_t {
  file,
  folder,
  device,  // of characters: a terminal, /dev/null
  pipe,
  disk,  // a device of blocks
  socket,
};

struct FileInfo {
  bool is_folder = false;
  FileKind kind = FileKind::file;
  std::uint64_t size = 0;
  bool is_link = false;          // only from link_info()
  std::int64_t modified_ns = 0;  // nanoseconds since 1970 UTC
  // Which file it is, whatever its name: device and inode. Zeros where a file system has no such.
  std::uint64_t device = 0;
  std::uint64_t inode = 0;
};

// Held until it is destroyed or the process ends, however it ends.
class FileLock {
 public:
  virtual ~FileLock() = default;
};

// How a file that was written comes to its name (base/atomic_file.h).
enum class Placing : std::uint8_t {
  unruled,  // the file system has no rule: its writer's own holds
  replace,  // takes the name from what is there
  keep,     // cannot_create where something is there
  through,  // no name of its own: the bytes go into the device or the pipe that is there
};
struct Placement {
  Placing how = Placing::unruled;
  std::string path;  // the name that the file gets: another one where a symbolic link is followed
};

class FileSystem {
 public:
  virtual ~FileSystem() = default;
  virtual Result<std::unique_ptr<ReadableFile>> open(const std::string& path) = 0;
  // Makes a new file; cannot_create where one of that name exists.
  virtual Result<std::unique_ptr<WritableFile>> create(const std::string& path) = 0;
  virtual Result<FileInfo> info(const std::string& path) = 0;  // no_input where there is none
  virtual Result<std::vector<std::string>> list(const std::string& folder) = 0;  // names, sorted
  virtual Status make_folders(const std::string& path) = 0;                      // like mkdir -p
  virtual Status rename(const std::string& from, const std::string& to) = 0;     // replaces `to`
  // cannot_create where `to` exists, which stays as it is. The default looks and then renames.
  virtual Status rename_new(const std::string& from, const std::string& to);
  virtual Status remove(const std::string& path) = 0;
  virtual Status sync_folder(const std::string& path) = 0;  // makes renames in it durable
  // How AtomicFile puts a file at `path`. A program that writes where its user said so has rules of
  // its own (cli/output.h); an error says why nothing may be written there.
  virtual Result<Placement> placement(const std::string& path) {
    return Placement{Placing::unruled, path};
  }
  // A device or a pipe that is there, for bytes one after another: offsets mean nothing, and what
  // was written cannot be read. Waits for the reader of a pipe.
  virtual Result<std::unique_ptr<WritableFile>> open_through(const std::string& path);
  // Takes every right from everybody but the owner: a file is then 0600, a folder 0700. Nothing
  // where the file system has no rights.
  virtual Status restrict_to_owner(const std::string& /*path*/) { return {}; }
  // As info(), of a symbolic link itself where `path` is one.
  virtual Result<FileInfo> link_info(const std::string& path) { return info(path); }
  // The path without symbolic links, "." and "..", from the root; no_input where there is none.
  virtual Result<std::string> real_path(const std::string& path) { return path; }
  // Locks the file `path`, which is made where it is not there, against every other lock() in any
  // process, on a network file system also on other machines. Null where another holds it; an error
  // where the file cannot be made or its file system has no locks.
  virtual Result<std::unique_ptr<FileLock>> lock(const std::string& path);
};

struct Env {
  Clock& clock;
  FileSystem& files;
  // Seed for everything random that was given no seed. Fixed unless the program changes it, so
  // that two runs are alike.
  std::uint64_t seed = 20140324;
};

// The real machine. One per process; threads share it.
Env& posix_env();

// The whole of a file that is expected to be small (headers, JSON, constants). bad_data above
// `limit`.
Result<Bytes> read_file(FileSystem& files, const std::string& path,
                        std::uint64_t limit = 64ULL << 20);

// The folder part of a path ("." where there is none), and the last part.
std::string folder_of(const std::string& path);
std::string file_name_of(const std::string& path);

}  // namespace sixpoint
