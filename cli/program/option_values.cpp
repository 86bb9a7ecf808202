#include "cli/program/option_values.h"

#include <cerrno>
#include <cmath>
#include <cstdlib>

#include <fmt/format.h>

namespace sixpoint::cli {

namespace {

// The same reading as CLI11's, which looks at no errno.
bool is_too_large(std::string_view type, const std::string& value) {
  errno = 0;
  if (type == "UINT") {
    static_cast<void>(std::strtoull(value.c_str(), nullptr, 0));
  } else {
    static_cast<void>(std::strtoll(value.c_str(), nullptr, 0));
  }
  return errno == ERANGE;
}

}  // namespace

std::string why_no_value(std::string_view type, const std::string& value) {
  if (value.empty()) {
    return "has no value: name one, or leave it out";
  }
  if (type == "FLOAT") {
    return std::isfinite(std::strtod(value.c_str(), nullptr))
               ? std::string()
               : fmt::format("{} is no finite number", value);
  }
  const bool is_unsigned = type == "UINT";
  if (is_unsigned && value.find('-') != std::string::npos) {
    return fmt::format("{} is below 0", value);
  }
  if ((is_unsigned || type == "INT") && is_too_large(type, value)) {
    return fmt::format("{} is too large a number", value);
  }
  return {};
}

void refuse_unusable_values(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    if (option->get_expected_min() == 0) {
      continue;  // a flag, or an option that needs no value
    }
    // Alone, before the checks' own descriptions are added to it.
    const std::string type_and_checks = option->get_type_name();
    const std::string type = type_and_checks.substr(0, type_and_checks.find(':'));
    option->transform(CLI::Validator(
        [type](const std::string& value) { return why_no_value(type, value); }, std::string()));
  }
  for (CLI::App* command : app.get_subcommands({})) {
    refuse_unusable_values(*command);
  }
}

}  // namespace sixpoint::cli
