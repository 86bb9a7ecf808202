// When a unit was calibrated, as the store knows it: for files that do not say so (.agd).
//
//   SIXPOINT_ASSIGN(const auto history, store.unit_history("MOS2A1"));
//   const KnownDate known = calibration_date(history);
//
// A repair tells the date that the unit's recording states, a jig run the dates in the unit's
// memory before and after.
//
// | what these records say     | date    | why                                               |
// |----------------------------|---------|---------------------------------------------------|
// | nothing                    | none    | empty                                             |
// | one date, however often    | it      | which kind of record says so                      |
// | several dates              | none    | that which of them held for this file is unknown  |
#pragma once

#include "db/questions.h"
#include "repair/triage/scan_file.h"

namespace sixpoint::repair {

KnownDate calibration_date(const db::UnitHistory& history);

}  // namespace sixpoint::repair
