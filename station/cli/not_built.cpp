// Commands of the contract that this version does not have. They say so, with exit code 64, and
// what to use meanwhile; they never pretend.
#include <fmt/format.h>

#include "station/cli/command.h"

namespace sixpoint::cli {
namespace {

void add_not_built(CLI::App& app, Context& context, const std::string& name,
                   const std::string& purpose, const std::string& meanwhile) {
  CLI::App* command = app.add_subcommand(name, purpose + " (not built yet)");
  command->allow_extras();
  command->callback([&context, name, meanwhile] {
    report_error(context, name,
                 {ErrorCode::usage, fmt::format("'{}' is not built yet", name), {}, meanwhile},
                 false);
  });
}

}  // namespace

void add_archive(CLI::App& app, Context& context) {
  add_not_built(app, context, "archive", "Mend an archive on a cluster",
                "use 'sixpoint repair --jobs N', one folder at a time");
}

}  // namespace sixpoint::cli
