// The commands of the station, on the real disk with virtual units.
#pragma once

#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "run_command.h"
#include "temporary_folder.h"

namespace sixpoint::station {

class StationCommands : public testing::Test {
 protected:
  // The station's memory is in the user's data folder.
  StationCommands() { ::setenv("XDG_DATA_HOME", (folder_ / "data").c_str(), 1); }
  ~StationCommands() override { ::unsetenv("XDG_DATA_HOME"); }
  tests::Answer run(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--store", folder_ / "s.db"});
    return tests::run_command(posix_env(), arguments);
  }
  tests::Answer measure(const std::string& unit, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {
        "jig",       "--device", "virtual:" + unit, "--jig", "virtual",
        "--station", "A",        "--operator",      "Ada",   "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  void write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
  }
  tests::TemporaryFolder folder_;
};

}  // namespace sixpoint::station
