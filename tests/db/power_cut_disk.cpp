#include "power_cut_disk.h"

#include <algorithm>
#include <cstring>
#include <new>

#include <sqlite3.h>

namespace sixpoint::db::tests {

namespace {

struct Change {
  bool is_truncation = false;
  std::uint64_t offset = 0;  // of the bytes, or the new size
  Bytes bytes;
};

void apply(const Change& change, Bytes& to, std::size_t from, std::size_t until) {
  if (change.is_truncation) {
    to.resize(change.offset);
    return;
  }
  if (to.size() < change.offset + until) {
    to.resize(change.offset + until);
  }
  std::copy(change.bytes.begin() + static_cast<std::ptrdiff_t>(from),
            change.bytes.begin() + static_cast<std::ptrdiff_t>(until),
            to.begin() + static_cast<std::ptrdiff_t>(change.offset + from));
}
void apply(const Change& change, Bytes& to) { apply(change, to, 0, change.bytes.size()); }

PowerCutDisk* disk = nullptr;

}  // namespace

struct PowerCutDisk::Node {
  Bytes durable;
  std::vector<Change> changes;
};

namespace {

// What SQLite allocates for a file of ours; the real one stands behind it.
struct File {
  sqlite3_file base;
  std::shared_ptr<PowerCutDisk::Node>* node;  // nullptr for files without a name
  sqlite3_file* real() { return reinterpret_cast<sqlite3_file*>(this + 1); }
};
File& ours(sqlite3_file* file) { return *reinterpret_cast<File*>(file); }
sqlite3_file* real(sqlite3_file* file) { return ours(file).real(); }

int (*real_open_directory)(const char*, int*) = nullptr;

}  // namespace

struct PowerCutDisk::Methods {
  static int close(sqlite3_file* file) {
    const int result = real(file)->pMethods->xClose(real(file));
    delete ours(file).node;
    ours(file).node = nullptr;
    return result;
  }
  static int read(sqlite3_file* file, void* to, int size, sqlite3_int64 offset) {
    return real(file)->pMethods->xRead(real(file), to, size, offset);
  }
  static int write(sqlite3_file* file, const void* from, int size, sqlite3_int64 offset) {
    const int result = real(file)->pMethods->xWrite(real(file), from, size, offset);
    if (result == SQLITE_OK && ours(file).node != nullptr) {
      const auto* begin = static_cast<const std::uint8_t*>(from);
      (*ours(file).node)
          ->changes.push_back(
              {false, static_cast<std::uint64_t>(offset), Bytes(begin, begin + size)});
    }
    return result;
  }
  static int truncate(sqlite3_file* file, sqlite3_int64 size) {
    const int result = real(file)->pMethods->xTruncate(real(file), size);
    if (result == SQLITE_OK && ours(file).node != nullptr) {
      (*ours(file).node)->changes.push_back({true, static_cast<std::uint64_t>(size), {}});
    }
    return result;
  }
  static int sync(sqlite3_file* file, int flags) {
    if (ours(file).node == nullptr) {
      return real(file)->pMethods->xSync(real(file), flags);
    }
    disk->sync_point();
    const int result = real(file)->pMethods->xSync(real(file), flags);
    Node& node = **ours(file).node;
    for (const Change& change : node.changes) {
      apply(change, node.durable);
    }
    node.changes.clear();
    disk->sync_point();
    return result;
  }
  static int file_size(sqlite3_file* file, sqlite3_int64* size) {
    return real(file)->pMethods->xFileSize(real(file), size);
  }
  static int lock(sqlite3_file* file, int level) {
    return real(file)->pMethods->xLock(real(file), level);
  }
  static int unlock(sqlite3_file* file, int level) {
    return real(file)->pMethods->xUnlock(real(file), level);
  }
  static int check_reserved_lock(sqlite3_file* file, int* answer) {
    return real(file)->pMethods->xCheckReservedLock(real(file), answer);
  }
  static int file_control(sqlite3_file* file, int operation, void* argument) {
    return real(file)->pMethods->xFileControl(real(file), operation, argument);
  }
  static int sector_size(sqlite3_file* file) {
    return real(file)->pMethods->xSectorSize(real(file));
  }
  static int characteristics(sqlite3_file* file) {
    return real(file)->pMethods->xDeviceCharacteristics(real(file));
  }
  static int shm_map(sqlite3_file* file, int page, int size, int extend, void volatile** memory) {
    return real(file)->pMethods->xShmMap(real(file), page, size, extend, memory);
  }
  static int shm_lock(sqlite3_file* file, int offset, int count, int flags) {
    return real(file)->pMethods->xShmLock(real(file), offset, count, flags);
  }
  static void shm_barrier(sqlite3_file* file) { real(file)->pMethods->xShmBarrier(real(file)); }
  static int shm_unmap(sqlite3_file* file, int remove) {
    return real(file)->pMethods->xShmUnmap(real(file), remove);
  }

  static int open(sqlite3_vfs* /*vfs*/, const char* name, sqlite3_file* file, int flags, int* out) {
    // Version 2: without memory-mapped reading and writing, which this disk could not see.
    static const sqlite3_io_methods kMethods = {2,
                                                &close,
                                                &read,
                                                &write,
                                                &truncate,
                                                &sync,
                                                &file_size,
                                                &lock,
                                                &unlock,
                                                &check_reserved_lock,
                                                &file_control,
                                                &sector_size,
                                                &characteristics,
                                                &shm_map,
                                                &shm_lock,
                                                &shm_barrier,
                                                &shm_unmap,
                                                nullptr,
                                                nullptr};
    file->pMethods = nullptr;
    ours(file).node = nullptr;
    const int result = disk->real_->xOpen(disk->real_, name, real(file), flags, out);
    if (result != SQLITE_OK) {
      return result;
    }
    file->pMethods = &kMethods;
    if (name != nullptr) {
      auto& node = disk->seen_[name];
      if (node == nullptr) {
        node = std::make_shared<Node>();
      }
      ours(file).node = new std::shared_ptr<Node>(node);
    }
    return result;
  }
  static int remove(sqlite3_vfs* /*vfs*/, const char* name, int sync_folder) {
    disk->sync_point();
    disk->seen_.erase(name);
    const int result = disk->real_->xDelete(disk->real_, name, sync_folder);
    disk->sync_point();
    return result;
  }
  static int open_directory(const char* name, int* handle) {
    if (disk != nullptr) {
      disk->sync_point();
      disk->names_are_durable();
      disk->sync_point();
    }
    return real_open_directory(name, handle);
  }
};

PowerCutDisk::PowerCutDisk() : real_(sqlite3_vfs_find(nullptr)), ours_(new sqlite3_vfs(*real_)) {
  disk = this;
  ours_->zName = "power-cut";
  ours_->pNext = nullptr;
  ours_->szOsFile = static_cast<int>(sizeof(File)) + real_->szOsFile;
  ours_->xOpen = &Methods::open;
  ours_->xDelete = &Methods::remove;
  sqlite3_vfs_register(ours_.get(), 1);
  real_open_directory =
      reinterpret_cast<int (*)(const char*, int*)>(real_->xGetSystemCall(real_, "openDirectory"));
  real_->xSetSystemCall(real_, "openDirectory",
                        reinterpret_cast<sqlite3_syscall_ptr>(&Methods::open_directory));
}

PowerCutDisk::~PowerCutDisk() {
  real_->xSetSystemCall(real_, "openDirectory", nullptr);
  sqlite3_vfs_register(real_, 1);
  sqlite3_vfs_unregister(ours_.get());
  disk = nullptr;
}

void PowerCutDisk::names_are_durable() { medium_ = seen_; }

void PowerCutDisk::sync_point() {
  if (!at_sync) {
    return;
  }
  ++sync_points_;
  // The hook opens stores of its own.
  disk = nullptr;
  sqlite3_vfs_register(real_, 1);
  at_sync();
  sqlite3_vfs_register(ours_.get(), 1);
  disk = this;
}

PowerCutDisk::Image PowerCutDisk::image(Unsynced unsynced, Random& random) const {
  Image image;
  for (const auto& [name, node] : unsynced == Unsynced::kept ? seen_ : medium_) {
    Bytes bytes = node->durable;
    for (const Change& change : node->changes) {
      const std::uint64_t chance = unsynced == Unsynced::kept ? 1 : random.below(3);
      if (unsynced == Unsynced::dropped || chance == 0) {
        continue;
      }
      if (chance == 1 || change.is_truncation) {
        apply(change, bytes);
      } else {
        const std::size_t sectors = change.bytes.size() / 512 + 1;
        const std::size_t cut = std::min(change.bytes.size(), 512 * random.below(sectors + 1));
        // The front of it, or the back of it.
        if (random.below(2) == 0) {
          apply(change, bytes, 0, cut);
        } else {
          apply(change, bytes, cut, change.bytes.size());
        }
      }
    }
    image[name.substr(name.rfind('/') + 1)] = std::move(bytes);
  }
  return image;
}

}  // namespace sixpoint::db::tests
