// Every way to open a jig: "manual", or "SCHEME:REST" as devices are.
#pragma once

#include "device/jig.h"
#include "device/unit.h"

namespace sixpoint::device {

class JigRegistry {
 public:
  // `unit` is the one that will lie in the jig; a jig in software has to know it.
  using Opener =
      std::function<Result<std::unique_ptr<Jig>>(std::string_view rest, Env& env, Unit& unit)>;
  void add(std::string scheme, std::string example, Opener opener);
  // usage when the string names no known kind; device_unavailable and so on as its opener says.
  Result<std::unique_ptr<Jig>> open(std::string_view address, Env& env, Unit& unit) const;

 private:
  struct Entry {
    std::string example;
    Opener opener;
  };
  std::map<std::string, Entry, std::less<>> entries_;
};

// "hid:SERIAL" and "hid:" (the only one that is plugged in): a HidJig.
void register_hid_jig(JigRegistry& registry);

}  // namespace sixpoint::device
