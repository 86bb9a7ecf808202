// Jig runs that are recorded and replayed, through the program.
#pragma once

#include <string>
#include <vector>

#include "cli/command_fixture.h"

namespace sixpoint::cli {

class SessionCommand : public tests::CommandTest {
 protected:
  tests::Answer jig(const std::string& device, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"jig",     "--device",   device,
                                          "--store", path("s.db"), "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
};

}  // namespace sixpoint::cli
