#include "base/text/html.h"

#include <fmt/format.h>

namespace sixpoint {

std::string html_escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string html_head(std::string_view title, std::string_view more_style) {
  constexpr std::string_view kStyle =
      "body{font:15px/1.45 system-ui,sans-serif;max-width:940px;margin:1.5em auto;padding:0 1em;"
      "color:#222}h1{font-size:1.3em}h2{font-size:1.1em}"
      ".say{font-size:1.2em;padding:.7em 1em;background:#f2f0ea;border-left:5px solid #b5442e}"
      "table{border-collapse:collapse;margin:1em 0;width:100%}caption{text-align:left;"
      "font-weight:600}td,th{border-bottom:1px solid #ddd;padding:.15em .5em;text-align:left;"
      "vertical-align:top;overflow-wrap:anywhere}td{font-variant-numeric:tabular-nums}"
      "thead{display:table-header-group}figure{margin:1em 0}figcaption{font-weight:600}"
      "svg text{font:11px system-ui,sans-serif;fill:#333}"
      "@media print{body{margin:0;max-width:none}figure,tr{break-inside:avoid}}";
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>"
      "<style>{1}{2}</style></head><body>\n<h1>{0}</h1>\n",
      html_escaped(title), kStyle, more_style);
}

}  // namespace sixpoint
