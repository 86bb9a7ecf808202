// Two stores on one server or folder, and the files that go between them.
#pragma once

#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "db/exchange.h"
#include "db/store.h"
#include "expect_result.h"
#include "place.h"
#include "temporary_folder.h"

namespace sixpoint::db {

class ExchangeTest : public testing::Test {
 protected:
  Store open(const std::string& name) {
    auto store = Store::open(memory_.env, place_->location(name));
    if (!store) {
      throw std::runtime_error(store.error().brief());
    }
    return *std::move(store);
  }

  // A little of everything: NULLs, empty texts, an attachment, a withdrawal.
  static void fill(Store& store, int constants = 3) {
    RunRecord run;
    run.serial = "MOS2A1";
    run.kind = "jig";
    run.filter = "current";
    run.operator_name = "Zoë \"Z\", O'Hara\n";
    run.document = R"({"a":[1,2.5,"x"]})";
    run.temperature_c = 21.5;
    ASSERT_OK(store.add_run(run, {{"raw", Bytes{0, 1, 255}}, {"empty", Bytes{}}}));
    std::string last;
    for (int i = 0; i < constants; ++i) {
      ConstantsRecord record;
      record.serial = "MOS2A1";
      record.filter = i % 2 == 0 ? "current" : "legacy";
      record.made_at = from_unix_seconds(i);
      record.document = R"({"made_from":{"n":1}})";
      const auto id = store.add_constants(record, "w");
      ASSERT_OK(id);
      last = *id;
    }
    ASSERT_OK(store.withdraw_constants(last, "Ada", "wrong jig"));
  }

  std::vector<std::string> lines(const std::string& path) {
    const auto bytes = read_file(memory_.files, path);
    std::istringstream text(std::string(bytes->begin(), bytes->end()));
    std::vector<std::string> all;
    for (std::string line; std::getline(text, line);) {
      all.push_back(line);
    }
    return all;
  }
  void write(const std::string& path, const std::vector<std::string>& all) {
    std::string text;
    for (const std::string& line : all) {
      text += line + "\n";
    }
    ASSERT_OK(write_file_again(path, text));
  }
  Status write_file_again(const std::string& path, const std::string& text) {
    if (memory_.files.info(path)) {
      SIXPOINT_CHECK(memory_.files.remove(path));
    }
    SIXPOINT_ASSIGN(auto file, memory_.files.create(path));
    return file->write_at(0, as_bytes(text));
  }

  std::unique_ptr<tests::Place> place_ = tests::make_place();
  MemoryEnv memory_;
  sixpoint::tests::TemporaryFolder folder_;
};

}  // namespace sixpoint::db
