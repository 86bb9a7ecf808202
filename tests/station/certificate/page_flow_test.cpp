// Oracle: where poppler finds the words of the document, against the lengths of page_flow.h.
#include "station/certificate/page_flow.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "expect_result.h"
#include "station/certificate/poppler.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

using testing::ElementsAre;

constexpr UtcTime kMade{std::chrono::sys_days{std::chrono::year{2026} / 3 / 4}};
constexpr double kFooterRule_mm = 279;  // the body ends above it

PageFlow flow_of(std::size_t pages, std::string footer = "FooterOne") {
  auto pdf = new_pdf_document("Title", kMade);
  EXPECT_OK(pdf);
  return {*std::move(pdf), std::move(footer), "FooterTwo", pages};
}

struct Word {
  std::string text;
  std::size_t page = 0;  // from 1
  double left_mm = 0;
  double right_mm = 0;
  double bottom_mm = 0;  // below the baseline by the font's descent
};

std::vector<Word> words_of(PageFlow& flow) {
  constexpr double kMmPerPoint = 25.4 / 72;
  const auto bytes = flow.bytes();
  EXPECT_OK(bytes);
  const tests::TemporaryFolder folder;
  std::ofstream(folder / "a.pdf", std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes->data()),
             static_cast<std::streamsize>(bytes->size()));
  std::istringstream lines(output_of("pdftotext -bbox " + (folder / "a.pdf") + " -"));
  std::vector<Word> words;
  std::size_t page = 0;
  for (std::string line; std::getline(lines, line);) {
    page += line.find("<page ") != std::string::npos ? 1 : 0;
    std::array<double, 4> box{};
    const std::size_t at = line.find("<word ");
    if (at != std::string::npos &&
        std::sscanf(line.c_str() + at, R"(<word xMin="%lf" yMin="%lf" xMax="%lf" yMax="%lf")",
                    &box[0], &box[1], &box[2], &box[3]) == 4) {
      const std::size_t from = line.find('>', at) + 1;
      words.push_back({line.substr(from, line.find('<', from) - from), page, box[0] * kMmPerPoint,
                       box[2] * kMmPerPoint, box[3] * kMmPerPoint});
    }
  }
  return words;
}

// The only word of this text.
Word word(const std::vector<Word>& words, const std::string& text) {
  const auto is_it = [&](const Word& one) { return one.text == text; };
  EXPECT_EQ(std::ranges::count_if(words, is_it), 1) << text;
  const auto found = std::ranges::find_if(words, is_it);
  return found == words.end() ? Word{} : *found;
}

std::vector<std::size_t> pages_with(const std::vector<Word>& words, const std::string& text) {
  std::vector<std::size_t> pages;
  for (const Word& one : words) {
    if (one.text == text) {
      pages.push_back(one.page);
    }
  }
  return pages;
}

TEST(PageFlow, NeedBeginsAPageWhereLessIsLeft) {
  PageFlow flow = flow_of(2);
  EXPECT_EQ(flow.pages(), 1U);
  EXPECT_FALSE(flow.need(200));
  EXPECT_FALSE(flow.need(200)) << "asking takes no room";
  EXPECT_EQ(flow.pages(), 1U);
  EXPECT_TRUE(flow.need(PdfDocument::kHeight_mm)) << "more than a page has";
  EXPECT_EQ(flow.pages(), 2U);
}

TEST(PageFlow, EveryPageHasItsFooterAndNumber) {
  NEEDS_TOOLS();
  PageFlow flow = flow_of(3);
  for (int i = 0; i < 300 && flow.pages() < 3; ++i) {
    flow.paragraph("body");
  }
  ASSERT_EQ(flow.pages(), 3U);
  const std::vector<Word> words = words_of(flow);
  EXPECT_THAT(pages_with(words, "FooterOne"), ElementsAre(1, 2, 3));
  EXPECT_THAT(pages_with(words, "FooterTwo"), ElementsAre(1, 2, 3));
  EXPECT_THAT(pages_with(words, "Page"), ElementsAre(1, 2, 3));
  for (const Word& one : words) {
    if (one.text == "body") {
      EXPECT_LT(one.bottom_mm, kFooterRule_mm);
      EXPECT_GT(one.bottom_mm, kTop_mm);
    } else {
      EXPECT_GT(one.bottom_mm, kFooterRule_mm) << one.text;
    }
  }
  // "Page 1 of 3": its last word ends at the right margin.
  EXPECT_NEAR(std::ranges::max(words, {}, &Word::right_mm).right_mm, kRight_mm, 0.3);
}

TEST(PageFlow, AFooterTooLongForItsLineIsCut) {
  NEEDS_TOOLS();
  std::string footer = "begin";
  for (int i = 0; i < 100; ++i) {
    footer += " certificate";
  }
  PageFlow flow = flow_of(1, footer + " end");
  const std::vector<Word> words = words_of(flow);
  EXPECT_THAT(pages_with(words, "begin"), ElementsAre(1));
  EXPECT_THAT(pages_with(words, "end"), ElementsAre());
  for (const Word& one : words) {
    if (one.text == "certificate") {
      EXPECT_LT(one.right_mm, word(words, "Page").left_mm);
      EXPECT_NEAR(one.bottom_mm, word(words, "begin").bottom_mm, 0.01);
    }
  }
}

TEST(PageFlow, CutKeepsTheFirstLine) {
  PageFlow flow = flow_of(1);
  EXPECT_EQ(flow.cut("short", 50, kBody), "short");
  EXPECT_EQ(flow.cut("", 50, kBody), "");
  const std::string many = "one two three four five six seven eight nine ten";
  const std::string cut = flow.cut(many, 30, kBody);
  EXPECT_TRUE(many.starts_with(cut)) << cut;
  EXPECT_TRUE(cut.starts_with("one two")) << cut;
  EXPECT_LT(cut.size(), many.size());
}

TEST(PageFlow, AParagraphKeepsAllWordsInOrderBetweenTheMargins) {
  NEEDS_TOOLS();
  PageFlow flow = flow_of(0);
  std::string text;
  std::vector<std::string> given;
  for (int i = 0; i < 2000; ++i) {
    given.push_back(fmt::format("w{}", i));
    text += (i > 0 ? " " : "") + given.back();
  }
  flow.paragraph(text);
  EXPECT_GT(flow.pages(), 1U);
  std::vector<std::string> read;
  for (const Word& one : words_of(flow)) {
    if (one.text.starts_with("w")) {
      read.push_back(one.text);
      EXPECT_GT(one.left_mm, kLeft_mm - 0.3);
      EXPECT_LT(one.right_mm, kRight_mm + 0.3);
      EXPECT_LT(one.bottom_mm, kFooterRule_mm);
    }
  }
  EXPECT_EQ(read, given);
}

// The heading is never the last thing on a page.
TEST(PageFlow, ASectionStandsOnThePageOfWhatBelongsToIt) {
  NEEDS_TOOLS();
  constexpr double kBelow_mm = 60;
  for (int before = 40; before < 75; before += 5) {
    PageFlow flow = flow_of(2);
    for (int i = 0; i < before; ++i) {
      flow.paragraph("body");
    }
    flow.section("Heading", kBelow_mm);
    EXPECT_FALSE(flow.need(kBelow_mm)) << before;
    flow.paragraph("below");
    const std::vector<Word> words = words_of(flow);
    EXPECT_EQ(word(words, "Heading").page, word(words, "below").page) << before;
    EXPECT_LT(word(words, "Heading").bottom_mm, word(words, "below").bottom_mm) << before;
  }
}

TEST(PageFlow, ARowOfTheGridIsAsHighAsTheLongerOfItsValues) {
  NEEDS_TOOLS();
  PageFlow flow = flow_of(1);
  const std::string three_lines = "wwwwwwwwwwwwwwwwwwww wwwwwwwwwwwwwwwwwwwx wwwwwwwwwwwwwwwwwwwy";
  flow.grid({{{{"k1", "v1"}, {"k2", "v2"}}},
             {{{"k3", "v3"}, {"k4", three_lines}}},
             {{{"k5", "v5"}, {"k6", "v6"}}}});
  const std::vector<Word> words = words_of(flow);
  const auto y = [&](const char* text) { return word(words, text).bottom_mm; };
  const auto x = [&](const char* text) { return word(words, text).left_mm; };
  for (const auto& row : {std::array{"k1", "v1", "k2", "v2"}, std::array{"k5", "v5", "k6", "v6"}}) {
    for (const char* cell : row) {
      EXPECT_NEAR(y(cell), y(row[0]), 0.01) << cell;
    }
    EXPECT_NEAR(x(row[0]), kLeft_mm, 0.3);
    EXPECT_LT(x(row[1]), x(row[2]));
    EXPECT_NEAR(x(row[3]) - x(row[2]), x(row[1]) - x(row[0]), 0.3) << "both halves are alike";
  }
  EXPECT_NEAR(y("wwwwwwwwwwwwwwwwwwwy") - y("k4"), 2 * kLine_mm, 0.01);
  EXPECT_NEAR(y("k5") - y("k3"), (y("k3") - y("k1")) + 2 * kLine_mm, 0.01);
}

TEST(PageFlow, TheHeadOfATableIsRepeatedOnEveryPage) {
  NEEDS_TOOLS();
  PageFlow flow = flow_of(0);
  std::vector<Row> rows;
  for (int i = 0; i < 150; ++i) {
    rows.push_back({fmt::format("r{}", i), "9.81"});
  }
  flow.table({{"Name", 40, Align::left}, {"Value", 30}}, rows);
  ASSERT_EQ(flow.pages(), 3U) << "about sixty rows of 4.2 mm on 254 mm";
  const std::vector<Word> words = words_of(flow);
  EXPECT_THAT(pages_with(words, "Name"), ElementsAre(1, 2, 3));
  for (const Word& one : words) {
    if (one.text.starts_with("r")) {
      EXPECT_LT(one.bottom_mm, kFooterRule_mm) << one.text;
    }
  }
  for (const Row& row : rows) {
    EXPECT_GT(word(words, row[0]).bottom_mm, std::ranges::find_if(words, [&](const Word& one) {
                                               return one.text == "Name" &&
                                                      one.page == word(words, row[0]).page;
                                             })->bottom_mm);
  }
}

// Left columns begin together; right ones end together, within the width that was given.
TEST(PageFlow, TheCellsOfAColumnStandUnderItsHead) {
  NEEDS_TOOLS();
  PageFlow flow = flow_of(1);
  flow.table({{"Left", 50, Align::left}, {"Right", 40}}, {{"ab", "12345"}, {"abcdef", "7"}});
  const std::vector<Word> words = words_of(flow);
  for (const char* text : {"Left", "ab", "abcdef"}) {
    EXPECT_NEAR(word(words, text).left_mm, kLeft_mm + 1, 0.5) << text;
  }
  for (const char* text : {"Right", "12345", "7"}) {
    EXPECT_NEAR(word(words, text).right_mm, kLeft_mm + 90 - 1, 0.5) << text;
  }
}

TEST(PageFlow, TheHeadsOfATableStandAtTheBottomOfTheirLines) {
  NEEDS_TOOLS();
  PageFlow flow = flow_of(1);
  flow.table({{"First Second", 12, Align::left}, {"Short", 40}}, {{"a", "b"}});
  const std::vector<Word> words = words_of(flow);
  EXPECT_LT(word(words, "First").bottom_mm, word(words, "Second").bottom_mm);
  EXPECT_NEAR(word(words, "Short").bottom_mm, word(words, "Second").bottom_mm, 0.01);
}

}  // namespace
}  // namespace sixpoint::station
