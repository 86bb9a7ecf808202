// Text inside HTML, XML and SVG.
//
//   page += "<td>" + html_escaped(serial) + "</td>";
#pragma once

#include <string>
#include <string_view>

namespace sixpoint {

// With <, >, & and " as entities: right between tags and inside a quoted attribute.
std::string html_escaped(std::string_view text);

}  // namespace sixpoint
