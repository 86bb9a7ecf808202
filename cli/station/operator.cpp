// sixpoint operator: who works at the stations of this machine.
#include "cli/station/operator.h"

#include <algorithm>
#include <array>
#include <csignal>

#include <fmt/format.h>
#include <termios.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/store_option.h"
#include "station/access/operators.h"

namespace sixpoint::cli {

namespace {

struct OperatorCommandOptions {
  std::string name;
  std::string role;  // empty: as before; technician where the operator is new
  bool json = false;
};

// What the handler below needs, for one prompt at a time.
constexpr std::array kEndingSignals = {SIGINT, SIGTERM, SIGHUP};
termios shown_terminal{};
std::array<struct sigaction, kEndingSignals.size()> actions_before{};

void restore_actions() {
  for (std::size_t i = 0; i < kEndingSignals.size(); ++i) {
    ::sigaction(kEndingSignals[i], &actions_before[i], nullptr);
  }
}

// The terminal shows again what is typed; then the signal does what it did before.
extern "C" void show_and_go_on(int signal) {
  tcsetattr(STDIN_FILENO, TCSANOW, &shown_terminal);
  restore_actions();
  ::raise(signal);  // comes when this returns
}

// While it lives, a terminal on standard input does not show what is typed.
class HiddenTyping {
 public:
  HiddenTyping() : at_terminal_(tcgetattr(STDIN_FILENO, &shown_terminal) == 0) {
    if (!at_terminal_) {
      return;
    }
    for (std::size_t i = 0; i < kEndingSignals.size(); ++i) {
      ::sigaction(kEndingSignals[i], nullptr, &actions_before[i]);
      if (actions_before[i].sa_handler != SIG_IGN) {
        struct sigaction action {};
        action.sa_handler = show_and_go_on;
        ::sigaction(kEndingSignals[i], &action, nullptr);
      }
    }
    termios hidden = shown_terminal;
    hidden.c_lflag &= ~static_cast<tcflag_t>(ECHO);
    tcsetattr(STDIN_FILENO, TCSANOW, &hidden);
  }
  HiddenTyping(const HiddenTyping&) = delete;
  HiddenTyping& operator=(const HiddenTyping&) = delete;
  ~HiddenTyping() {
    if (at_terminal_) {
      tcsetattr(STDIN_FILENO, TCSANOW, &shown_terminal);
      restore_actions();
    }
  }

 private:
  bool at_terminal_;
};

// Typed at a terminal it is not shown; from a pipe it is the first line.
std::string read_pin(Context& context, const std::string& whose) {
  context.people << fmt::format("PIN of {}: ", printable(whose, 80)) << std::flush;
  std::string pin;
  {
    const HiddenTyping hidden;
    std::getline(context.in, pin);
  }
  context.people << "\n";
  return pin;
}

Status add(const OperatorCommandOptions& options, Context& context) {
  std::optional<station::OperatorRole> role;
  if (!options.role.empty()) {
    SIXPOINT_ASSIGN(role, station::parse_operator_role(options.role));
  }
  station::Operators operators(context.env, operators_file());
  SIXPOINT_ASSIGN(const auto has,
                  operators.add(options.name, role, read_pin(context, options.name)));
  Json json = document("operator");
  json["name"] = options.name;
  json["role"] = to_string(has);
  return print_answer(
      context, options.json, json,
      fmt::format("{} is {} {} now\n", printable(options.name),
                  has == station::OperatorRole::engineer ? "an" : "a", to_string(has)));
}

Status disable(const OperatorCommandOptions& options, Context& context) {
  SIXPOINT_CHECK(station::Operators(context.env, operators_file()).disable(options.name));
  Json json = document("operator");
  json["name"] = options.name;
  return print_answer(context, options.json, json,
                      fmt::format("{} is no operator any more\n", printable(options.name)));
}

Status list(const OperatorCommandOptions& options, Context& context) {
  SIXPOINT_ASSIGN(const auto operators, station::Operators(context.env, operators_file()).list());
  Json json = document("operator");
  json["operators"] = Json::array();
  std::string text;
  for (const station::Operator& each : operators) {
    json["operators"].push_back({{"name", each.name}, {"role", to_string(each.role)}});
    text += fmt::format("{}: {}\n", printable(each.name), to_string(each.role));
  }
  return print_answer(context, options.json, json,
                      text.empty() ? "none: names are as they are typed\n" : text);
}

}  // namespace

std::string operators_file() { return data_folder() + "/operators.json"; }

Status sign_off(Context& context, const std::string& name) {
  station::Operators operators(context.env, operators_file());
  SIXPOINT_ASSIGN(const auto all, operators.list());
  if (all.empty()) {
    return {};
  }
  SIXPOINT_CHECK(operators.sign_in("here", name, read_pin(context, name)));
  SIXPOINT_CHECK(operators.who("here", name, station::OperatorRole::engineer));
  return {};
}

Result<station::SignedName> who_measures(Context& context, const std::string& name,
                                         const std::string& pin_file) {
  station::Operators operators(context.env, operators_file());
  SIXPOINT_ASSIGN(const auto all, operators.list());
  if (all.empty()) {
    return station::SignedName{name, false};
  }
  if (name.empty()) {
    return fail(ErrorCode::permission, "this machine has operators", "--operator",
                "name the one who measures; the PIN is asked for");
  }
  std::string pin;
  if (pin_file.empty()) {
    pin = read_pin(context, name);
  } else {
    constexpr std::uint64_t kMostFile_bytes = 4096;
    SIXPOINT_ASSIGN(const Bytes text, read_file(context.env.files, pin_file, kMostFile_bytes));
    pin.assign(text.begin(), std::find_if(text.begin(), text.end(),
                                          [](auto c) { return c == '\r' || c == '\n'; }));
  }
  SIXPOINT_CHECK(operators.sign_in("here", name, pin));
  return operators.who("here", name, station::OperatorRole::technician);
}

void add_operator(CLI::App& app, Context& context) {
  CLI::App& group =
      add_group(app, "operator", "who works at the stations of this machine, with a PIN each");
  const auto named = [&](const char* command, const char* about,
                         Status (*work)(const OperatorCommandOptions&, Context&)) {
    auto declared =
        add_command<OperatorCommandOptions>(group, context, "operator", command, about, work);
    declared.command.add_option("NAME", declared.options.name, "as it stands in the records")
        ->required();
    return declared;
  };
  auto added =
      named("add", "a new operator, or a new role and PIN; the PIN is read from stdin", add);
  added.command.add_option("--role", added.options.role,
                           "technician, or engineer: signs too (default: as before; technician "
                           "for a new one)");
  named("disable", "this operator may not sign in any more", disable);
  add_command<OperatorCommandOptions>(group, context, "operator", "list", "names and roles", list);
}

}  // namespace sixpoint::cli
