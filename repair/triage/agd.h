// What an .agd file (epochs, an SQLite database) says about the unit that recorded it.
//
//   SIXPOINT_ASSIGN(const FileFacts facts, read_agd_facts("epochs.agd"));
//   const Triage answer = triage(facts);  // triage.h
//
// Such a file can be triaged but not repaired: its epochs must be made anew from repaired raw data.
// It does not say when the unit was calibrated; the recording that it was made from does, where it
// lies beside it (scan_file.h).
#pragma once

#include <string>

#include "base/result.h"
#include "repair/triage/triage.h"

namespace sixpoint::repair {

// Read-only, without making a journal beside the file. no_input where there is no regular file, permission
// where this user may not read it, bad_data where it is no .agd or claims more work or memory than settings need.
Result<FileFacts> read_agd_facts(const std::string& path);

}  // namespace sixpoint::repair
