#include "sim/bundle_writer.h"

#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "expect_result.h"
#include "gt3x/recording.h"
#include "gt3x/sample_reader.h"
#include "shared_data.h"

namespace sixpoint::sim {
namespace {

using Json = nlohmann::json;

std::string text_of(FileSystem& files, const std::string& path) {
  const auto bytes = read_file(files, path);
  EXPECT_OK(bytes);
  return bytes ? std::string(bytes->begin(), bytes->end()) : std::string();
}

struct Folder {
  std::map<std::string, std::string> text;
};

Folder write(const std::string& scenario) {
  MemoryEnv memory;
  const auto parsed = parse_scenario(scenario);
  EXPECT_OK(parsed);
  EXPECT_OK(write_bundle(memory.env.files, "/out/bundle", *parsed));
  Folder folder;
  for (const char* name :
       {"recording.gt3x", "protocol.json", "temperature.csv", "host_clock.csv"}) {
    folder.text[name] = text_of(memory.env.files, std::string("/out/bundle/") + name);
  }
  return folder;
}

std::set<std::string> keys(const Json& json) {
  std::set<std::string> names;
  for (const auto& [key, value] : json.items()) {
    names.insert(key + ":" + (value.is_number() ? "number" : value.type_name()));
  }
  return names;
}

TEST(BundleWriter, SameScenarioSameBytes) {
  const char* const scenario =
      R"({"seed": 9, "protocol": "production", "effects": [{"name": "flicker"}, {"name": "jitter"}]})";
  EXPECT_EQ(write(scenario).text, write(scenario).text);
  const auto other = write(
      R"({"seed": 10, "protocol": "production", "effects": [{"name": "flicker"}, {"name": "jitter"}]})");
  EXPECT_NE(write(scenario).text.at("recording.gt3x"), other.text.at("recording.gt3x"));
}

// Oracle: bundles of an independent writer.
TEST(BundleWriter, WritesWhatOtherStationsWrite) {
  SIXPOINT_NEED_SHARED("gap/practice/labels.json");
  for (const std::string protocol : {"production", "engineering"}) {
    const Folder folder = write(R"({"seed": 4, "protocol": ")" + protocol + "\"}");
    const std::string real = tests::shared_file("gap/practice/" + protocol + "/b0001/");
    std::ifstream file(real + "protocol.json");
    const Json theirs = Json::parse(file);
    const Json ours = Json::parse(folder.text.at("protocol.json"));
    EXPECT_EQ(keys(ours), keys(theirs));
    EXPECT_EQ(keys(ours["unit"]), keys(theirs["unit"]));
    EXPECT_EQ(ours["schema"], theirs["schema"]);
    ASSERT_EQ(ours["segments"].size(), theirs["segments"].size());
    for (std::size_t i = 0; i < ours["segments"].size(); ++i) {
      const Json& a = ours["segments"][i];
      const Json& b = theirs["segments"][i];
      EXPECT_EQ(keys(a), keys(b)) << i;
      for (const char* key : {"name", "kind", "first_sample", "samples", "temperature_c"}) {
        EXPECT_EQ(a[key], b[key]) << i << " " << key;
      }
      if (a.contains("vibration")) {
        EXPECT_EQ(a["vibration"], b["vibration"]) << i;
        EXPECT_EQ(a["rotation"], b["rotation"]) << i;
      }
      // Pauses between segments are drawn; they are of the same kind.
      if (i > 0) {
        const auto pause = [&](const Json& protocol_json) {
          const Json& now = protocol_json["segments"][i];
          const Json& before = protocol_json["segments"][i - 1];
          return now["host_start_s"].get<double>() - before["host_start_s"].get<double>() -
                 before["samples"].get<double>() / 100;
        };
        EXPECT_NEAR(pause(ours), pause(theirs), pause(theirs) + 0.001) << i;
      }
    }
    // The other files: same header, as many lines or nearly so.
    for (const char* name : {"temperature.csv", "host_clock.csv"}) {
      std::ifstream csv(real + name);
      std::stringstream whole;
      whole << csv.rdbuf();
      const std::string their_text = whole.str();
      const std::string& our_text = folder.text.at(name);
      EXPECT_EQ(our_text.substr(0, our_text.find('\n')),
                their_text.substr(0, their_text.find('\n')));
      const auto lines = [](const std::string& text) {
        return static_cast<double>(std::count(text.begin(), text.end(), '\n'));
      };
      EXPECT_NEAR(lines(our_text) / lines(their_text), 1, 0.15) << name;
    }
  }
}

TEST(BundleWriter, TheRecordingHoldsEverySegment) {
  MemoryEnv memory;
  const auto scenario = parse_scenario(R"({"seed": 2, "protocol": "production"})");
  ASSERT_OK(scenario);
  const auto report = write_bundle(memory.env.files, "/b", *scenario);
  ASSERT_OK(report);
  EXPECT_EQ(report->samples, 18'000U);
  EXPECT_EQ(report->segments, 18U);
  auto recording = gt3x::Recording::open(memory.env.files, "/b/recording.gt3x");
  ASSERT_OK(recording);
  gt3x::SampleReader samples(*recording);
  std::vector<gt3x::Counts> counts;
  for (;;) {
    const auto item = samples.next();
    ASSERT_OK(item);
    if (!*item) {
      break;
    }
    if ((*item)->kind == gt3x::SampleItem::Kind::recorded) {
      counts.insert(counts.end(), (*item)->counts.begin(), (*item)->counts.end());
    }
  }
  EXPECT_EQ(counts, *run_protocol(*scenario->protocol));
  EXPECT_FAILS(write_bundle(memory.env.files, "/c", Scenario{}), ErrorCode::usage);
}

// The scenario that a diagnosis proposes can name the very segments of the bundle.
TEST(BundleWriter, RepeatsTheSegmentsItIsGiven) {
  const Folder first = write(R"({"seed": 4, "protocol": "production"})");
  Json scenario;
  scenario["seed"] = 5;
  scenario["protocol"] = Json::parse(first.text.at("protocol.json"))["segments"];
  scenario["unit"] = {{"gain", {1.01, 0.99, 1}}, {"offset_g", {0.02, 0, -0.01}}};
  scenario["effects"] = {
      {{"name", "axis_rotation"}, {"parameters", {{"matrix", {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}}}}}};
  const Folder second = write(scenario.dump());
  const Json segments = Json::parse(second.text.at("protocol.json"))["segments"];
  EXPECT_EQ(segments, scenario["protocol"]);
}

TEST(BundleWriter, RefusesWhatMakesNoSense) {
  for (const char* text :
       {R"({"protocol": "sideways"})", R"({"protocol": []})", R"({"protocol": 3})",
        R"({"protocol": "production", "motions": [{"kind": "still"}]})",
        R"({"protocol": "production", "unit": {"sensor": {}}})",
        R"({"protocol": "production", "unit": {"gain": [1, 2]}})",
        R"({"protocol": "production", "temperature": [[1, 20], [1, 21]]})",
        R"({"protocol": [{"name": "a", "first_sample": 5, "samples": 100}]})",
        R"({"protocol": [{"name": "a", "samples": 99999999999}]})",
        R"({"protocol": [{"samples": 100, "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 2]]}]})",
        R"({"protocol": [{"samples": 100, "kind": "rolling"}]})",
        R"({"seating_sd_deg": 1, "motions": [{"kind": "still"}]})"}) {
    SCOPED_TRACE(text);
    EXPECT_FAILS(parse_scenario(text), ErrorCode::configuration);
  }
}

}  // namespace
}  // namespace sixpoint::sim
