// May a run that an earlier program left be gone on with here? One record has one jig, one station
// and one gravity.
//
//   SIXPOINT_ASSIGN(const bool goes_on, run_goes_on(left, now));
//
// | the run that was left                                  | answer                            |
// | of another unit, or under another filter or protocol   | no: it is begun anew              |
// | on another jig, at another station, by another gravity | usage error: name those, or begin |
// |                                                        | anew                              |
// | by another operator                                    | yes; the record names both        |
// | as now                                                 | yes                               |
//
// Runs of earlier versions did not note jig and gravity: those of now count. Pure functions.
#pragma once

#include <string>

#include "base/result.h"
#include "station/lanes/unfinished_run.h"

namespace sixpoint::station {

Result<bool> run_goes_on(const UnfinishedRun& left, const UnfinishedRun& now);

// "Ada, then Bo": of a run that another person took over, or whose constants another person wrote.
// An empty name is nobody. Names that the store does not take together (db::check_name) leave the
// one who ended it.
std::string both_names(const std::string& began, const std::string& ended);

}  // namespace sixpoint::station
