// sixpoint certificate: makes the certificate (or the label) of a run again, from the store alone.
#include "station/certificate/certificate.h"

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "cli/command.h"
#include "cli/output.h"
#include "cli/people_text.h"
#include "cli/store_option.h"

namespace sixpoint::cli {

namespace {

struct CertificateCommandOptions {
  std::string run;
  std::string store;
  std::string output;
  std::string label;
  OutputOptions outputs;
  bool json = false;
};

Status run_certificate(const CertificateCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.input(store_file(options.store)));
  SIXPOINT_CHECK(outputs.file("--output", options.output));
  SIXPOINT_CHECK(outputs.file("--label", options.label));
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const db::RunRecord record, store.run(options.run));
  SIXPOINT_ASSIGN(const auto certificate, station::certificate_of(record));
  if (!options.output.empty()) {
    SIXPOINT_CHECK(station::write_certificate(outputs.files(), options.output, record));
  }
  if (!options.label.empty()) {
    SIXPOINT_ASSIGN(const std::string label, station::label_zpl(record));
    SIXPOINT_CHECK(write_file(outputs.files(), options.label, label));
  }
  SIXPOINT_CHECK(print_answer(
      context, options.json, certificate.to_json(),
      fmt::format("{}: {}{}\n", printable(certificate.serial), to_string(certificate.verdict),
                  options.output.empty() ? "" : ", certificate in " + options.output)));
  if (options.output.empty() && options.label.empty()) {
    next_step(
        context, options.json,
        with_store({"certificate", db::shown_id(record.id), "-o", certificate.serial + ".pdf"},
                   options.store));
  }
  return {};
}

}  // namespace

void add_certificate(CLI::App& app, Context& context) {
  auto [command, options] = add_command<CertificateCommandOptions>(
      app, context, "certificate", "make the certificate of a jig run again", run_certificate);
  command.add_option("RUN", options.run, "the run's id, as 'sixpoint jig' said it")->required();
  command.add_option("-o,--output", options.output, "the .pdf, .json or .dcc.xml to make");
  command.add_option("--label", options.label, "and a label for the unit, as ZPL");
  add_output_options(command, options.outputs);
  add_store_option(command, options.store);
}

}  // namespace sixpoint::cli
