// The motorised jig and the unit without commands, through the program.
#include <fstream>

#include <gmock/gmock.h>

#include "cli/command_fixture.h"
#include "expect_result.h"
#include "mocks/firmware/virtual_drive.h"

namespace sixpoint::cli {
namespace {

using testing::Contains;
using testing::HasSubstr;

constexpr const char* kOtherUnit = "virtual:seed=7,true_sensitivity_lsb_per_g=237.7/251.8/242.3";

class OtherDevices : public tests::CommandTest {
 protected:
  tests::Answer jig(const std::string& jig) {
    return run({"jig", "--device", kOtherUnit, "--jig", jig, "--store", path("s.db"), "--json"});
  }
};

// Oracle: the sensor that the device string names.
TEST_F(OtherDevices, AMotorisedJigMeasuresAUnit) {
  const auto answer = jig("virtual:serial=J600042");
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  EXPECT_EQ(answer.json()["jig"], "SixJig J600042");
  const double sensitivity[] = {237.7, 251.8, 242.3};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    EXPECT_NEAR(1 / answer.json()["constants"]["sensitivity_g_per_lsb"][axis].get<double>(),
                sensitivity[axis], 0.3);
  }
}

TEST_F(OtherDevices, AJigsFaultEndsTheRunWithItsReason) {
  for (const auto& [fault, reason] : std::vector<std::pair<std::string, std::string>>{
           {"overcurrent", "draws too much current"},
           {"encoder", "encoder contradicts itself"},
           {"obstructed", "something is in the way"},
           {"door_open", "the door is open"},
           {"not_homed", "does not know where it stands"},
           {"supply_low", "supply voltage"}}) {
    const auto answer = jig("virtual:fault_at=4,fault=" + fault);
    EXPECT_EQ(answer.exit_code, 69) << fault;
    EXPECT_THAT(answer.people, HasSubstr(reason));
    EXPECT_EQ(answer.json()["verdict"], "inconclusive");
    EXPECT_EQ(answer.json()["poses"].size(), 3U) << "what was measured is kept";
    EXPECT_TRUE(answer.json()["stored_id"].is_null());
  }
}

TEST_F(OtherDevices, AStoppedJigTurnsAfterTheOperatorsWordOnly) {
  const auto pressed = jig("virtual:stop_at=3");
  EXPECT_EQ(pressed.exit_code, 69);
  EXPECT_THAT(pressed.people, HasSubstr("emergency stop"));
  EXPECT_EQ(pressed.json()["poses"].size(), 2U) << "what was measured is kept";
  EXPECT_EQ(pressed.json()["codes"], cli::Json::array({"interrupted"})) << "the unit is there";
  const auto held = jig("virtual:stopped=1");
  EXPECT_EQ(held.exit_code, 69);
  EXPECT_THAT(held.people, HasSubstr("--jig-is-free"));
  const auto freed = run({"jig", "--device", kOtherUnit, "--jig", "virtual:stopped=1",
                          "--jig-is-free", "--store", path("s.db"), "--json"});
  EXPECT_EQ(freed.exit_code, 0) << freed.people;
}

TEST_F(OtherDevices, AJigThatLiesIsNoticed) {
  // The first face is the jig's word alone; the second placement tells.
  for (int turn = 1; turn <= 14; ++turn) {
    const auto elsewhere = jig("virtual:wrong_pose_at=" + std::to_string(turn));
    EXPECT_EQ(elsewhere.exit_code, 65) << turn;
    EXPECT_THAT(elsewhere.people, HasSubstr("the jig says it stands at")) << turn;
    EXPECT_TRUE(elsewhere.json()["stored_id"].is_null());
  }
  const auto crooked = jig("virtual:lie_deg=9");
  EXPECT_NE(crooked.exit_code, 0);
  EXPECT_THAT(crooked.people + crooked.out, HasSubstr("tilted"));
  EXPECT_TRUE(crooked.json()["stored_id"].is_null());
}

TEST_F(OtherDevices, AJigMustBeOneThatThereIs) {
  EXPECT_EQ(jig("robot").exit_code, 64);
  EXPECT_EQ(jig("virtual:colour=red").exit_code, 64);
  EXPECT_EQ(jig("hid:J9").exit_code, 69);
}

// Oracle: the virtual unit's sensor. Still blocks of a six-sided file: 2 mg.
TEST_F(OtherDevices, AUnitWithoutCommandsIsCalibratedByItsFile) {
  mocks::VirtualDriveOptions options;
  options.unit.truth = sim::draw_unit(7);
  ASSERT_OK(mocks::make_virtual_drive(posix_env().files, path("usb"), options));
  const auto answer = run({"capture", "--device", "drive:" + path("usb"), "--store", path("s.db"),
                           "-o", path("c.gt3x"), "--constants-out", path("c.json"), "--json"});
  EXPECT_EQ(answer.exit_code, 0) << answer.people;
  EXPECT_EQ(answer.json()["serial"], options.unit.truth.serial);
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    EXPECT_NEAR(answer.json()["constants"]["sensitivity_g_per_lsb"][axis].get<double>() *
                    options.unit.truth.current.sensitivity_lsb_per_g[axis],
                1, 3e-3);
    EXPECT_NEAR(answer.json()["constants"]["zero_lsb"][axis].get<double>(),
                options.unit.truth.current.zero_lsb[axis], 0.8);
  }
  EXPECT_TRUE(std::ifstream(path("c.json")).good());
  EXPECT_EQ(run({"solve", path("c.gt3x")}).exit_code, 0);

  const auto live = run({"jig", "--device", "drive:" + path("usb"), "--store", path("s.db")});
  EXPECT_EQ(live.exit_code, 64);
  EXPECT_THAT(live.people, HasSubstr("sixpoint capture"));
  EXPECT_EQ(run({"capture", "--device", "drive:" + path("no"), "--store", path("s.db")}).exit_code,
            66);
}

TEST_F(OtherDevices, AFileThatCannotHelpIsRefused) {
  mocks::VirtualDriveOptions options;
  sim::GivenProperties given;
  given.firmware = "1.8.0";
  options.unit.truth = sim::draw_unit(7, given);
  ASSERT_OK(mocks::make_virtual_drive(posix_env().files, path("usb"), options));
  const auto answer = run({"capture", "--device", "drive:" + path("usb"), "--store", path("s.db"),
                           "-o", path("c.gt3x"), "--json"});
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.json()["reasons"].dump(), HasSubstr("firmware from 1.4.0 to 1.7.0"));

  mocks::VirtualDriveOptions half;
  half.unit.truth = sim::draw_unit(7);
  half.sides = 3;
  ASSERT_OK(mocks::make_virtual_drive(posix_env().files, path("half"), half));
  const auto missing = run({"capture", "--device", "drive:" + path("half"), "--store", path("s.db"),
                            "-o", path("d.gt3x"), "--json"});
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_EQ(missing.json()["missing_directions"].size(), 3U);
}

}  // namespace
}  // namespace sixpoint::cli
