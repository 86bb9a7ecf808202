#include "cli/command.h"

#include <cstdlib>

#include <fmt/format.h>

namespace sixpoint::cli {

CLI::App& add_group(CLI::App& parent, const char* name, const char* about) {
  return *parent.add_subcommand(name, about)->require_subcommand(1);
}

CLI::Validator greater_than_zero() {
  return {[](const std::string& value) {
            return std::strtod(value.c_str(), nullptr) > 0
                       ? std::string()
                       : fmt::format("{} is not greater than 0", value);
          },
          "POSITIVE"};
}

}  // namespace sixpoint::cli
