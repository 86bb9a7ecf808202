// --record session.zip, for every command that talks to a device.
#pragma once

#include "device/session_recorder.h"
#include "station/cli/command.h"

namespace sixpoint::cli {

void add_record_option(CLI::App& command, std::string& path);

// Saves where a path was given, whatever became of the command; an error counts into the exit code.
void save_session(Context& context, const device::SessionRecorder& recorder,
                  const std::string& path);

}  // namespace sixpoint::cli
