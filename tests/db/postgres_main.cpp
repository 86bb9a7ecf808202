// Exit 77, which ctest counts as skipped, where PostgreSQL is not installed; a failure where
// SIXPOINT_MUST_NOT_SKIP is set, as scripts/test.sh does after it installed everything.
#include <cstdlib>
#include <iostream>

#include <gtest/gtest.h>

#include "postgres_server.h"

// libpqxx 6.4 forgets one result of libpq, about 2 kB, whenever a server vanishes under a prepared
// statement; LeakSanitizer would blame the tests that kill the server.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:libpqxx-6"; }

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (const std::string missing = sixpoint::db::tests::PostgresServer::missing();
      !missing.empty()) {
    std::cerr << "SKIPPED, NOT PASSED: " << missing
              << "; run scripts/install_packages.sh build test\n";
    return std::getenv("SIXPOINT_MUST_NOT_SKIP") != nullptr ? 1 : 77;
  }
  return RUN_ALL_TESTS();
}
