#include "cli/station/jig_options.h"

#include <algorithm>

#include <fmt/format.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/devices/known_devices.h"
#include "cli/station/record_option.h"
#include "cli/store_option.h"
#include "mocks/in_process/virtual_jig.h"

namespace sixpoint::cli {

namespace {

// Only the program can turn such a unit.
bool is_turned_by_words(const Context& context, const JigOptions& options) {
  return context.people_at_terminal && isatty(STDIN_FILENO) == 1 && options.jig.empty() &&
         options.device.starts_with("virtual:") && options.device.find("jig=") == std::string::npos;
}

// On the machine's clock, because words take their time.
std::string for_words(const std::string& device) {
  const std::string turned = station::with_jig(device, "virtual");
  return turned.find("pace=") == std::string::npos ? turned + ",pace=real" : turned;
}

}  // namespace

void add_jig_options(CLI::App& command, JigOptions& options) {
  command
      .add_option("--device", options.device,
                  "the unit, for example virtual:seed=7 (docs/virtual.md)")
      ->required();
  command.add_option("--jig", options.jig,
                     "manual (a person turns the unit), virtual, or hid:SERIAL (a motorised jig)");
  command.add_flag("--jig-is-free", options.jig_is_free,
                   "a motorised jig was stopped: I looked, no hand is in it, it may turn again");
  add_store_option(command, options.store);
  add_record_option(command, options.record);
  add_output_options(command, options.outputs);
  add_gravity_options(command, options.gravity);
}

PromptWord prompt_word(std::string_view line) {
  if (line.ends_with('\r')) {
    line.remove_suffix(1);
  }
  if (line.empty()) {
    return PromptWord::empty;
  }
  return line == "s" || line == "q" || line == "stop" ? PromptWord::stop : PromptWord::other;
}

Status read_for_device(const std::string& device, Outputs& outputs) {
  const std::string address = device.substr(std::min(device.find(':') + 1, device.size()));
  std::vector<std::string> paths = {address};
  for (std::size_t begin = 0; begin < address.size();) {
    const std::size_t comma = std::min(address.find(',', begin), address.size());
    const std::string setting = address.substr(begin, comma - begin);
    paths.push_back(setting.substr(setting.find('=') + 1));
    begin = comma + 1;
  }
  for (const std::string& path : paths) {
    SIXPOINT_CHECK(outputs.input(path));
    for (const std::string& name :
         outputs.files().list(path).value_or(std::vector<std::string>{})) {
      SIXPOINT_CHECK(outputs.input(fmt::format("{}/{}", path, name)));
    }
  }
  return {};
}

Result<JiggedUnit> open_unit(Context& context, const JigOptions& options, Outputs& outputs,
                             device::SessionRecorder& recorder) {
  SIXPOINT_CHECK(begin_session(outputs, recorder, options.record));
  JiggedUnit opened;
  const bool by_words = is_turned_by_words(context, options);
  SIXPOINT_ASSIGN(
      opened.unit,
      station::known_units().open(
          by_words ? for_words(options.device) : station::with_jig(options.device, options.jig),
          context.env, [&recorder](device::Link& link) { recorder.attach(link); }));
  if (by_words) {
    // The jig in it is the hands; for the run, a person turns the unit.
    auto* const turned = dynamic_cast<mocks::VirtualJig*>(opened.unit->jig());
    opened.own_jig = std::make_unique<device::ManualJig>();
    opened.jig = opened.own_jig.get();
    if (turned != nullptr) {
      opened.hands = std::make_unique<mocks::VirtualHands>(turned->plugged());
    }
    return opened;
  }
  SIXPOINT_ASSIGN(opened.jig,
                  station::choose_jig(options.jig, *opened.unit, context.env, opened.own_jig));
  if (opened.jig->turns_by_itself()) {
    if (options.jig_is_free) {
      SIXPOINT_CHECK(opened.jig->release());
    }
    SIXPOINT_CHECK(device::check_jig(*opened.jig));
  }
  return opened;
}

}  // namespace sixpoint::cli
