// sixpoint limits: what runs are judged by.
#include "station/limits/limits.h"

#include <fmt/format.h>

#include "cli/command.h"

namespace sixpoint::cli {

namespace {

struct LimitsCommandOptions {
  std::string file;
  bool json = false;
};

Status answer(const LimitsCommandOptions& options, Context& context, const station::Limits& limits,
              const std::string& text) {
  Json json = document("limits");
  json.update(station::to_json(limits));
  return print_answer(context, options.json, json, text);
}

Status check(const LimitsCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(const auto limits, station::read_limits(context.env.files, options.file));
  return answer(options, context, limits,
                fmt::format("{} holds; SHA-256 {}\n", limits.source, limits.sha256));
}

Status print_limits(const LimitsCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(const auto limits, station::read_limits(context.env.files, options.file));
  return answer(options, context, limits, station::to_toml(limits));
}

}  // namespace

void add_limits(CLI::App& app, Context& context) {
  CLI::App& group = add_group(app, "limits", "what a jig run is judged by (docs/limits.md)");
  const auto checked = add_command<LimitsCommandOptions>(
      group, context, "limits", "check", "does a limits file contradict itself?", check);
  checked.command.add_option("FILE", checked.options.file, "a TOML file")->required();
  const auto printed = add_command<LimitsCommandOptions>(
      group, context, "limits", "print", "the built-in limits as TOML, or those of a file",
      print_limits);
  printed.command.add_option("FILE", printed.options.file, "a TOML file");
}

}  // namespace sixpoint::cli
