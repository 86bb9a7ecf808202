// Files that need no repair get a name in the output folder too, so that it holds the whole study.
//
//   const LinkMaker make = [](const auto& from, const auto& to, LinkKind kind) {
//     return link_file(from, to, kind);   // repair/archive/link_file.h
//   };
//   link_unaffected(files, make, LinkKind::hard, "/repaired/a.gt3x", report);
//   report.linked;  // "/repaired/a.gt3x"
//
// Which files (is_linked):
//
// | report                                                   | linked |
// |----------------------------------------------------------|--------|
// | not_affected, and nothing was written for it (--salvage) | yes    |
// | already_repaired                                         | yes    |
// | anything else: repaired, not repairable, outdated, failed| no     |
//
// A file that is affected and could not be repaired is not in the output: its samples are wrong.
// Files are linked and never copied: they are the originals under a second name.
#pragma once

#include <functional>
#include <string>

#include "base/env.h"
#include "repair/archive/link_file.h"
#include "repair/rescale/repair_file.h"

namespace sixpoint::repair {

using LinkMaker =
    std::function<Status(const std::string& from, const std::string& to, LinkKind kind)>;

bool is_linked(const RepairReport& report);

// Fills in report.linked; where the link cannot be made the report says `failed`, with the error.
// Nothing for other files, for LinkKind::none and in a dry run.
void link_unaffected(FileSystem& files, const LinkMaker& make, LinkKind kind,
                     const std::string& output, RepairReport& report);

}  // namespace sixpoint::repair
