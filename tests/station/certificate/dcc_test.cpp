// Oracle of the form: PTB's schemas, by xmllint. They belong to PTB and are no part of the project.
#include "station/certificate/dcc.h"

#include <cmath>
#include <fstream>
#include <regex>

#include <gmock/gmock.h>

#include "expect_result.h"
#include "shared_data.h"
#include "station/certificate/certificate_record.h"
#include "station/certificate/poppler.h"
#include "temporary_folder.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;

std::string dcc_of(const db::RunRecord& run) {
  const auto certificate = certificate_of(run);
  EXPECT_OK(certificate);
  return certificate_dcc(*certificate);
}

// Some quantities are too near to their limits; the jig is overdue, and an engineer signed for it.
Certificate undecided() {
  Certificate out = *certificate_of(record_of(7, {}));
  out.verdict = JigVerdict::inconclusive;
  out.quantities.at(0).verdict = JigVerdict::inconclusive;
  out.quantities.at(1).verdict = JigVerdict::fail;
  out.reasons = {"the jig was overdue; Eve signed: laboratory closed"};
  out.jig_due = *parse_iso8601("2020-01-01");
  return out;
}

TEST(Dcc, SaysNothingAgainstAUnitWhoseRunIsInconclusive) {
  const std::string xml = certificate_dcc(undecided());
  const std::regex fails("<dcc:conformity>fail<");
  EXPECT_EQ(std::distance(std::sregex_iterator(xml.begin(), xml.end(), fails), {}), 1)
      << "the one quantity that failed";
  const std::regex none("No statement of conformity: inconclusive\\.");
  EXPECT_EQ(std::distance(std::sregex_iterator(xml.begin(), xml.end(), none), {}), 2)
      << "the whole, and the other quantity";
  EXPECT_THAT(xml, HasSubstr("Eve signed: laboratory closed"));
  EXPECT_THAT(xml, HasSubstr("calibration is due on 2020-01-01"));
}

TEST(Dcc, IsValidByTheSchemasOfPtb) {
  SIXPOINT_NEED_SHARED("dcc/dcc.xsd");
  SIXPOINT_SKIP_UNLESS(output_of("command -v xmllint") != "",
                       "xmllint is missing; install the Debian package libxml2-utils");
  const tests::TemporaryFolder folder;
  db::RunRecord hostile = record_of(8, writing());
  hostile.operator_name = "<&\"'>\x01\x1b \xff";
  hostile.station = "";
  hostile.jig = "]]>";
  hostile.software = "sixpoint";
  sim::GivenProperties bad;
  bad.current_zero_lsb = PerAxis<double>{225, 20, 20};
  bad.current_sensitivity_lsb_per_g = PerAxis<double>{250, 250, 250};
  int number = 0;
  for (const std::string& xml : {dcc_of(record_of(7, writing())), dcc_of(hostile),
                                 dcc_of(record_of(9, {}, bad)), certificate_dcc(undecided())}) {
    const std::string file = folder / (std::to_string(++number) + ".dcc.xml");
    std::ofstream(file) << xml;
    EXPECT_THAT(output_of("xmllint --nonet --noout --schema '" + tests::shared_file("dcc/dcc.xsd") +
                          "' '" + file + "' 2>&1"),
                HasSubstr(" validates"))
        << number;
  }
}

// Oracle: the certificate's own numbers, and the definition of standard gravity.
TEST(Dcc, ValuesAreInSiUnitsWithTheirLimits) {
  const db::RunRecord run = record_of(7, writing());
  const auto certificate = certificate_of(run);
  ASSERT_OK(certificate);
  const std::string xml = certificate_dcc(*certificate);
  EXPECT_EQ(xml, dcc_of(run)) << "the same bytes";
  EXPECT_THAT(xml, HasSubstr("<dcc:uniqueIdentifier>sixpoint:" + run.serial + ":" + run.id + "<"));
  EXPECT_THAT(xml, HasSubstr("<dcc:conformity>pass</dcc:conformity>"));
  EXPECT_THAT(xml, HasSubstr("written into the unit and read back"));
  std::smatch found;
  ASSERT_TRUE(std::regex_search(
      xml, found,
      std::regex("one count, axis x[^]*?<si:value>([^<]*)<[^]*?<si:uncertainty>([^<]*)<")));
  const double per_count = certificate->sensitivity_g_per_lsb[0] * 9.80665;
  EXPECT_NEAR(std::stod(found[1]), per_count, 1e-8);
  EXPECT_NEAR(std::stod(found[2]), per_count * certificate->sensitivity_expanded_percent[0] / 100,
              1e-8);
  // 700 mg either way, the built-in limits of the zero offset.
  ASSERT_TRUE(std::regex_search(
      xml, found,
      std::regex("Zero offset, axis x[^]*?LimitLower[^]*?<si:value>([^<]*)<[^]*?LimitUpper[^]*?"
                 "<si:value>([^<]*)<")));
  EXPECT_NEAR(std::stod(found[1]), -0.7 * 9.80665, 1e-6);
  EXPECT_NEAR(std::stod(found[2]), 0.7 * 9.80665, 1e-6);
  EXPECT_THAT(xml, HasSubstr("<si:coverageProbability>0.9545<")) << "k = 2";
}

}  // namespace
}  // namespace sixpoint::station
