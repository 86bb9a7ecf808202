#include "lines_unit.h"

#include <memory>
#include <sstream>
#include <string>
#include <utility>

namespace example {

using namespace sixpoint;

namespace {

constexpr std::size_t kMostBytes = 64U << 20U;
constexpr int kSamplesInBlock = 32;

class LinesUnit final : public device::Unit {
 public:
  LinesUnit(std::string path, std::string text, Env& env)
      : address_("lines:" + std::move(path)), lines_(std::move(text)), env_(env) {
    identity_.serial = "LINES1";
    identity_.firmware = "1.0";
    identity_.model = "lines";
  }

  device::UnitAbilities abilities() const override { return {.streams = true}; }
  const device::Identity& identity() const override { return identity_; }
  Clock& clock() override { return env_.clock; }
  const std::string& address() const override { return address_; }
  Result<device::Identity> identify() override { return identity_; }
  Status reconnect(std::chrono::nanoseconds, const std::function<Status()>&) override {
    return gone();
  }
  void cancel() override {}

  Status start_stream(int) override { return {}; }  // the board has one rate
  Status stop_stream() override { return {}; }
  const device::StreamStatistics& stream_statistics() const override { return statistics_; }

  Result<std::optional<device::SampleBlock>> next_samples(std::chrono::nanoseconds) override {
    device::SampleBlock block;
    block.first_index = static_cast<std::uint32_t>(statistics_.samples);
    std::string line;
    while (block.counts.size() < kSamplesInBlock && std::getline(lines_, line)) {
      std::istringstream words(line);
      PerAxis<int> counts{};
      std::string more;
      if (!(words >> counts[0] >> counts[1] >> counts[2]) || words >> more) {
        return fail(ErrorCode::bad_data, "a line is not three counts", address_,
                    "look whether the board prints 'x y z'");
      }
      device::RawCounts raw{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (counts[axis] < -2048 || counts[axis] > 2047) {
          return fail(ErrorCode::bad_data, "a count needs more than 12 bits", address_,
                      "look whether the board prints raw counts");
        }
        raw[axis] = static_cast<std::int16_t>(counts[axis]);
      }
      block.counts.push_back(raw);
    }
    if (block.counts.empty()) {
      return tl::unexpected(gone().error());
    }
    statistics_.samples += block.counts.size();
    return block;
  }

 private:
  Status gone() const {
    return fail(ErrorCode::device_unavailable, "the board sends nothing more", address_,
                "connect it again");
  }

  std::string address_;
  std::istringstream lines_;
  Env& env_;
  device::Identity identity_;
  device::StreamStatistics statistics_;
};

}  // namespace

void register_lines(device::UnitRegistry& registry) {
  registry.add("lines", "lines:FILE",
               [](std::string_view rest, Env& env) -> Result<std::unique_ptr<device::Unit>> {
                 const std::string path(rest);
                 SIXPOINT_ASSIGN(const Bytes bytes, read_file(env.files, path, kMostBytes));
                 return std::make_unique<LinesUnit>(path, std::string(bytes.begin(), bytes.end()),
                                                    env);
               });
}

}  // namespace example
