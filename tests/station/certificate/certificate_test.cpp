#include "station/certificate.h"

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "base/memory_env.h"
#include "expect_result.h"
#include "mocks/in_process.h"
#include "mocks/virtual_jig.h"
#include "run_command.h"
#include "skip_unless.h"
#include "station/jig_session.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string output_of(const std::string& command) {
  std::string text;
  FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) {
    return text;
  }
  std::array<char, 4096> buffer{};
  for (std::size_t got = 0; (got = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;) {
    text.append(buffer.data(), got);
  }
  ::pclose(pipe);
  return text;
}

bool has_tools() {
  return output_of("for tool in pdftotext pdftoppm zbarimg; do command -v $tool; done | wc -l")
      .starts_with("3");
}
#define NEEDS_TOOLS()                                                        \
  SIXPOINT_SKIP_UNLESS(has_tools(),                                          \
                       "pdftotext, pdftoppm or zbarimg is missing; install " \
                       "the Debian packages poppler-utils and zbar-tools")

// A run as the store would give it back, of a virtual unit.
db::RunRecord record_of(std::uint64_t seed, const JigSessionOptions& options,
                        const sim::UnitWishes& wishes = {}) {
  mocks::VirtualUnitOptions unit_options;
  unit_options.seed = seed;
  unit_options.truth = sim::draw_unit(seed, wishes);
  auto plugged =
      std::make_shared<mocks::PluggedUnit>(unit_options, std::make_shared<ManualClock>());
  mocks::VirtualJig jig(plugged);
  const auto unit = *device::Unit::open(mocks::link_to(plugged, false));
  MemoryEnv env;
  const auto report = run_jig(*unit, jig, env.env, options, {});
  db::RunRecord run;
  run.id = "0123456789abcdef0123456789abcdef";
  run.serial = report->serial;
  run.kind = "jig";
  run.filter = calib::to_string(report->filter);
  run.started = report->started;
  run.ended = report->ended;
  run.operator_name = "Ada Lovelace";
  run.station = "Bench 3";
  run.jig = "J-0042";
  run.jig_due = *parse_iso8601("2027-03-31");
  run.verdict = to_string(report->verdict);
  run.software = "sixpoint 9.9.9";
  run.document = report->to_json().dump();
  run.codes = report->codes;
  return run;
}

JigSessionOptions writing() {
  JigSessionOptions options;
  options.run.write = true;
  options.gravity = *calib::gravity_at(52.1, 40);
  return options;
}

class CertificatePdf : public testing::Test {
 protected:
  std::string text_of(const Certificate& certificate) {
    const auto bytes = certificate_pdf(certificate);
    EXPECT_OK(bytes);
    std::ofstream(folder_ / "c.pdf", std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes->data()),
               static_cast<std::streamsize>(bytes->size()));
    return output_of("pdftotext -layout " + (folder_ / "c.pdf") + " -");
  }
  tests::TemporaryFolder folder_;
};

// Oracle: poppler reads back what libharu wrote.
TEST_F(CertificatePdf, SaysWhatACalibrationCertificateSays) {
  NEEDS_TOOLS();
  const db::RunRecord run = record_of(7, writing());
  const auto certificate = certificate_of(run);
  ASSERT_OK(certificate);
  const std::string text = text_of(*certificate);
  for (const std::string& said :
       {run.serial, run.id, std::string("Ada Lovelace"), std::string("Bench 3"),
        std::string("J-0042"), std::string("2027-03-31"), std::string("sixpoint 9.9.9"),
        std::string("Date of calibration"), std::string("Date of issue"), std::string("As found"),
        std::string("As left"), std::string("coverage factor k = 2"), std::string("Local gravity"),
        std::string("ILAC-G8"), std::string("This is not an accredited calibration"),
        std::string("Page 1 of 2"), std::string("Page 2 of 2"), std::string("PASS"),
        default_limits().sha256}) {
    EXPECT_THAT(text, HasSubstr(said));
  }
  // The results as numbers, to the place that the uncertainty gives.
  std::smatch row;
  ASSERT_TRUE(std::regex_search(
      text, row,
      std::regex("\n *X +([0-9.]+) +\u00b1 ([0-9.]+) +((?:\u2013)?[0-9.]+) +\u00b1 ([0-9.]+)")))
      << text;
  EXPECT_NEAR(std::stod(row[1]), 1 / certificate->sensitivity_g_per_lsb[0], 0.006);
  EXPECT_NEAR(std::stod(row[4]), certificate->zero_expanded_mg[0], 0.006);
}

// Oracle: zbar reads the QR code off the page as a scanner would.
TEST_F(CertificatePdf, TheQrCodeHoldsSerialAndRun) {
  NEEDS_TOOLS();
  const db::RunRecord run = record_of(7, writing());
  text_of(*certificate_of(run));
  output_of("pdftoppm -r 150 -f 1 -l 1 -png " + (folder_ / "c.pdf") + " " + (folder_ / "p"));
  std::string picture;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    picture = entry.path().extension() == ".png" ? entry.path().string() : picture;
  }
  EXPECT_EQ(output_of("zbarimg --quiet --raw " + picture + " 2>/dev/null"),
            "sixpoint:" + run.serial + ":" + run.id + "\n");
}

// Every word's box as poppler sees it: within the page's margins, and none upon another.
TEST_F(CertificatePdf, LongNamesNeitherLeaveThePageNorOverlap) {
  NEEDS_TOOLS();
  db::RunRecord run = record_of(7, writing());
  Certificate certificate = *certificate_of(run);
  certificate.serial = std::string(70, 'W') + "-" + std::string(129, '8');
  certificate.operator_name =
      "Dr. Adelheid Wolfeschlegelsteinhausenbergerdorff und " + std::string(140, 'M');
  certificate.station = std::string(200, 'm');
  certificate.software = std::string(100, 'x') + " " + std::string(90, 'y');
  certificate.jig = std::string(200, '@');
  for (int i = 0; i < 12; ++i) {
    certificate.reasons.push_back("A long reason " + std::string(300, 'r') + " which goes on");
  }
  text_of(certificate);
  const std::string boxes = output_of("pdftotext -bbox " + (folder_ / "c.pdf") + " -");
  struct Word {
    double left, top, right, bottom;
    std::string text;
  };
  std::vector<Word> words;
  std::size_t seen = 0;
  const std::regex line(
      "<word xMin=\"([^\"]*)\" yMin=\"([^\"]*)\" xMax=\"([^\"]*)\" "
      "yMax=\"([^\"]*)\">(.*)</word>|(<page )");
  for (std::sregex_iterator at(boxes.begin(), boxes.end(), line), end; at != end; ++at) {
    if ((*at)[6].matched) {
      words.clear();
      continue;
    }
    const Word word{std::stod((*at)[1]), std::stod((*at)[2]), std::stod((*at)[3]),
                    std::stod((*at)[4]), (*at)[5]};
    ++seen;
    EXPECT_GE(word.left, 20 * 72 / 25.4 - 1) << word.text;
    EXPECT_LE(word.right, 190 * 72 / 25.4 + 1) << word.text;
    EXPECT_LE(word.bottom, 292 * 72 / 25.4) << word.text;
    for (const Word& other : words) {
      // The boxes hold the font's whole height, which lines may share a third of.
      const double shared_x = std::min(word.right, other.right) - std::max(word.left, other.left);
      const double shared_y = std::min(word.bottom, other.bottom) - std::max(word.top, other.top);
      EXPECT_FALSE(shared_x > 0.5 && shared_y > 0.35 * (word.bottom - word.top))
          << word.text << " upon " << other.text;
    }
    words.push_back(word);
  }
  EXPECT_GT(seen, 300U);
}

TEST_F(CertificatePdf, CharactersThatTheFontsLackAreNamed) {
  NEEDS_TOOLS();
  Certificate certificate = *certificate_of(record_of(7, writing()));
  certificate.operator_name = "J\u00f6rg \u0141ukasz \u2013 \u20ac";
  certificate.station = "caf\xff";
  const std::string text = text_of(certificate);
  EXPECT_THAT(text, HasSubstr("J\u00f6rg \\u{0141}ukasz \u2013 \u20ac"));
  EXPECT_THAT(text, HasSubstr("caf\\xff"));
}

TEST(Certificate, TheSameRunGivesTheSameBytes) {
  const db::RunRecord run = record_of(7, writing());
  EXPECT_EQ(*certificate_pdf(*certificate_of(run)), *certificate_pdf(*certificate_of(run)));
  EXPECT_EQ(certificate_of(run)->to_json(), certificate_of(run)->to_json());
  db::RunRecord other = run;
  other.operator_name = "Bo";
  EXPECT_NE(*certificate_pdf(*certificate_of(run)), *certificate_pdf(*certificate_of(other)));
}

TEST(Certificate, AFailedRunHasOneAndAStoppedOneHasNone) {
  JigSessionOptions options;
  options.limits = *parse_limits("[zero_offset_mg]\nlow = -1\nhigh = 1\n", "l");
  db::RunRecord run = record_of(7, options);
  ASSERT_EQ(run.verdict, "fail");
  const auto certificate = certificate_of(run);
  ASSERT_OK(certificate);
  EXPECT_EQ(certificate->to_json()["verdict"], "fail");
  EXPECT_FALSE(certificate->to_json()["accredited"].get<bool>());
  EXPECT_EQ(certificate->to_json()["decision_rule"]["limits_sha256"], options.limits.sha256);
  EXPECT_OK(certificate_pdf(*certificate));
  for (const char* verdict : {"stopped", "inconclusive", "nonsense", ""}) {
    run.verdict = verdict;
    EXPECT_FAILS(certificate_of(run), ErrorCode::bad_data);
  }
}

TEST(Certificate, ADocumentThatIsNoneIsRefused) {
  db::RunRecord run = record_of(7, writing());
  for (const char* document :
       {"", "{", "[]", "null", "{}", R"({"constants": {"zero_lsb": 3}})",
        R"({"constants": {"zero_lsb": [1,2,3]}, "quantities": {}, "verification": 7})"}) {
    run.document = document;
    EXPECT_FAILS(certificate_of(run), ErrorCode::bad_data);
  }
}

// --- the label ---

TEST(Label, AfterAReadBackOnly) {
  const db::RunRecord run = record_of(7, writing());
  const auto label = label_zpl(run);
  ASSERT_OK(label);
  EXPECT_THAT(*label, testing::StartsWith("^XA"));
  EXPECT_THAT(*label, testing::EndsWith("^XZ\n"));
  EXPECT_THAT(*label, HasSubstr("^FD" + run.serial + "^FS"));
  EXPECT_THAT(*label, HasSubstr("sixpoint:" + run.serial + ":" + run.id));
  EXPECT_EQ(*label, *label_zpl(run));

  EXPECT_FAILS(label_zpl(record_of(7, JigSessionOptions{})), ErrorCode::bad_data);  // not written

  db::RunRecord other = run;  // the unit answered something else
  auto document = nlohmann::ordered_json::parse(run.document);
  document["as_left"]["zero_lsb"][1] = document["as_left"]["zero_lsb"][1].get<int>() + 1;
  other.document = document.dump();
  EXPECT_FAILS(label_zpl(other), ErrorCode::bad_data);

  other = run;  // claimed to be written, but never read back
  document = nlohmann::ordered_json::parse(run.document);
  document["as_left"] = {{"written", true}};
  other.document = document.dump();
  EXPECT_FAILS(label_zpl(other), ErrorCode::bad_data);

  other = run;
  other.verdict = "fail";
  EXPECT_FAILS(label_zpl(other), ErrorCode::bad_data);
}

// A serial number cannot give the printer commands.
TEST(Label, WhatZplWouldTakeForACommandIsEscaped) {
  db::RunRecord run = record_of(7, writing());
  run.serial = "A^XZ~JA_\\B";
  const auto label = label_zpl(run);
  ASSERT_OK(label);
  EXPECT_THAT(*label, HasSubstr("^FDA_5EXZ_7EJA_5F_5CB^FS"));
  EXPECT_EQ(label->find("^XZ"), label->size() - 4);
  EXPECT_THAT(*label, Not(HasSubstr("~")));
}

// --- the commands ---

TEST(CertificateCommand, IsMadeAgainFromTheStoreByteByByte) {
  tests::TemporaryFolder folder;
  const auto run_command = [](const std::vector<std::string>& arguments) {
    return tests::run_command(posix_env(), arguments);
  };
  const auto bytes_of = [&](const std::string& name) {
    std::ifstream in(folder / name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  for (const std::string kind : {"pdf", "json"}) {
    const auto jig = run_command({"jig",
                                  "--device",
                                  "virtual:seed=7",
                                  "--jig",
                                  "virtual",
                                  "--store",
                                  folder / "s.db",
                                  "--operator",
                                  "Zo\u00eb",
                                  "--station",
                                  "A",
                                  "--jig-id",
                                  "J1",
                                  "--jig-due",
                                  "2099-01-01",
                                  "--write",
                                  "--certificate",
                                  folder / ("c." + kind),
                                  "--label",
                                  folder / ("l." + kind),
                                  "--json"});
    ASSERT_EQ(jig.exit_code, 0) << jig.people;
    EXPECT_EQ(jig.json()["certificate"], folder / ("c." + kind));
    EXPECT_EQ(jig.json()["label"], folder / ("l." + kind));
    const auto again =
        run_command({"certificate", jig.json()["run"], "--store", folder / "s.db", "-o",
                     folder / ("d." + kind), "--label", folder / ("m." + kind)});
    ASSERT_EQ(again.exit_code, 0) << again.people;
    ASSERT_GT(bytes_of("c." + kind).size(), 1000U);
    EXPECT_EQ(bytes_of("c." + kind), bytes_of("d." + kind));
    EXPECT_EQ(bytes_of("l." + kind), bytes_of("m." + kind));
  }
  EXPECT_EQ(run_command({"certificate", "none", "--store", folder / "s.db"}).exit_code, 66);
}

TEST(CertificateCommand, WhatCannotBeAskedIsRefusedBeforeTheRun) {
  tests::TemporaryFolder folder;
  const auto exit_code = [&](std::vector<std::string> more) {
    std::vector<std::string> arguments = {"jig",     "--device", "virtual:seed=7", "--jig",
                                          "virtual", "--store",  folder / "s.db"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return tests::run_command(posix_env(), arguments).exit_code;
  };
  EXPECT_EQ(exit_code({"--certificate", folder / "c.doc"}), 64);
  EXPECT_EQ(exit_code({"--label", folder / "l.zpl"}), 64) << "nothing would be read back";
  EXPECT_EQ(exit_code({"--limits", folder / "none.toml"}), 66);
  std::ofstream(folder / "bad.toml") << "[noise_mg]\nhigh = -1\n";
  EXPECT_EQ(exit_code({"--limits", folder / "bad.toml"}), 78);
  EXPECT_FALSE(std::filesystem::exists(folder / "s.db"));
  EXPECT_EQ(exit_code({"--certificate", folder / "no/such/folder/c.pdf"}), 73);
}

}  // namespace
}  // namespace sixpoint::station
