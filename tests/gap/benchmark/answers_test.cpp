#include "gap/benchmark/answers.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "expect_result.h"

namespace sixpoint::gap {
namespace {

class Answers : public ::testing::Test {
 protected:
  Result<std::vector<Answer>> read(const std::string& lines) {
    EXPECT_OK(write_file(env_.env.files, "answers.jsonl", lines));
    return read_answers(env_.env.files, "answers.jsonl");
  }
  MemoryEnv env_;
};

constexpr const char* kUnknown = R"("unknown": {"present": false, "probability": 0.1})";

std::string line(const std::string& effects, const std::string& unknown = kUnknown) {
  return R"({"bundle": "b1", "effects": )" + effects + ", " + unknown + "}\n";
}

TEST_F(Answers, TheSmallestForm) {
  const auto answers = read(line(R"([{"name": "tilt", "probability": 0.9}])"));
  ASSERT_OK(answers);
  ASSERT_EQ(answers->size(), 1U);
  const Answer& answer = answers->front();
  EXPECT_EQ(answer.bundle, "b1");
  EXPECT_EQ(answer.effects, (std::vector<std::pair<std::string, double>>{{"tilt", 0.9}}));
  EXPECT_FALSE(answer.unknown);
  EXPECT_EQ(answer.unknown_probability, 0.1);
  EXPECT_FALSE(answer.where);
  EXPECT_OK(read(""));
}

TEST_F(Answers, WhereAndCandidatesComeBackAsWritten) {
  Answer answer;
  answer.bundle = "b7";
  answer.effects = {{"drift", 0.75}};
  answer.candidates = {{"drift", 0.75}, {"tilt", 0.125}};
  answer.unknown = true;
  answer.unknown_probability = 0.5;
  answer.where = {{0, "faces"}, {2, "ramp_up"}};
  const auto again = read(answer_line(answer) + "\n");
  ASSERT_OK(again);
  EXPECT_EQ(again->front().where, answer.where);
  EXPECT_EQ(again->front().candidates, answer.candidates);
  EXPECT_TRUE(again->front().unknown);
}

// Of a document of gap diagnose the places of the unknown count, not those of the whole gap.
TEST_F(Answers, PlacesOfTheUnknownOfADiagnosis) {
  const auto text = nlohmann::ordered_json::parse(
      R"({"effects": [], "unknown": {"present": true, "probability": 0.9, "where":
          [{"axis": "X", "segment": "faces", "factor": "pose"}], "why": ["it changes"]},
          "where": [{"axis": "Y", "segment": "faces", "sigma": 9.5}]})");
  const auto answer = parse_answer(text, "b1", "test");
  ASSERT_OK(answer);
  EXPECT_EQ(answer->where, (std::set<Place>{{0, "faces"}}));
  // JSON Lines: one object a line.
  EXPECT_FAILS(read(text.dump(1)), ErrorCode::bad_data);
}

TEST_F(Answers, HostileAnswersAreErrorsWithTheirLine) {
  const std::vector<std::string> bad = {
      "nonsense\n",
      "[]\n",
      R"({"bundle": 7, "effects": []})",
      R"({"effects": [], "unknown": {"present": true, "probability": 1}})",
      line("7"),
      line("[7]"),
      line(R"([{"probability": 0.9}])"),
      line(R"([{"name": "tilt"}])"),
      line(R"([{"name": "tilt", "probability": NaN}])"),
      line(R"([{"name": "tilt", "probability": 1e999}])"),
      line(R"([{"name": "tilt", "probability": "1"}])"),
      line(R"([{"name": "tilt", "probability": 1.5}])"),
      line(R"([{"name": "tilt", "probability": -0.1}])"),
      line(R"([{"name": "gremlins", "probability": 0.9}])"),
      line(R"([{"name": "tilt", "probability": 1}, {"name": "tilt", "probability": 1}])"),
      line("[]", R"("unknown": {"present": 1, "probability": 0.1})"),
      line("[]", R"("unknown": {"present": true})"),
      line("[]", R"("unknown": true)"),
      line("[]", R"("unknown": {"present": true, "probability": 1, "where": [{"axis": "W"}]})"),
      line("[]", R"("unknown": {"present": true, "probability": 1, "where": 3})"),
      line("[]", R"("unknown": {"present": true, "probability": 1, "where": ["in words"]})"),
      line("[]") + line("[]"),
      line("[" + std::string(100'000, '[')),
  };
  for (const std::string& text : bad) {
    EXPECT_FAILS(read(text), ErrorCode::bad_data);
  }
  EXPECT_EQ(read(line("[]") + "nonsense\n").error().where, "answers.jsonl, line 2");
}

TEST_F(Answers, AFolderOfDocumentsNamedByBundle) {
  FileSystem& files = env_.env.files;
  ASSERT_OK(files.make_folders("answers"));
  ASSERT_OK(write_file(files, "answers/b2.json", line("[]")));
  ASSERT_OK(write_file(files, "answers/b3.json", line("[]")));
  ASSERT_OK(write_file(files, "answers/notes.txt", "not read"));
  const auto answers = read_answers(files, "answers");
  ASSERT_OK(answers);
  ASSERT_EQ(answers->size(), 2U);
  EXPECT_EQ(answers->at(0).bundle, "b2");
  EXPECT_EQ(answers->at(1).bundle, "b3");
  ASSERT_OK(write_file(files, "answers/b4.json", "{"));
  EXPECT_FAILS(read_answers(files, "answers"), ErrorCode::bad_data);
  EXPECT_FAILS(read_answers(files, "nowhere"), ErrorCode::no_input);
}

}  // namespace
}  // namespace sixpoint::gap
