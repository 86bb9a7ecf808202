// What the other files of a unit know about its constants: asked last, where a file's own still
// periods do not suffice. repair/units/unit_pool.h is the one that collects them.
//
//   ConstantsFinderOptions options;
//   options.unit = &pool;  // not owned
//   ConstantsFinder finder(env, options);
#pragma once

#include <string>

#include "calib/solve.h"
#include "repair/rescale/repair_file.h"

namespace sixpoint::repair {

// Must be safe to call from several threads.
class UnitConstants {
 public:
  virtual ~UnitConstants() = default;
  // A file was asked for constants by its own still periods, and this is what they gave: `record`
  // is null where they do not suffice.
  virtual void add(const std::string& path, const Survey& survey,
                   const calib::ConstantsRecord* record) = 0;
  // Constants by the unit's other files, or a reason why there are none.
  virtual void ask(const std::string& path, const Survey& survey, ConstantsChoice& choice) = 0;
};

}  // namespace sixpoint::repair
