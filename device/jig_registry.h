// Every way to open a jig that is not "manual": an address "SCHEME:REST".
//
//   device::JigRegistry jigs;
//   device::register_hid_jig(jigs);  // jigs/hid_jig.h
//   Result<std::unique_ptr<device::Jig>> jig = jigs.open("hid:J600001", env, unit);
#pragma once

#include <functional>
#include <memory>

#include "device/jig.h"
#include "device/scheme_table.h"
#include "device/unit.h"

namespace sixpoint::device {

class JigRegistry {
 public:
  // `unit` lies in the jig; a jig in software has to know it.
  using Opener =
      std::function<Result<std::unique_ptr<Jig>>(std::string_view rest, Env& env, Unit& unit)>;
  void add(std::string scheme, std::string example, Opener opener) {
    openers_.add(std::move(scheme), std::move(example), std::move(opener));
  }
  // usage when the address has no known scheme; else the errors of its opener.
  Result<std::unique_ptr<Jig>> open(std::string_view address, Env& env, Unit& unit) const;

 private:
  SchemeTable<Opener> openers_;
};

}  // namespace sixpoint::device
