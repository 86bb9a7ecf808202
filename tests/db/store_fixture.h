// A store for the tests of db/, on SQLite or on PostgreSQL (place.h).
#pragma once

#include <atomic>
#include <cmath>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "db/store.h"
#include "expect_result.h"
#include "place.h"

namespace sixpoint::db {

inline ConstantsRecord constants(const std::string& serial, const std::string& filter,
                                 std::int64_t time_s, const std::string& document = "{}") {
  ConstantsRecord record;
  record.made_at = from_unix_seconds(time_s);
  record.serial = serial;
  record.filter = filter;
  record.method = "jig";
  record.document = document;
  return record;
}

inline RunRecord jig_run(const std::string& serial) {
  RunRecord run;
  run.serial = serial;
  run.kind = "jig";
  run.filter = "current";
  run.document = "{}";
  return run;
}

class StoreTest : public testing::Test {
 protected:
  Store open() {
    auto store = Store::open(memory_.env, location());
    if (!store) {
      throw std::runtime_error(store.error().brief());
    }
    return *std::move(store);
  }
  std::string location() const { return place_->location("main"); }

  std::unique_ptr<tests::Place> place_ = tests::make_place();
  MemoryEnv memory_;
};

}  // namespace sixpoint::db
