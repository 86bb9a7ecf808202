// The ten lines before the column names in the CSV files of the vendor's software (private to this
// room).
//
//   Info info;
//   const std::string text = csv_header(info, "Created By ... at 30 Hz ", 1'400'000'000);
//
// Times are by the recording's own clock. Lines end in CR LF.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "gt3x/forms/info.h"

namespace sixpoint::gt3x {

// `made_by` follows "Data File " in the first line; `start`: Unix time of the first sample.
std::string csv_header(const Info& info, std::string_view made_by, std::uint32_t start);

}  // namespace sixpoint::gt3x
