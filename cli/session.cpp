// sixpoint session: recorded sessions are shown, made small, and made of USB captures.
#include "device/session.h"

#include <map>

#include <fmt/format.h>

#include "device/pcap.h"
#include "device/protocol.h"
#include "device/session_journal.h"
#include "station/cli/command.h"
#include "station/session_minimiser.h"

namespace sixpoint::cli {
namespace {

struct Options {
  std::string input;
  std::string output;
  std::string work = "jig";
  int most_replays = 2000;
  std::optional<std::uint16_t> bus;
  std::optional<std::uint16_t> device_number;
  bool json = false;
};

Json summary_of(const device::Session& session) {
  Json json = document("session");
  json["device"] = session.device;
  json["started"] = to_iso8601(session.started);
  json["transfers"] = session.transfers.size();
  json["truncated"] = session.truncated;
  json["duration_s"] = session.transfers.empty()
                           ? 0.0
                           : std::chrono::duration<double>(session.transfers.back().time).count();
  std::map<std::string, std::size_t> commands;
  std::size_t samples = 0;
  std::size_t blocks = 0;
  std::size_t errors = 0;
  for (const device::SessionTransfer& transfer : session.transfers) {
    errors += transfer.error ? 1 : 0;
    blocks += transfer.channel == device::SessionChannel::bulk ? 1 : 0;
    const auto message = device::decode(transfer.bytes);
    if (message && message->kind == device::ReportKind::request) {
      ++commands[std::string(device::to_string(message->command))];
    }
    samples += message && message->kind == device::ReportKind::samples ? 1 : 0;
  }
  json["requests"] = commands;
  json["sample_reports"] = samples;
  json["bulk_blocks"] = blocks;
  json["errors"] = errors;
  return json;
}

void tell(Context& context, const Options& options, const device::Session& session,
          const std::string& more) {
  Json json = summary_of(session);
  if (options.json) {
    if (!more.empty()) {
      json["summary"] = more;
    }
    return print_json(context, json);
  }
  context.out << fmt::format("{}: {} transfers in {:.1f} s with {}\n",
                             printable(options.output.empty() ? options.input : options.output),
                             session.transfers.size(), json["duration_s"].get<double>(),
                             printable(session.device));
  if (!more.empty()) {
    context.out << more << '\n';
  }
}

Status show(Context& context, const Options& options) {
  SIXPOINT_ASSIGN(const device::Session session,
                  device::read_session(context.env.files, options.input));
  tell(context, options, session, {});
  return {};
}

Status minimise(Context& context, const Options& options) {
  SIXPOINT_ASSIGN(const device::Session session,
                  device::read_session(context.env.files, options.input));
  station::MinimiseOptions how;
  SIXPOINT_ASSIGN(how.work, station::parse_session_work(options.work));
  how.most_replays = options.most_replays;
  const station::MinimiseReport report = station::minimise(session, how);
  SIXPOINT_CHECK(device::write_session(context.env.files, options.output, report.session));
  tell(context, options, report.session, report.brief());
  return {};
}

Status from_pcap(Context& context, const Options& options) {
  constexpr std::uint64_t kMostCapture_bytes = 512ULL << 20U;
  SIXPOINT_ASSIGN(const Bytes bytes,
                  read_file(context.env.files, options.input, kMostCapture_bytes));
  device::PcapOptions how;
  how.bus = options.bus;
  how.device = options.device_number;
  auto session = device::session_from_pcap(bytes, how);
  if (!session) {
    Error error = std::move(session).error();
    error.where = options.input + ": " + error.where;
    return fail(std::move(error));
  }
  SIXPOINT_CHECK(device::write_session(context.env.files, options.output, *session));
  tell(context, options, *session, {});
  return {};
}

Status recover(Context& context, const Options& options) {
  const std::string suffix = device::journal_of("");
  const bool is_journal = options.input.ends_with(suffix);
  const std::string target =
      is_journal ? options.input.substr(0, options.input.size() - suffix.size()) : options.input;
  SIXPOINT_ASSIGN(const auto recovered,
                  device::recover_session(context.env.files, device::journal_of(target),
                                          options.output.empty() ? target : options.output));
  SIXPOINT_ASSIGN(const device::Session session,
                  device::read_session(context.env.files, recovered.target));
  Options about = options;
  about.output = recovered.target;
  tell(context, about, session,
       fmt::format("recovered; {} bytes behind the last whole transfer were dropped",
                   recovered.dropped_bytes));
  return {};
}

using Work = Status (*)(Context&, const Options&);

CLI::App* add(CLI::App& app, Context& context, const std::shared_ptr<Options>& options,
              const char* name, const char* purpose, const char* input, Work work) {
  CLI::App* command = app.add_subcommand(name, purpose);
  command->add_option(input, options->input)->required();
  command->add_flag("--json", options->json, "answer as JSON");
  command->callback([options, &context, work] {
    if (const Status status = work(context, *options); !status) {
      report_error(context, "session", status.error(), options->json);
    }
  });
  return command;
}

}  // namespace

void add_session(CLI::App& app, Context& context) {
  CLI::App* command = app.add_subcommand(
      "session", "recorded sessions (--record): show, recover, make small, make of a USB capture");
  command->require_subcommand(1);
  const auto options = std::make_shared<Options>();
  add(*command, context, options, "show", "what a session holds", "SESSION", show);
  CLI::App* broken_off =
      add(*command, context, options, "recover",
          "a session of the journal that a recording left which was killed", "SESSION", recover);
  broken_off->add_option("-o,--output", options->output,
                         "the session to make; SESSION unless given");
  CLI::App* small = add(*command, context, options, "minimise",
                        "the least that still ends in the same way", "SESSION", minimise);
  small->add_option("-o,--output", options->output, "the session to make")->required();
  small->add_option("--doing", options->work, "what is done in a replay: identify, jig, capture")
      ->capture_default_str();
  small->add_option("--replays", options->most_replays, "replays to try at most")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  CLI::App* pcap =
      add(*command, context, options, "from-pcap",
          "a session of a USB capture: pcap or pcapng, of usbmon or USBPcap", "CAPTURE", from_pcap);
  pcap->add_option("-o,--output", options->output, "the session to make")->required();
  pcap->add_option("--bus", options->bus, "of this bus only");
  pcap->add_option("--device-number", options->device_number, "of this device on the bus only")
      ->check(CLI::Range(1, 127));
}

}  // namespace sixpoint::cli
