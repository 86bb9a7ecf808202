// The eight corners of a unit's case, between three sides each. Stood on a corner, in a mug for
// example, a unit shows its cross-axis sensitivities, which the six sides do not.
//
//   Status stand(CornerJig& jig) {
//     SIXPOINT_ASSIGN(const Corner corner, parse_corner("+x+y-z"));
//     return jig.go_to_corner(corner);
//   }
//
// A corner is named as poses are (jig.h): "+x+y-z" has its x and y axes up and its z axis down,
// each by 35 degrees from level.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "base/measure.h"
#include "base/result.h"

namespace sixpoint::device {

struct Corner {
  PerAxis<int> signs{};  // 1 or -1 each
  bool operator==(const Corner&) const = default;
};

// Every corner differs from the one before it in one axis: the unit is turned over one edge.
inline constexpr std::array<Corner, 8> kCorners = {{{{1, 1, 1}},
                                                    {{-1, 1, 1}},
                                                    {{-1, -1, 1}},
                                                    {{1, -1, 1}},
                                                    {{1, -1, -1}},
                                                    {{-1, -1, -1}},
                                                    {{-1, 1, -1}},
                                                    {{1, 1, -1}}}};

std::string to_string(const Corner& corner);         // "+x+y-z"
Result<Corner> parse_corner(std::string_view text);  // usage when it is none
PerAxis<double> direction_of(const Corner& corner);  // specific force at rest, in g

// What a jig (jig.h) that also stands a unit on its corners offers besides: found by a
// dynamic_cast. Threads and errors as for Jig::go_to().
class CornerJig {
 public:
  virtual ~CornerJig() = default;
  virtual Status go_to_corner(const Corner& corner) = 0;
};

}  // namespace sixpoint::device
