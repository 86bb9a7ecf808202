// sixpoint impact BEFORE [AFTER]: what a repair changes in what a study computes.
#include "repair/impact/impact.h"

#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/output.h"
#include "repair/rescale/repair_mark.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::vector<std::string> paths;
  int epoch_s = repair::EpochOptions{}.epoch_s;
  bool low_frequency_extension = false;
  std::vector<std::string> cuts;
  std::string csv;
  std::string html;
  OutputOptions outputs;
  bool json = false;
};

Result<repair::EpochSeries> series_of(const Options& options, const std::string& path,
                                      Context& context) {
  SIXPOINT_ASSIGN(auto recording, gt3x::Recording::open(context.env.files, path));
  repair::EpochOptions how;
  how.epoch_s = options.epoch_s;
  how.filter = options.low_frequency_extension ? repair::CountFilter::low_frequency_extension
                                               : repair::CountFilter::normal;
  return repair::epochs_of(recording, how);
}

Status run(const Options& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  for (const std::string& path : options.paths) {
    SIXPOINT_CHECK(outputs.input(path));
  }
  SIXPOINT_CHECK(outputs.file("--csv", options.csv));
  SIXPOINT_CHECK(outputs.file("--html", options.html));
  repair::Impact impact;
  for (const std::string& text : options.cuts) {
    SIXPOINT_ASSIGN(const auto cut, repair::parse_cut_point(text));
    impact.cuts.push_back(cut);
  }
  SIXPOINT_ASSIGN(impact.before, series_of(options, options.paths[0], context));
  if (options.paths.size() > 1) {
    SIXPOINT_ASSIGN(impact.after, series_of(options, options.paths[1], context));
    if (const auto mark = repair::mark_in(context.env.files, options.paths[1])) {
      impact.after_uncertainty_mg = repair::three_in(*mark, "sample_uncertainty_mg");
    }
  }
  SIXPOINT_CHECK(repair::check(impact));
  if (!options.csv.empty()) {
    SIXPOINT_CHECK(write_file(outputs.files(), options.csv, repair::impact_csv(impact)));
  }
  if (!options.html.empty()) {
    SIXPOINT_CHECK(write_file(outputs.files(), options.html, repair::impact_html(impact)));
  }
  Json json = document("impact");
  json.update(impact.to_json());
  return print_answer(context, options.json, json, impact.brief());
}

}  // namespace

void add_impact(CLI::App& app, Context& context) {
  auto [command, options] = add_command<Options>(app, context, "impact",
                                                 "what a repair changes in a study's results", run);
  command.add_option("RECORDING", options.paths, "the recording as it was, and its repaired copy")
      ->required()
      ->expected(1, 2);
  command.add_option("--epoch", options.epoch_s, "length of an epoch, whole seconds")
      ->check(CLI::Range(1, 3600));
  command.add_flag("--lfe", options.low_frequency_extension,
                   "counts with the low frequency extension");
  command.add_option(
      "--cut", options.cuts,
      "minutes above a value: NAME=MG of ENMO, such as moderate=100; may be given again");
  command.add_option("--csv", options.csv, "a line per epoch");
  command.add_option("--html", options.html, "a page with the table and the curves");
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli
