// The USB tests over umockdev, and what only this carrier can do.
#include <gtest/gtest.h>

#include "expect_result.h"
#include "usb/bodies.h"
#include "usb/umockdev_bench.h"

namespace sixpoint::tests {
namespace {

class Umockdev : public testing::TestWithParam<UsbBody> {};

TEST_P(Umockdev, Body) {
  auto bus = mocks::UmockdevBus::make();
  ASSERT_OK(bus);
  UmockdevBench bench(std::move(*bus));
  GetParam().run(bench);
}

INSTANTIATE_TEST_SUITE_P(Usb, Umockdev, testing::ValuesIn(usb_bodies()),
                         [](const auto& one) { return std::string(one.param.name); });

}  // namespace
}  // namespace sixpoint::tests
