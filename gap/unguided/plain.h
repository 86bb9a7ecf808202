// Diagnosis of a plain recording, without a protocol: still periods, temperatures and the header.
//
//   SIXPOINT_ASSIGN(const Diagnosis diagnosis, diagnose_plain(env.files, "unit.gt3x"));
//   std::cout << diagnosis.brief() << '\n';
//
// The length of the measured vector at rest must be 1 g. That settles whether the constants belong
// to the acquisition mode in force (16CPAN03), and, where the file holds temperatures (.agdc), how
// the zero follows them. Everything else needs a protocol and is listed as not observable.
#pragma once

#include <string>

#include "base/env.h"
#include "gap/judge/diagnose.h"
#include "gap/judge/diagnosis.h"

namespace sixpoint::gap {

// no_input, bad_data as of gt3x::Recording; bad_data for the old form without a log.
Result<Diagnosis> diagnose_plain(FileSystem& files, const std::string& path,
                                 const DiagnoseOptions& options = {});

}  // namespace sixpoint::gap
