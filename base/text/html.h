// Text inside HTML, XML and SVG.
//
//   std::string page = html_head("Unit " + serial);
//   page += "<td>" + html_escaped(serial) + "</td>";
//   page += kHtmlEnd;
#pragma once

#include <string>
#include <string_view>

namespace sixpoint {

// With <, >, & and " as entities: right between tags and inside a quoted attribute.
std::string html_escaped(std::string_view text);

// The beginning of a report that stands alone in one file: title, style, and the title as heading.
// All reports look alike by it; `more_style` is CSS of this one, and wins where both speak. A page
// without a foreign resource, readable on paper. `title` is escaped here, `more_style` is not.
std::string html_head(std::string_view title, std::string_view more_style = {});
inline constexpr std::string_view kHtmlEnd = "</body></html>\n";

}  // namespace sixpoint
