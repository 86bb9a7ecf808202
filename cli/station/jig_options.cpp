#include "cli/station/jig_options.h"

#include "cli/command.h"
#include "cli/devices/known_devices.h"
#include "cli/station/record_option.h"
#include "cli/store_option.h"

namespace sixpoint::cli {

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

Result<JiggedUnit> open_unit(Context& context, const JigOptions& options, Outputs& outputs,
                             device::SessionRecorder& recorder) {
  SIXPOINT_CHECK(begin_session(outputs, recorder, options.record));
  JiggedUnit opened;
  SIXPOINT_ASSIGN(opened.unit, station::known_units().open(
                                   station::with_jig(options.device, options.jig), context.env,
                                   [&recorder](device::Link& link) { recorder.attach(link); }));
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
