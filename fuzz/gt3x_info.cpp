// info.txt: whatever is parsed is written back as it was, and every getter answers.
#include <cstdlib>

#include "gt3x/forms/info.h"
#include "gt3x/forms/model.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sixpoint;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  auto info = gt3x::Info::parse(text);
  if (!info) {
    return 0;
  }
  if (info->serialise() != text) {
    std::abort();
  }
  info->start();
  info->last_sample();
  info->sample_rate_hz();
  info->accel_scale_lsb_per_g();
  gt3x::model_of(info->serial());
  const std::string subject = info->subject();
  info->set("Serial Number", subject);
  // Line ends inside a value become blanks.
  if (subject.find('\r') == std::string::npos && info->serial() != subject) {
    std::abort();
  }
  return 0;
}
