#include "gt3x/gap_list.h"

namespace sixpoint::gt3x {

void GapList::add(const SampleItem& item) {
  const GapKind kind = item.kind == SampleItem::Kind::usb ? GapKind::usb : item.gap;
  seconds_ += item.seconds;
  if (!listed_.empty() && listed_.size() == count_) {
    Gap& last = listed_.back();
    if (last.kind == GapKind::usb && kind == GapKind::usb &&
        last.start + last.seconds == item.unix_time) {
      last.seconds += item.seconds;
      return;
    }
  }
  ++count_;
  if (listed_.size() < kMostListed) {
    listed_.push_back({item.unix_time, item.seconds, kind, item.filled});
  }
}

Result<GapList> gaps_of(SampleReader& reader) {
  GapList gaps;
  for (;;) {
    SIXPOINT_ASSIGN(const auto item, reader.next());
    if (!item) {
      return gaps;
    }
    if (item->kind != SampleItem::Kind::recorded) {
      gaps.add(*item);
    }
  }
}

}  // namespace sixpoint::gt3x
