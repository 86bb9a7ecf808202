// sixpoint compare A B [C]: recordings of units that were moved together.
#include "repair/compare/compare.h"

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/output.h"

namespace sixpoint::cli {
namespace {

struct CompareCommandOptions {
  std::vector<std::string> paths;
  std::string html;
  double max_lag_s = repair::CompareOptions{}.max_lag_s;
  OutputOptions outputs;
  bool json = false;
};

Status run_compare(const CompareCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  for (const std::string& path : options.paths) {
    SIXPOINT_CHECK(outputs.input(path));
  }
  SIXPOINT_CHECK(outputs.file("--html", options.html));
  std::vector<repair::Trace> traces;
  for (const std::string& path : options.paths) {
    SIXPOINT_ASSIGN(auto trace, repair::Trace::load(context.env.files, path));
    traces.push_back(std::move(trace));
  }
  repair::CompareOptions how;
  how.max_lag_s = options.max_lag_s;
  std::vector<repair::PairComparison> pairs;
  for (std::size_t a = 0; a < traces.size(); ++a) {
    for (std::size_t b = a + 1; b < traces.size(); ++b) {
      SIXPOINT_ASSIGN(auto pair, repair::compare(traces[a], traces[b], how));
      if (!pair.usable()) {
        context.worsen(kExitInconclusive);
      }
      pairs.push_back(std::move(pair));
    }
  }
  if (!options.html.empty()) {
    SIXPOINT_CHECK(write_file(outputs.files(), options.html, repair::compare_html(traces, pairs)));
  }
  Json json = document("compare");
  Json& list = json["pairs"] = Json::array();
  std::string text;
  for (const repair::PairComparison& pair : pairs) {
    list.push_back(pair.to_json());
    text += pair.brief() + "\n";
    for (const std::string& remark : pair.remarks) {
      context.log().warn("{}, {}: {}", printable(pair.a), printable(pair.b), remark);
    }
  }
  return print_answer(context, options.json, json, text);
}

}  // namespace

void add_compare(CLI::App& app, Context& context) {
  auto [command, options] = add_command<CompareCommandOptions>(
      app, context, "compare", "recordings of units that were moved together", run_compare);
  command.add_option("RECORDING", options.paths, "two or three recordings")
      ->required()
      ->expected(2, 3);
  command.add_option("--html", options.html, "a page with the traces and the histograms");
  add_output_options(command, options.outputs);
  command.add_option("--max-lag", options.max_lag_s, "how far the clocks may differ, seconds")
      ->check(CLI::Range(0.0, 3'600.0));
}

}  // namespace sixpoint::cli
