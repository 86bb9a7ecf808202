// The two marks of a repaired file: the entry of its archive, and the record in its log.
//
//   const auto mark = mark_in(files, "out.gt3x");
//   if (mark) {
//     const std::string input = text_in(*mark, "input_sha256");
//   }
//
// docs/repair.md has what they hold.
#pragma once

#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "repair/rescale/repair_file.h"

namespace sixpoint::repair {

// The same two marks of a file that --salvage wrote whole and whose samples stay as they were. They
// do not make it `already_repaired`.
inline constexpr const char* kSalvageMark = "sixpoint-salvage.json";
inline constexpr const char* kSalvageMarkType = "SixpointSalvage";
inline constexpr const char* kSalvageMethod = "salvage";
// The name of the entry that belongs to this report.
std::string mark_name(const RepairReport& report);

// {before, after}, and three numbers; null for what is not known.
nlohmann::ordered_json still_error_to_json(const RepairReport& report);
nlohmann::ordered_json sample_uncertainty_to_json(const RepairReport& report);

// The entry. `recipe`: recipe_digest() in earlier_output.h.
nlohmann::ordered_json mark_of(const RepairReport& report,
                               const std::optional<ChosenConstants>& chosen, const Survey& survey,
                               const std::string& recipe, UtcTime now);
// The record: who it was, and by what. Without the time, so that the same repair
// gives the same log.
std::string mark_record_of(const RepairReport& report);

// The entry of a repaired file; nothing where there is no such file or mark.
std::optional<nlohmann::ordered_json> mark_in(FileSystem& files, const std::string& path);
// Members of it; empty or nothing where they are missing or of another type.
std::string text_in(const nlohmann::ordered_json& mark, const char* key);
std::optional<PerAxis<double>> three_in(const nlohmann::ordered_json& mark, const char* key);

}  // namespace sixpoint::repair
