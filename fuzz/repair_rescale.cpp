// A log from survey to repair: what is written is a whole recording with the same samples in
// number, known as repaired, whose archive and checksums hold. With salvage, no damage is left in
// its log.
#include <cstdlib>

#include "base/memory_env.h"
#include "gt3x/recording_writer.h"
#include "repair/rescale/repair_file.h"
#include "repair/triage/survey.h"

namespace {

using namespace sixpoint;

class Fixed final : public repair::ConstantsSource {
 public:
  Result<repair::ConstantsChoice> choose(const std::string&, const repair::Survey&) override {
    repair::ChosenConstants chosen;
    chosen.record.serial = "MOS2A45130450";
    chosen.record.filter = calib::FilterConfiguration::current;
    chosen.record.calibration = {{0.0042, 0.004, 0.0041}, {90.5, 50.25, 88}};
    chosen.method = "constants";
    repair::ConstantsChoice choice;
    choice.chosen = chosen;
    return choice;
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  MemoryEnv memory;
  auto out = gt3x::RecordingWriter::create(memory.files, "in", {gt3x::Packing::store, 1});
  const std::string_view info =
      "Serial Number: MOS2A45130450\r\nFirmware: 1.5.0\r\nSample Rate: 30\r\n"
      "Start Date: 635641850400000000\r\nAcceleration Scale: 256.0\r\n";
  if (!out || !out->add("info.txt", info) || !out->add("log.bin", Bytes(data + 1, data + size)) ||
      !out->commit()) {
    std::abort();
  }
  Fixed source;
  repair::RepairOptions options;
  options.force = true;
  options.wide = (data[0] & 1U) != 0;
  options.salvage = (data[0] & 2U) != 0;
  const auto report = repair::repair_file(memory.env, "in", "out", source, options);
  if (report.output.empty()) {
    return 0;
  }
  const auto before = repair::survey(memory.files, "in");
  const auto after = repair::survey(memory.files, "out");
  if (!before || !after || after->samples != before->samples) {
    std::abort();
  }
  // With salvage a file is also written whole that is not repaired, and not called so.
  if (after->already_repaired != (report.status == repair::RepairStatus::repaired)) {
    std::abort();
  }
  if (options.salvage && after->log.checksum_failures + after->log.damaged_stretches > 0) {
    std::abort();
  }
  return 0;
}
