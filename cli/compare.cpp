// sixpoint compare A B [C]: recordings of units that were moved together.
#include "repair/compare.h"

#include "base/atomic_file.h"
#include "station/cli/command.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::vector<std::string> paths;
  std::string html;
  double max_lag_s = repair::CompareOptions{}.max_lag_s;
  bool json = false;
};

Status run(const Options& options, Context& context) {
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
    SIXPOINT_CHECK(
        write_file(context.env.files, options.html, repair::compare_html(traces, pairs)));
  }
  if (options.json) {
    Json json = document("compare");
    json["pairs"] = Json::array();
    for (const repair::PairComparison& pair : pairs) {
      json["pairs"].push_back(pair.to_json());
    }
    print_json(context, json);
  } else {
    for (const repair::PairComparison& pair : pairs) {
      context.out << pair.brief() << '\n';
    }
  }
  for (const repair::PairComparison& pair : pairs) {
    for (const std::string& remark : pair.remarks) {
      context.log().warn("{}, {}: {}", printable(pair.a), printable(pair.b), remark);
    }
  }
  return {};
}

}  // namespace

void add_compare(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("compare", "recordings of units that were moved together");
  auto options = std::make_shared<Options>();
  command->add_option("RECORDING", options->paths, "two or three recordings")
      ->required()
      ->expected(2, 3);
  command->add_option("--html", options->html, "a page with the traces and the histograms");
  command->add_option("--max-lag", options->max_lag_s, "how far the clocks may differ, seconds")
      ->check(CLI::Range(0.0, 3'600.0));
  command->add_flag("--json", options->json, "one JSON document on standard output");
  command->callback([options, &context] {
    if (auto status = run(*options, context); !status) {
      report_error(context, "compare", status.error(), options->json);
    }
  });
}

}  // namespace sixpoint::cli
