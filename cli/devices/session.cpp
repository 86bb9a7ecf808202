// sixpoint session: shows, recovers and minimises recorded sessions, and makes them of USB
// captures.
#include "device/session/session.h"

#include <map>

#include <fmt/format.h>

#include "cli/command.h"
#include "cli/devices/session_minimiser.h"
#include "cli/output.h"
#include "device/session/pcap.h"
#include "device/session/session_journal.h"
#include "device/wire/protocol.h"

namespace sixpoint::cli {
namespace {

struct SessionCommandOptions {
  std::string input;
  std::string output;
  std::string work = "jig";
  int most_replays = 2000;
  std::optional<std::uint16_t> bus;
  std::optional<std::uint16_t> device_number;
  OutputOptions outputs;
  bool json = false;
};

Json summary_of(const device::Session& session) {
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
  Json json = document("session");
  json["device"] = session.device;
  json["started"] = to_iso8601(session.started);
  json["transfers"] = session.transfers.size();
  json["truncated"] = session.truncated;
  json["duration_s"] = session.transfers.empty()
                           ? 0.0
                           : std::chrono::duration<double>(session.transfers.back().time).count();
  json["requests"] = commands;
  json["sample_reports"] = samples;
  json["bulk_blocks"] = blocks;
  json["errors"] = errors;
  return json;
}

// The summary of `session`, which `path` holds; `remark` says what was done with it.
void print_session(Context& context, bool as_json, const std::string& path,
                   const device::Session& session, const std::string& remark) {
  Json json = summary_of(session);
  std::string text = fmt::format("{}: {} transfers in {:.1f} s with {}\n", printable(path),
                                 session.transfers.size(), json["duration_s"].get<double>(),
                                 printable(session.device));
  if (!remark.empty()) {
    json["summary"] = remark;
    text += remark + "\n";
  }
  print_answer(context, as_json, json, text);
}

Status show(const SessionCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(const device::Session session,
                  device::read_session(context.env.files, options.input));
  print_session(context, options.json, options.input, session, {});
  return {};
}

Status minimise(const SessionCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.input(options.input));
  SIXPOINT_CHECK(outputs.file("--output", options.output));
  SIXPOINT_ASSIGN(const device::Session session,
                  device::read_session(context.env.files, options.input));
  MinimiseOptions how;
  SIXPOINT_ASSIGN(how.work, parse_session_work(options.work));
  how.most_replays = options.most_replays;
  const MinimiseReport report = cli::minimise(session, how);
  SIXPOINT_CHECK(device::write_session(outputs.files(), options.output, report.session));
  print_session(context, options.json, options.output, report.session, report.brief());
  return {};
}

Status from_pcap(const SessionCommandOptions& options, Context& context) {
  Outputs outputs(context, options.outputs, options.json);
  SIXPOINT_CHECK(outputs.input(options.input));
  SIXPOINT_CHECK(outputs.file("--output", options.output));
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
  SIXPOINT_CHECK(device::write_session(outputs.files(), options.output, *session));
  print_session(context, options.json, options.output, *session, {});
  return {};
}

Status recover(const SessionCommandOptions& options, Context& context) {
  const std::string suffix = device::journal_of("");
  std::string target = options.input;
  if (target.ends_with(suffix)) {
    target.resize(target.size() - suffix.size());
  }
  const std::string output = options.output.empty() ? target : options.output;
  Outputs outputs(context, options.outputs, options.json);
  const std::string journal = device::journal_of(target);
  SIXPOINT_CHECK(outputs.input(journal));
  if (context.env.files.info(journal)) {
    SIXPOINT_CHECK(outputs.file_to_keep("--output", output));
  }
  SIXPOINT_ASSIGN(const auto recovered, device::recover_session(outputs.files(), journal, output));
  SIXPOINT_ASSIGN(const device::Session session,
                  device::read_session(context.env.files, recovered.target));
  print_session(context, options.json, recovered.target, session,
                fmt::format("recovered; {} bytes after the last whole transfer were dropped",
                            recovered.dropped_bytes));
  return {};
}

}  // namespace

void add_session(CLI::App& app, Context& context) {
  CLI::App& group =
      add_group(app, "session",
                "recorded sessions (--record): show, recover, minimise, make of a USB capture");
  const auto add = [&](const char* name, const char* purpose, const char* input,
                       Status (*work)(const SessionCommandOptions&, Context&)) {
    auto declared =
        add_command<SessionCommandOptions>(group, context, "session", name, purpose, work);
    declared.command.add_option(input, declared.options.input)->required();
    return declared;
  };
  const auto add_output = [](Declared<SessionCommandOptions> made, const char* about) {
    add_output_options(made.command, made.options.outputs);
    return made.command.add_option("-o,--output", made.options.output, about);
  };
  add("show", "what a session holds", "SESSION", show);
  add_output(add("recover", "make the session of a recording that was killed, from its journal",
                 "SESSION", recover),
             "the session to make (default: SESSION)");
  const auto small =
      add("minimise", "the fewest transfers that still end in the same way", "SESSION", minimise);
  add_output(small, "the session to make")->required();
  small.command
      .add_option("--doing", small.options.work, "what is done in a replay: identify, jig, capture")
      ->capture_default_str();
  small.command.add_option("--replays", small.options.most_replays, "replays to try at most")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  const auto pcap = add("from-pcap", "a session of a USB capture: pcap, of usbmon or USBPcap",
                        "CAPTURE", from_pcap);
  add_output(pcap, "the session to make")->required();
  pcap.command.add_option("--bus", pcap.options.bus, "only this bus");
  pcap.command
      .add_option("--device-number", pcap.options.device_number, "only this device on the bus")
      ->check(CLI::Range(1, 127));
}

}  // namespace sixpoint::cli
