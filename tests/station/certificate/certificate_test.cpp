#include "station/certificate/certificate.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "run_command.h"
#include "station/certificate/certificate_record.h"
#include "temporary_folder.h"

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
