// sixpoint certificate: makes the certificate (or the label) of a run again, from the store alone.
#include "station/certificate.h"

#include <memory>

#include "base/atomic_file.h"
#include "station/cli/command.h"
#include "station/cli/store_option.h"

namespace sixpoint::cli {

namespace {

struct Options {
  std::string run;
  std::string store;
  std::string output;
  std::string label;
  bool json = false;
};

Result<station::Certificate> make(Context& context, const Options& options) {
  SIXPOINT_ASSIGN(auto store, open_existing_store(context, options.store));
  SIXPOINT_ASSIGN(const db::RunRecord run, store.run(options.run));
  SIXPOINT_ASSIGN(auto certificate, station::certificate_of(run));
  if (!options.output.empty()) {
    SIXPOINT_CHECK(station::write_certificate(context.env.files, options.output, run));
  }
  if (!options.label.empty()) {
    SIXPOINT_ASSIGN(const std::string label, station::label_zpl(run));
    SIXPOINT_CHECK(write_file(context.env.files, options.label, label));
  }
  return certificate;
}

}  // namespace

void add_certificate(CLI::App& app, Context& context) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand("certificate", "make the certificate of a jig run again");
  command->add_option("RUN", options->run, "the run's id, as 'sixpoint jig' said it")->required();
  command->add_option("-o,--output", options->output, "the .pdf or .json to make");
  command->add_option("--label", options->label, "and a label for the unit, as ZPL");
  add_store_option(*command, options->store);
  command->add_flag("--json", options->json, "the certificate as JSON on stdout");
  command->callback([options, &context] {
    const auto certificate = make(context, *options);
    if (!certificate) {
      return report_error(context, "certificate", certificate.error(), options->json);
    }
    if (options->json) {
      return print_json(context, certificate->to_json());
    }
    context.out << printable(certificate->serial) << ": " << to_string(certificate->verdict)
                << (options->output.empty() ? "" : ", certificate in " + options->output) << '\n';
  });
}

}  // namespace sixpoint::cli
