// A disk under SQLite that can be looked at as a power cut would leave it.
//
// A virtual file system of SQLite that passes everything to the real one and writes down what is on
// the medium and what is not yet: bytes reach it by xSync, names and deletions by a sync of their
// folder (which SQLite makes through openDirectory). At every sync, before and after it takes
// effect, the test's hook may ask for an image of the disk.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "base/env.h"
#include "base/random.h"

struct sqlite3_vfs;

namespace sixpoint::db::tests {

class PowerCutDisk {
 public:
  // What of the bytes that are not on the medium is there after all.
  enum class Unsynced {
    dropped,
    kept,       // all: the process was killed, the machine was not
    scattered,  // each write at random: gone, there, or torn at a sector of 512 bytes
  };
  using Image = std::map<std::string, Bytes>;  // file name (without the folder) -> bytes

  // While it lives, it is SQLite's default file system. One at a time.
  PowerCutDisk();
  PowerCutDisk(const PowerCutDisk&) = delete;
  PowerCutDisk& operator=(const PowerCutDisk&) = delete;
  ~PowerCutDisk();

  // Called at every sync point. Inside of it, SQLite's default file system is the real one.
  std::function<void()> at_sync;
  Image image(Unsynced unsynced, Random& random) const;
  std::size_t sync_points() const { return sync_points_; }

  struct Node;
  struct Methods;

 private:
  friend struct Methods;
  void sync_point();
  void names_are_durable();

  std::map<std::string, std::shared_ptr<Node>> seen_;
  std::map<std::string, std::shared_ptr<Node>> medium_;
  std::size_t sync_points_ = 0;
  sqlite3_vfs* real_ = nullptr;
  std::unique_ptr<sqlite3_vfs> ours_;
};

}  // namespace sixpoint::db::tests
