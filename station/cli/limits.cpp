// sixpoint limits: what runs are judged by.
#include "station/limits.h"

#include <memory>

#include "station/cli/command.h"

namespace sixpoint::cli {

namespace {

struct Options {
  std::string file;
  bool json = false;
};

void check(const Options& options, Context& context) {
  const auto limits = station::read_limits(context.env.files, options.file);
  if (!limits) {
    return report_error(context, "limits", limits.error(), options.json);
  }
  if (options.json) {
    Json answer = document("limits");
    answer.update(station::to_json(*limits));
    return print_json(context, answer);
  }
  context.out << limits->source << " holds; SHA-256 " << limits->sha256 << '\n';
}

void print_limits(const Options& options, Context& context) {
  auto limits = Result<station::Limits>(station::default_limits());
  if (!options.file.empty()) {
    limits = station::read_limits(context.env.files, options.file);
  }
  if (!limits) {
    return report_error(context, "limits", limits.error(), options.json);
  }
  if (options.json) {
    Json answer = document("limits");
    answer.update(station::to_json(*limits));
    return print_json(context, answer);
  }
  context.out << station::to_toml(*limits);
}

}  // namespace

void add_limits(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("limits", "what a jig run is judged by (docs/limits.md)");
  command->require_subcommand(1);
  auto options = std::make_shared<Options>();
  auto* check_command = command->add_subcommand("check", "does a limits file contradict itself?");
  check_command->add_option("FILE", options->file, "a TOML file")->required();
  check_command->add_flag("--json", options->json, "one JSON document on stdout");
  check_command->callback([options, &context] { check(*options, context); });
  auto* print_command =
      command->add_subcommand("print", "the built-in limits as TOML, or those of a file");
  print_command->add_option("FILE", options->file, "a TOML file");
  print_command->add_flag("--json", options->json, "one JSON document on stdout");
  print_command->callback([options, &context] { print_limits(*options, context); });
}

}  // namespace sixpoint::cli
