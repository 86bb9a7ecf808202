// The page of a comparison.
#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "repair/compare/compare.h"
#include "repair/compare/made_trace.h"

namespace sixpoint::repair {
namespace {

using testing::HasSubstr;
using tests::recorded;

TEST(CompareHtml, PageIsWholeAndSafe) {
  const std::vector<Trace> traces = {recorded("<script>alert(1)</script>", {}, 300),
                                     recorded("b", {.lag_s = 0.5, .seed = 2}, 300)};
  const auto pair = compare(traces[0], traces[1]);
  ASSERT_OK(pair);
  const std::string page = compare_html(traces, {*pair});
  EXPECT_THAT(page, testing::Not(HasSubstr("<script")));
  EXPECT_THAT(page, testing::Not(HasSubstr("http")));
  EXPECT_THAT(page, HasSubstr("<svg"));
  EXPECT_THAT(page, HasSubstr("Histogram of errors"));
  EXPECT_TRUE(page.ends_with("</html>\n"));
  const auto json = pair->to_json();
  for (const char* key : {"a", "b", "lag_s", "rms_mg", "envelope_error_mg", "histogram"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
}

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

// The points of the n-th element that begins so, in the drawing's units.
std::vector<std::pair<double, double>> points_of(const std::string& page, const std::string& begin,
                                                 std::size_t number) {
  std::size_t at = page.find(begin);
  for (std::size_t i = 0; i < number && at != std::string::npos; ++i) {
    at = page.find(begin, at + 1);
  }
  std::vector<std::pair<double, double>> points;
  if (at == std::string::npos) {
    return points;
  }
  const std::string key = "points=";
  const std::size_t from = page.find(key, at) + key.size() + 1;
  std::string list = page.substr(from, page.find_first_of("\"'", from) - from);
  std::replace(list.begin(), list.end(), ',', ' ');
  std::istringstream in(list);
  for (double x = 0, y = 0; in >> x >> y;) {
    points.emplace_back(x, y);
  }
  return points;
}

PairComparison made_pair() {
  PairComparison pair;
  pair.a = "a";
  pair.b = "b";
  pair.aligned = true;
  pair.lag_s = 0.5;
  pair.lag_uncertainty_s = 0.0125;
  pair.drift_ppm = -12.34;
  pair.overlap_s = 299.6;
  pair.rms_mg = 31.25;
  pair.envelope = {-1.5, 20.25, 44.75, 300};
  pair.histogram.edges_mg = {-100, -50, 0, 50, 100};
  pair.histogram.counts = {1, 4, 2, 1};
  pair.remarks = {"moved <little>"};
  return pair;
}

TEST(CompareHtml, ALagOfNothingHasNoSign) {
  PairComparison pair = made_pair();
  for (const double lag_s : {-0.00001, 0.00001, 0.0}) {
    pair.lag_s = lag_s;
    EXPECT_THAT(pair.brief(), HasSubstr("lag 0.0000 s"));
  }
  pair.lag_s = -0.5173;
  EXPECT_THAT(pair.brief(), HasSubstr("lag -0.5173 s"));
}

// Ten seconds at 1 g; then a step to 2 g.
Trace made_trace(const std::string& name, double start_s) {
  std::vector<float> magnitudes(600, 1.0F);
  std::fill(magnitudes.begin() + 300, magnitudes.end(), 2.0F);
  return Trace::from_magnitudes(name, start_s, 30, std::move(magnitudes));
}

// Oracle: the numbers of made_pair(), rounded by hand.
TEST(CompareHtml, APairsNumbersStandInItsHeadline) {
  const std::string page =
      compare_html({made_trace("a", 1000), made_trace("b", 1000.5)}, {made_pair()});
  EXPECT_THAT(page, HasSubstr("Lag 0.5000 s (&plusmn; 0.0125), drift -12.3 ppm, 300 s in common"));
  EXPECT_THAT(page, HasSubstr("RMS 31.2 mg"));  // halves to even
  EXPECT_THAT(page, HasSubstr("mean -1.5 mg, standard deviation 20.2 mg, 95 % within 44.8 mg"));
  EXPECT_THAT(page, HasSubstr("<p>moved &lt;little&gt;</p>"));
}

// Oracle: the histogram's counts by hand: the highest bar fills the height of 220, one with a count
// of one a quarter of it.
TEST(CompareHtml, TheBarsOfTheHistogramAreAsHighAsTheirCounts) {
  const std::string page =
      compare_html({made_trace("a", 1000), made_trace("b", 1000.5)}, {made_pair()});
  std::vector<double> heights;
  for (std::size_t at = page.find("fill=\"#555\""); at != std::string::npos;
       at = page.find("fill=\"#555\"", at + 1)) {
    const std::size_t begin = page.rfind("height=", at) + 8;
    heights.push_back(std::stod(page.substr(begin)));
  }
  ASSERT_EQ(heights.size(), 4U);
  EXPECT_NEAR(heights[0], 55, 0.1);
  EXPECT_NEAR(heights[1], 220, 0.1);
  EXPECT_NEAR(heights[2], 110, 0.1);
  EXPECT_NEAR(heights[3], 55, 0.1);
}

// Oracle: the step itself. B's clock shows half a second more: with its lag taken away, both steps
// are drawn at the same place; without, half a second apart. Ten seconds are 834 units wide.
TEST(CompareHtml, TheSecondRecordingIsDrawnWithItsLagTakenAway) {
  const auto step_of = [](const std::string& page, std::size_t number) {
    const auto points = points_of(page, "<polyline", number);
    for (std::size_t i = 1; i < points.size(); ++i) {
      if (points[i].second < points[i - 1].second - 1) {
        return points[i].first;
      }
    }
    return std::nan("");
  };
  const std::vector<Trace> traces = {made_trace("a", 1000), made_trace("b", 1000.5)};
  constexpr double kUnitsPerSecond = 83.4;
  const std::string page = compare_html(traces, {made_pair()});
  EXPECT_NEAR(step_of(page, 1), step_of(page, 0), kUnitsPerSecond / 30 + 0.1) << "one sample";
  PairComparison unaligned = made_pair();
  unaligned.lag_s = 0;
  unaligned.drift_ppm = 0;
  const std::string late = compare_html(traces, {unaligned});
  EXPECT_NEAR(step_of(late, 1) - step_of(late, 0), kUnitsPerSecond / 2, kUnitsPerSecond / 30 + 0.1);
}

// A pair is drawn where both of its recordings are there.
TEST(CompareHtml, APairWithoutItsRecordingsIsLeftOut) {
  const std::string page = compare_html({made_trace("a", 1000)}, {made_pair()});
  EXPECT_EQ(count_of(page, "<h2>"), 0U);
  EXPECT_TRUE(page.ends_with("</html>\n"));
  const std::string two =
      compare_html({made_trace("a", 1000), made_trace("b", 1000.5)}, {made_pair(), made_pair()});
  EXPECT_EQ(count_of(two, "<h2>"), 2U);
  EXPECT_EQ(count_of(two, "<svg"), 6U) << "three drawings each";
}

}  // namespace
}  // namespace sixpoint::repair
