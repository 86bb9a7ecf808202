// --record session.zip, for every command that talks to a device (docs/sessions.md).
//
//   Outputs outputs(context, options.outputs, options.json);  // outlives the recorder
//   device::SessionRecorder recorder;
//   SIXPOINT_CHECK(begin_session(outputs, recorder, options.record));  // before anything is opened
//   const auto record = [&](device::Link& link) { recorder.attach(link); };
//   const auto unit = station::known_units().open(options.device, context.env, record);
//   finish_session(context, recorder, options.record);  // also after an error
//
// An empty path records nothing.
#pragma once

#include "cli/context.h"
#include "cli/output.h"
#include "device/session/session_recorder.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

void add_record_option(CLI::App& command, std::string& path);

// Errors of the path are reported here, before the work begins.
Status begin_session(Outputs& outputs, device::SessionRecorder& recorder, const std::string& path);
// Makes the session file. An error is reported and counts into the exit code.
void finish_session(Context& context, device::SessionRecorder& recorder, const std::string& path);

}  // namespace sixpoint::cli
