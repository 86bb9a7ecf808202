// sixpoint audit verify|head: was the history in the store changed after it was written?
#include "cli/command.h"
#include "cli/store_option.h"

namespace sixpoint::cli {
namespace {

struct AuditCommandOptions {
  std::string store;
  std::string head;
  bool json = false;
};

Status verify(const AuditCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto report, store.audit(options.head));
  context.worsen(report.ok ? kExitPassed : kExitFailed);
  Json json = document("audit");
  json.update(report.to_json());
  print_answer(context, options.json, json, report.brief() + "\n");
  if (options.json || report.ok) {
    return {};
  }
  for (const std::string& finding : report.findings) {
    context.log().error(finding);
  }
  context.log().error("keep this file, restore the last backup and compare the two");
  return {};
}

Status print_head(const AuditCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const auto head, store.head());
  Json json = document("audit");
  json.update(head.to_json());
  return print_answer(context, options.json, json, head.head + "\n");
}

}  // namespace

void add_audit(CLI::App& app, Context& context) {
  CLI::App& group = add_group(app, "audit", "check the history in the store");
  auto [ending, of_head] = add_command<AuditCommandOptions>(
      group, context, "audit", "head", "the end of the chain, to be written down elsewhere",
      print_head);
  add_store_option(ending, of_head.store);
  auto [command, options] = add_command<AuditCommandOptions>(
      group, context, "audit", "verify", "find rows that were changed, removed or moved", verify);
  add_store_option(command, options.store);
  command.add_option(
      "--head", options.head,
      "a head that 'audit head', a backup, an export or a certificate gave: is it still "
      "a part of the history?");
}

}  // namespace sixpoint::cli
