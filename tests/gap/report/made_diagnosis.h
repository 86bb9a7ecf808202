// A diagnosis of a nominal unit under a serial number of its own.
#pragma once

#include <utility>

#include "expect_result.h"
#include "gap/judge/diagnose.h"
#include "gap/made_bundle.h"

namespace sixpoint::tests {

inline gap::Diagnosis diagnosed_as(const char* serial) {
  gap::Bundle bundle = tests::made_production({});
  bundle.protocol_serial = serial;
  auto d = gap::diagnose(bundle);
  EXPECT_OK(d);
  return *std::move(d);
}

}  // namespace sixpoint::tests
