// Exit 77, which ctest counts as skipped, where PostgreSQL is not installed; a failure where
// SIXPOINT_MUST_NOT_SKIP is set, as scripts/test.sh does after it installed everything.
#include <cstdlib>
#include <iostream>

#include <gtest/gtest.h>

#include "postgres_server.h"

// libpqxx 6.4 throws broken_connection before it has taken over the result in which libpq said so:
// 216 bytes and the message per server that vanishes, which are libpq's own (PQmakeEmptyPGresult).
// The store itself never holds such a result.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:PQmakeEmptyPGresult"; }

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
