// Routes of a run's papers: certificate, report, label.
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "station/page/api_answers.h"
#include "station/printing/label_printer.h"

namespace sixpoint::station {

ApiAnswer Api::get_document(const ApiRequest& request, const std::string& run,
                            const std::string& kind) const {
  if (!parts_.run_document || !is_run_id(run)) {
    return unknown_route();
  }
  const auto document = parts_.run_document(run, kind);
  if (!document) {
    return refusal(document.error());
  }
  // A browser shows and prints a PDF; the other kinds are for programs, and could be anything in a
  // browser's eyes.
  const bool is_shown = kind == "certificate.pdf" && request.parameter("download").empty();
  ApiAnswer paper{200,
                  document->content_type,
                  document->body,
                  {{"Content-Disposition",
                    fmt::format("{}; filename=\"sixpoint-{}-{}\"",
                                is_shown ? "inline" : "attachment", run.substr(0, 12), kind)}}};
  if (is_shown) {
    // The browser's viewer of PDFs is a page of its own, with scripts and styles of its own.
    paper.headers.emplace_back("Content-Security-Policy", "frame-ancestors 'none'");
  }
  return paper;
}

// The label of a stored run again, for the station's printer.
ApiAnswer Api::print_label(const ApiRequest& request, const std::string& run) const {
  if (parts_.printer == nullptr || !parts_.print_again || !is_run_id(run)) {
    return unknown_route();
  }
  if (const auto who = signer(request, {}, OperatorRole::technician); !who) {
    return who.error();
  }
  const Status printed = parts_.print_again(run);
  return printed ? answer(202, {{"run", run}}) : refusal(printed.error());
}

}  // namespace sixpoint::station
