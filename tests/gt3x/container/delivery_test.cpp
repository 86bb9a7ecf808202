#include "gt3x/container/delivery.h"

#include <gmock/gmock.h>

namespace sixpoint::gt3x {
namespace {

using testing::HasSubstr;
using testing::Not;

struct DeliveryRow {
  Damage damage;
  Delivery without;
  Delivery with;
};

TEST(Delivery, FollowsTheTable) {
  using enum Delivery;
  const DeliveryRow kRows[] = {{Damage::none, all, all},
                               {Damage::wrong_crc, nothing, what_is_left},
                               {Damage::no_crc, nothing, what_is_left},
                               {Damage::wrong_length, nothing, what_is_left},
                               {Damage::broken_stream, nothing, what_is_left},
                               {Damage::lost_entry, nothing, what_is_left},
                               {Damage::no_directory, nothing, what_is_left},
                               {Damage::no_info, nothing, what_is_left},
                               {Damage::no_samples, nothing, nothing},
                               {Damage::refused, nothing, nothing}};
  for (const DeliveryRow& row : kRows) {
    EXPECT_EQ(what_may_be_delivered(row.damage, false), row.without) << to_string(row.damage);
    EXPECT_EQ(what_may_be_delivered(row.damage, true), row.with) << to_string(row.damage);
    if (row.with == what_is_left) {
      EXPECT_THAT(hint_about(row.damage), HasSubstr("--salvage"));
    } else {
      EXPECT_THAT(hint_about(row.damage), Not(HasSubstr("--salvage")));
    }
  }
}

}  // namespace
}  // namespace sixpoint::gt3x
