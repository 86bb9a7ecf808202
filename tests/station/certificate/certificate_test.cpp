#include "station/certificate/certificate.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "station/certificate/certificate_record.h"
#include "station/certificate/dcc.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(Certificate, TheSameRunGivesTheSameBytes) {
  const db::RunRecord run = record_of(7, writing());
  EXPECT_EQ(*certificate_pdf(*certificate_of(run)), *certificate_pdf(*certificate_of(run)));
  EXPECT_EQ(certificate_of(run)->to_json(), certificate_of(run)->to_json());
  db::RunRecord other = run;
  other.operator_name = "Bo";
  EXPECT_NE(*certificate_pdf(*certificate_of(run)), *certificate_pdf(*certificate_of(other)));
}

TEST(Certificate, ThePersonWhoReadsItIsToldTheMethodInWords) {
  const auto certificate = certificate_of(record_of(7, writing()));
  EXPECT_EQ(certificate->to_json()["method"], certificate->method) << "as the run's report has it";
  EXPECT_THAT(certificate->method, testing::StartsWith("six_pose_"));
  for (const char* method : {"six_pose_letter", "six_pose_pair", "six_pose_vector"}) {
    EXPECT_THAT(method_in_words(method), Not(HasSubstr("_")));
  }
  EXPECT_THAT(certificate_dcc(*certificate), HasSubstr(method_in_words(certificate->method)));
  EXPECT_THAT(certificate_dcc(*certificate), Not(HasSubstr("six_pose")));
  EXPECT_EQ(method_in_words("of a later version"), "of a later version");
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
  run.id = "0123456789abcdef0123456789abcdef";
  EXPECT_THAT(certificate_of(run).error().what,
              testing::StartsWith("run 0123456789ab ended as ''"));
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

// A name that was only typed is no proof.
TEST(Certificate, SaysWhetherTheOperatorWasAuthenticated) {
  db::RunRecord run = record_of(7, writing());
  EXPECT_EQ(certificate_of(run)->to_json()["operator_authenticated"], false);
  auto document = nlohmann::ordered_json::parse(run.document);
  document["operator_authenticated"] = true;
  run.document = document.dump();
  EXPECT_EQ(certificate_of(run)->to_json()["operator_authenticated"], true);
}

// No one is offered a paper that is not there.
TEST(Certificate, DocumentsAreThoseThatCanBeMade) {
  const std::vector<std::string> certificate = {"report.json", "certificate.pdf",
                                                "certificate.json", "certificate.dcc.xml"};
  auto with_label = certificate;
  with_label.emplace_back("label.zpl");
  const db::RunRecord written = record_of(7, writing());
  EXPECT_EQ(documents_of(written), with_label);
  auto later = written;
  later.kind = "write";
  EXPECT_EQ(documents_of(later), with_label);
  auto measured = writing();
  measured.run.write = false;
  EXPECT_EQ(documents_of(record_of(7, measured)), certificate);
  auto stopped = written;
  stopped.verdict = "stopped";
  EXPECT_EQ(documents_of(stopped), std::vector<std::string>{"report.json"});
}

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

}  // namespace
}  // namespace sixpoint::station
