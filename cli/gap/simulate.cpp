// sixpoint simulate: a recording or a bundle from the simulator.
#include <memory>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "base/sha256.h"
#include "cli/command.h"
#include "cli/output.h"
#include "sim/bundle_writer.h"
#include "sim/firmware.h"
#include "sim/recording.h"

namespace sixpoint::cli {

namespace {

struct SimulateCommandOptions {
  std::string scenario;
  std::string output;
  std::string truth;
  OutputOptions outputs;
  bool json = false;
};

// The keys that the answers for a recording and for a bundle have in common.
Result<Json> answer_of(FileSystem& files, const sim::Scenario& scenario,
                       const std::string& recording) {
  Json json = document("simulate");
  json["file"] = recording;
  json["sha256"] = nullptr;  // of bytes that went into a device or a pipe
  if (const auto info = files.info(recording); info && info->kind == FileKind::file) {
    SIXPOINT_ASSIGN(json["sha256"], file_sha256(files, recording));
  }
  json["serial"] = scenario.unit.serial;
  json["firmware"] = scenario.unit.firmware;
  return json;
}

Result<Json> simulate_bundle(const SimulateCommandOptions& options, const sim::Scenario& scenario,
                             Outputs& outputs) {
  if (!options.truth.empty()) {
    return fail(ErrorCode::usage, "--truth cannot be used with a protocol", {},
                "leave it out: the scenario says what acted on the unit");
  }
  SIXPOINT_CHECK(outputs.folder("--output", options.output));
  SIXPOINT_ASSIGN(const sim::BundleReport report,
                  sim::write_bundle(outputs.files(), options.output, scenario));
  SIXPOINT_ASSIGN(Json json,
                  answer_of(outputs.files(), scenario, options.output + "/recording.gt3x"));
  json["bundle"] = options.output;
  json["segments"] = report.segments;
  json["samples"] = report.samples;
  json["duration_s"] = report.duration_s;
  return json;
}

Result<Json> simulate(Context& context, const SimulateCommandOptions& options) {
  Outputs outputs(context, options.outputs, options.json);
  FileSystem& files = outputs.files();
  SIXPOINT_CHECK(outputs.input(options.scenario));
  SIXPOINT_ASSIGN(const Bytes text, read_file(files, options.scenario));
  auto parsed = sim::parse_scenario(as_text(text));
  if (!parsed) {
    Error error = std::move(parsed).error();
    error.where = printable(options.scenario) + ": " + error.where;
    return fail(std::move(error));
  }
  const sim::Scenario& scenario = *parsed;
  if (scenario.protocol) {
    return simulate_bundle(options, scenario, outputs);
  }
  SIXPOINT_CHECK(outputs.file("--output", options.output));
  SIXPOINT_CHECK(outputs.file("--truth", options.truth));

  std::optional<AtomicFile> truth_file;
  sim::TruthSink truth;
  if (!options.truth.empty()) {
    SIXPOINT_ASSIGN(auto created, AtomicFile::create(files, options.truth));
    truth_file.emplace(std::move(created));
    SIXPOINT_CHECK(truth_file->append("unix_time_s,x_g,y_g,z_g\n"));
    truth = [&](UtcTime time, std::span<const Eigen::Vector3d> true_g) -> Status {
      std::string lines;
      for (std::size_t i = 0; i < true_g.size(); ++i) {
        fmt::format_to(std::back_inserter(lines), "{}.{:06},{:.6f},{:.6f},{:.6f}\n",
                       to_unix_seconds(time),
                       static_cast<std::uint64_t>(i) * 1'000'000 / true_g.size(), true_g[i].x(),
                       true_g[i].y(), true_g[i].z());
      }
      return truth_file->append(lines);
    };
  }
  SIXPOINT_ASSIGN(const sim::RecordingReport report,
                  sim::write_recording(files, options.output, scenario, truth));
  if (truth_file) {
    SIXPOINT_CHECK(truth_file->commit());
  }

  if (!options.output.ends_with(".gt3x") && !options.output.ends_with(".GT3X")) {
    context.log().warn("{}: scan and repair of a folder look at names that end with .gt3x alone",
                       printable(options.output));
  }
  SIXPOINT_ASSIGN(Json json, answer_of(files, scenario, options.output));
  json["filter"]["in_force"] = calib::to_string(scenario.filter_in_force());
  json["filter"]["constants_measured_under"] =
      calib::to_string(sim::filter_of_constants(scenario.unit.serial, scenario.unit.calibrated));
  json["samples"] = report.samples;
  json["duration_s"] = report.duration_s;
  json["clipped_samples"] = report.clipped_samples;
  json["truth"] = text_or_null(options.truth);
  return json;
}

Status run_simulate(const SimulateCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(const Json json, simulate(context, options));
  return print_answer(
      context, options.json, json,
      fmt::format("{}: {} samples, {:.0f} s, unit {} with firmware {}\n", options.output,
                  json["samples"].get<std::uint64_t>(), json["duration_s"].get<double>(),
                  json["serial"].get<std::string>(), json["firmware"].get<std::string>()));
}

}  // namespace

void add_simulate(CLI::App& app, Context& context) {
  auto [command, options] = add_command<SimulateCommandOptions>(
      app, context, "simulate",
      "make a recording or a bundle from a scenario; the same scenario gives the same bytes",
      run_simulate);
  command.add_option("--scenario", options.scenario, "what happens (docs/scenario.md)")->required();
  command
      .add_option("-o,--output", options.output, "the .gt3x file to make, or the bundle's folder")
      ->required();
  command.add_option("--truth", options.truth, "also write the true motion in g, as CSV");
  add_output_options(command, options.outputs);
}

}  // namespace sixpoint::cli
