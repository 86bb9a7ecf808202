// Exit 77, which ctest counts as skipped, where PostgreSQL is not installed.
#include <iostream>

#include <gtest/gtest.h>

#include "postgres_server.h"

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (const std::string missing = sixpoint::db::tests::PostgresServer::missing();
      !missing.empty()) {
    std::cerr << "SKIPPED, NOT PASSED: " << missing
              << "; run scripts/install_packages.sh build test\n";
    return 77;
  }
  return RUN_ALL_TESTS();
}
