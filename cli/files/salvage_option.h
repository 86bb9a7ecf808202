// --salvage: the option of the commands that read what is left of a damaged recording.
//
//   bool salvage = false;
//   add_salvage_option(command, salvage);
//   auto recording = gt3x::Recording::open(env.files, path, {salvage, {}});
#pragma once

#include <CLI/App.hpp>

namespace sixpoint::cli {

inline void add_salvage_option(CLI::App& command, bool& salvage) {
  command.add_flag("--salvage", salvage,
                   "read what is left of a damaged file, and say what is lost");
}

}  // namespace sixpoint::cli
