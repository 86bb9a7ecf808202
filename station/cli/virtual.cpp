// sixpoint virtual: virtual units for the real USB of this or another machine.
#include <memory>

#include "station/cli/command.h"

namespace sixpoint::cli {

void add_virtual(CLI::App& app, Context& context) {
  CLI::App* command = app.add_subcommand(
      "virtual", "offer virtual units over USB/IP (not built yet; --device virtual:... works)");
  command->allow_extras();
  command->callback([&context] {
    report_error(context, "virtual",
                 {ErrorCode::usage,
                  "'virtual' is not built yet",
                  {},
                  "use a virtual unit inside a command: --device virtual:seed=7,jig=auto"},
                 false);
  });
}

}  // namespace sixpoint::cli
