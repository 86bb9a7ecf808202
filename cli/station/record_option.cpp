#include "cli/station/record_option.h"

#include "cli/command.h"

namespace sixpoint::cli {

void add_record_option(CLI::App& command, std::string& path) {
  command.add_option("--record", path,
                     "write every transfer with the device into this session (docs/sessions.md)");
}

Status begin_session(Outputs& outputs, device::SessionRecorder& recorder, const std::string& path) {
  SIXPOINT_CHECK(outputs.file_to_keep("--record", path));
  return path.empty() ? Status{} : recorder.begin(outputs.files(), path);
}

void finish_session(Context& context, device::SessionRecorder& recorder, const std::string& path) {
  if (const Status made = recorder.finish(); !made) {
    report_error(context, made.error());
    return;
  }
  if (recorder.truncated()) {
    context.log().warn("{}: the session is longer than the most that is kept; its end is missing",
                       printable(path));
  }
}

}  // namespace sixpoint::cli
