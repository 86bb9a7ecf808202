// Debian's PostgreSQL, started by the tests themselves in a temporary folder on loopback, as an
// unprivileged user, with fsync on. It dies with the test program.
#pragma once

#include <string>

#include <sys/types.h>

#include "temporary_folder.h"

namespace sixpoint::db::tests {

class PostgresServer {
 public:
  // Empty, or why there can be no server here and which package is missing.
  static std::string missing();

  PostgresServer();  // makes the cluster and starts it; throws with the server's own words
  PostgresServer(const PostgresServer&) = delete;
  PostgresServer& operator=(const PostgresServer&) = delete;
  ~PostgresServer();

  void start();
  void kill();                // SIGKILL to the server and all its processes, as a power cut would
  void fill_disk(bool full);  // no table grows any more, or all do again
  std::string make_database(const std::string& name);  // empty; its location
  // As the user `station`, with a password, over TCP on 127.0.0.1.
  std::string location(const std::string& database, const std::string& password = kPassword) const;
  // As the superuser, over a socket in the temporary folder.
  std::string superuser(const std::string& database) const;
  static constexpr const char* kPassword = "s3cret/p@ss";

 private:
  int run(const std::string& program, const std::string& arguments) const;
  sixpoint::tests::TemporaryFolder folder_;
  int port_ = 0;
  pid_t pid_ = -1;
};

PostgresServer& server();  // the one of this test program

}  // namespace sixpoint::db::tests
