#include "mocks/firmware/page_memory.h"

#include <gtest/gtest.h>

#include "base/memory_env.h"
#include "device/unit.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"
#include "mocks/in_process/in_process.h"

namespace sixpoint::mocks {
namespace {

// Power fails before every single byte write in turn: the old page or the new one.
TEST(PageMemory, PowerLossLeavesOldOrNewNeverAMixture) {
  const Bytes old_page(device::kPageBytes, 0x11);
  const Bytes middle(device::kPageBytes, 0x22);
  const Bytes new_page(device::kPageBytes, 0x33);
  int olds = 0;
  int news = 0;
  for (std::uint64_t cut = 0; cut < 600; ++cut) {
    PageMemory memory(old_page);
    ASSERT_TRUE(memory.write(middle));  // both banks are used from here on
    memory.cut_power_after(cut);
    const bool done = memory.write(new_page);
    memory.restore_power();
    const auto page = memory.read();
    ASSERT_TRUE(page.has_value()) << cut;
    ASSERT_TRUE(*page == middle || *page == new_page) << "a mixture at " << cut;
    EXPECT_EQ(done, *page == new_page);
    (*page == new_page ? news : olds)++;
    // And the memory works on afterwards.
    EXPECT_TRUE(memory.write(old_page));
    EXPECT_EQ(*memory.read(), old_page);
  }
  EXPECT_EQ(olds, static_cast<int>(device::kPageBytes) + 8);
  EXPECT_GT(news, 0);
}

// The same through the whole protocol, and the station's error.
TEST(PageMemory, PowerLossDuringAWriteThroughTheProtocol) {
  const device::CalibrationPage wanted{{{300, 301, 302}, {-200, -201, -202}, {50, 51, 52}},
                                       from_unix_seconds(1'600'000'000)};
  for (std::uint64_t cut = 0; cut <= device::kPageBytes + 9; ++cut) {
    VirtualUnitOptions options;
    options.truth = sim::draw_unit(7);
    const auto clock = std::make_shared<ManualClock>();
    const auto plugged = std::make_shared<PluggedUnit>(options, clock);
    auto unit = *device::WireUnit::open(link_to(plugged, false));
    const auto before = *unit->read_calibration();
    plugged->unit.memory().cut_power_after(cut);
    const Status written = unit->write_calibration(wanted);
    plugged->unit.restore_power(clock->elapsed());
    const auto after = unit->read_calibration();
    ASSERT_OK(after);
    EXPECT_TRUE(*after == before || *after == wanted);
    EXPECT_EQ(written.has_value(), *after == wanted) << "the station knows at " << cut;
    EXPECT_EQ(written.has_value(), cut > 519);
  }
}

TEST(PageMemory, AWornCellIsSeen) {
  PageMemory memory(Bytes(device::kPageBytes, 0x11));
  memory.corrupt(300, 0x04);
  EXPECT_FALSE(memory.read().has_value());
}

}  // namespace
}  // namespace sixpoint::mocks
