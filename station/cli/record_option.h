// --record session.zip, for every command that talks to a device.
#pragma once

#include "device/session_recorder.h"
#include "station/cli/command.h"

namespace sixpoint::cli {

void add_record_option(CLI::App& command, std::string& path);

// Begins to record where a path was given; before anything is opened, so that a path that cannot be
// is known before the work.
Status begin_session(Context& context, device::SessionRecorder& recorder, const std::string& path);
// Makes the session, whatever became of the command; an error counts into the exit code.
void finish_session(Context& context, device::SessionRecorder& recorder, const std::string& path);

}  // namespace sixpoint::cli
