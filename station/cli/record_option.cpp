#include "station/cli/record_option.h"

namespace sixpoint::cli {

void add_record_option(CLI::App& command, std::string& path) {
  command.add_option("--record", path,
                     "write every transfer with the device into this session (docs/sessions.md)");
}

void save_session(Context& context, const device::SessionRecorder& recorder,
                  const std::string& path) {
  if (path.empty()) {
    return;
  }
  if (const Status saved = recorder.save(context.env.files, path); !saved) {
    context.log().error("{}", saved.error().brief());
    context.worsen(static_cast<int>(saved.error().code));
    return;
  }
  if (recorder.session().truncated) {
    context.log().warn("{}: the session is longer than what is kept; its end is missing",
                       printable(path));
  }
}

}  // namespace sixpoint::cli
