#include "station/printing/print_rule.h"

#include "station/certificate/certificate.h"

namespace sixpoint::station {

std::string why_no_label(const db::RunRecord& run, bool in_store) {
  if (const auto label = label_zpl(run); !label) {
    return label.error().what;
  }
  return in_store ? "" : "no label: the store does not have this run yet";
}

}  // namespace sixpoint::station
