#include "repair/archive/link_unaffected.h"

#include "base/atomic_file.h"

namespace sixpoint::repair {

bool is_linked(const RepairReport& report) {
  return report.output.empty() && (report.status == RepairStatus::not_affected ||
                                   report.status == RepairStatus::already_repaired);
}

void link_unaffected(FileSystem& files, const LinkMaker& make, LinkKind kind,
                     const std::string& output, RepairReport& report) {
  if (kind == LinkKind::none || report.dry_run || !is_linked(report)) {
    return;
  }
  Status status = make_synced_folders(files, folder_of(output));
  if (status) {
    status = make(report.input, output, kind);
  }
  if (status) {
    report.linked = output;
    return;
  }
  report.status = RepairStatus::failed;
  report.error = status.error();
  report.reasons.push_back(status.error().brief());
}

}  // namespace sixpoint::repair
