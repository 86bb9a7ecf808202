// certificate, and the certificate of a jig run; tests/station/certificate has its content.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>

#include "run_command.h"
#include "temporary_folder.h"

namespace sixpoint::cli {
namespace {

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
}  // namespace sixpoint::cli
