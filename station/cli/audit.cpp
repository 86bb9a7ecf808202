// sixpoint audit verify: has anybody touched the store's history?
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "station/cli/command.h"
#include "station/cli/store_option.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::string store;
  std::string head;
  bool json = false;
};

void verify(const Options& options, Context& context) {
  auto store = open_existing_store(context, options.store);
  if (!store) {
    return report_error(context, "audit", store.error(), options.json);
  }
  const auto report = store->audit(options.head);
  if (!report) {
    return report_error(context, "audit", report.error(), options.json);
  }
  context.worsen(report->ok ? kExitPassed : kExitFailed);
  if (options.json) {
    Json answer = document("audit");
    answer.update(report->to_json());
    return print_json(context, answer);
  }
  context.out << report->brief() << '\n';
  for (const std::string& finding : report->findings) {
    context.log().error(finding);
  }
  if (!report->ok) {
    context.log().error("keep this file, restore the last backup and compare the two");
  }
}

}  // namespace

void add_audit(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("audit", "Check the store's history");
  command->require_subcommand(1);
  auto* verify_command =
      command->add_subcommand("verify", "Find any row that was changed, removed or moved");
  auto options = std::make_shared<Options>();
  add_store_option(*verify_command, options->store);
  verify_command->add_option("--head", options->head,
                             "A head that was written down earlier: is it still in the chain?");
  verify_command->add_flag("--json", options->json, "One JSON document on stdout");
  verify_command->callback([options, &context] { verify(*options, context); });
}

}  // namespace sixpoint::cli
