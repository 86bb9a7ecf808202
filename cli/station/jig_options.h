// The options that `sixpoint jig` and `sixpoint capture` share, and the unit and jig that they
// name.
//
//   add_jig_options(command, options);
//   Outputs outputs(context, options.outputs, options.json);
//   device::SessionRecorder recorder;
//   SIXPOINT_ASSIGN(const JiggedUnit opened, open_unit(context, options, outputs, recorder));
//   SIXPOINT_CHECK(station::run_jig(opened.on_jig(), context.env, session, hooks));
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "cli/context.h"
#include "cli/gravity_option.h"
#include "cli/output.h"
#include "device/session/session_recorder.h"
#include "mocks/in_process/virtual_hands.h"
#include "station/run/jig_session.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

struct JigOptions {
  std::string device;
  std::string jig;
  std::string record;
  std::string store;
  GravityOptions gravity;
  OutputOptions outputs;
  bool jig_is_free = false;
  bool json = false;
};
// --device, --jig, --jig-is-free, --store, --record, --force, and those of gravity
void add_jig_options(CLI::App& command, JigOptions& options);

struct JiggedUnit {
  std::unique_ptr<device::Unit> unit;
  // A virtual unit at a terminal, without a jig: the person turns it by words.
  std::unique_ptr<mocks::VirtualHands> hands;
  std::unique_ptr<device::Jig> own_jig;  // where the jig is not part of the unit
  device::Jig* jig = nullptr;
  station::UnitOnJig on_jig() const { return {unit.get(), jig}; }
};
// Said to a person who has the hands of a virtual unit.
inline constexpr std::string_view kWordsForHands =
    "you turn the virtual unit: +z and Enter lays it with its z axis up, -x with x down ...; "
    "knock; swap\n";
// The files that the address of a device names are read, and never written over: those of
// drive:FOLDER, faults=FILE of a virtual unit, replay:FILE. Before the command's outputs are looked
// at.
Status read_for_device(const std::string& device, Outputs& outputs);

// Begins the session that `--record` names, and opens unit and jig. device_unavailable where a
// motorised jig is stopped or faulty; with --jig-is-free, the operator's word, it is released.
Result<JiggedUnit> open_unit(Context& context, const JigOptions& options, Outputs& outputs,
                             device::SessionRecorder& recorder);

// What a person typed in a run or a capture.
//
// | line          | word  | in a capture, which waits for an answer                            |
// |---------------|-------|--------------------------------------------------------------------|
// | empty         | empty | the unit lies on the side that was asked for                       |
// | s, q, stop    | stop  | the capture stops; so it does where the input ends                 |
// | any other     | other | for the hands of a virtual unit, where it has some; asked again    |
enum class PromptWord { empty, stop, other };
PromptWord prompt_word(std::string_view line);

}  // namespace sixpoint::cli
