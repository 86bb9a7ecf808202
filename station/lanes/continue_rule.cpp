#include "station/lanes/continue_rule.h"

#include <fmt/format.h>

#include "db/name_rule.h"

namespace sixpoint::station {

Result<bool> run_goes_on(const UnfinishedRun& left, const UnfinishedRun& now) {
  if (left.serial != now.serial || left.filter != now.filter || left.protocol != now.protocol) {
    return false;
  }
  const auto refuse = [&](const char* what, const std::string& began, const std::string& is_now,
                          const char* option) {
    return fail(
        ErrorCode::usage,
        fmt::format("the run of {} that was left was begun {} '{}', and this is '{}'",
                    printable(left.serial, 40), what, printable(began, 60), printable(is_now, 60)),
        option,
        fmt::format("{}, and the run goes on; or begin anew (--anew)",
                    began.empty() ? fmt::format("leave {} out, as when it was begun", option)
                                  : fmt::format("give {} as it was begun", option)));
  };
  if (left.jig_id && *left.jig_id != now.jig_id) {
    return refuse("on jig", *left.jig_id, now.jig_id.value_or(""), "--jig-id");
  }
  if (left.station != now.station) {
    return refuse("at station", left.station, now.station, "--station");
  }
  if (left.gravity_m_per_s2 && left.gravity_m_per_s2 != now.gravity_m_per_s2) {
    return refuse("with a gravity of", fmt::format("{} m/s2", *left.gravity_m_per_s2),
                  fmt::format("{} m/s2", now.gravity_m_per_s2.value_or(0)),
                  "--gravity or --latitude");
  }
  return true;
}

std::string both_names(const std::string& began, const std::string& ended) {
  if (ended.empty() || began == ended || began.ends_with(", then " + ended)) {
    return began;
  }
  std::string both = began.empty() ? ended : began + ", then " + ended;
  return db::check_name(both) ? both : ended;
}

}  // namespace sixpoint::station
