#include "db/audit.h"

#include <fmt/format.h>

#include "store_fixture.h"

namespace sixpoint::db {
namespace {

TEST_F(StoreTest, AHeadThatWasWrittenDownFindsAHistoryThatWasWrittenAnew) {
  std::string written_down;
  {
    Store store = open();
    ASSERT_OK(store.add_constants(constants("MOS2A1", "current", 100, "1"), "w"));
    written_down = store.audit()->head;
    ASSERT_OK(store.add_constants(constants("MOS2A1", "current", 200, "2"), "w"));
    EXPECT_TRUE(store.audit(written_down)->ok);
    EXPECT_TRUE(store.audit(std::string(64, '0'))->ok) << "the head of an empty store";
    EXPECT_FAILS(store.audit("no head"), ErrorCode::usage);
    EXPECT_FAILS(store.audit("00ff"), ErrorCode::usage);
  }
  place_->erase("main");
  Store forged = open();
  ASSERT_OK(forged.add_constants(constants("MOS2A1", "current", 100, "1.1"), "w"));
  ASSERT_OK(forged.add_constants(constants("MOS2A1", "current", 200, "2"), "w"));
  EXPECT_TRUE(forged.audit()->ok) << "the chain alone cannot know";
  const auto audit = forged.audit(written_down);
  ASSERT_OK(audit);
  EXPECT_FALSE(audit->ok);
}

TEST_F(StoreTest, AuditFindsWhatWasTouched) {
  const auto fill = [&] {
    Store store = open();
    for (int i = 0; i < 5; ++i) {
      ASSERT_OK(store.add_constants(constants("MOS2A1", "current", i), "w"));
    }
    RunRecord run;
    run.serial = "MOS2A1";
    run.kind = "jig";
    run.filter = "current";
    run.document = "{}";
    ASSERT_OK(store.add_run(run, {{"raw", Bytes{1, 2, 3}}}));
    const auto audit = store.audit();
    EXPECT_TRUE(audit->ok);
    EXPECT_EQ(audit->head.size(), 64U);
  };
  for (const std::string& change : std::vector<std::string>{
           "UPDATE constants SET document = '{\"a\":1}' WHERE seq = 3",
           "UPDATE constants SET made_at_ns = 7 WHERE seq = 4",
           "DELETE FROM constants WHERE seq = 3", "DELETE FROM constants WHERE seq = 7",
           "UPDATE constants SET seq = 100 WHERE seq = 3; UPDATE constants SET seq = 3 WHERE seq = "
           "4; "
           "UPDATE constants SET seq = 4 WHERE seq = 100",
           "UPDATE units SET serial = 'X' WHERE seq = 1",
           "UPDATE attachments SET bytes = " + place_->empty_bytes(), "DELETE FROM attachments",
           "UPDATE head SET rows = 3", "UPDATE constants SET filter = 'legacy' WHERE seq = 3",
           "UPDATE runs SET temperature_c = '21' WHERE serial = 'MOS2A1'",
           "UPDATE constants SET origin = '{}' WHERE seq = 4"}) {
    place_->erase("main");
    fill();
    place_->tamper("main", change);
    const auto audit = open().audit();
    ASSERT_OK(audit);
    EXPECT_FALSE(audit->ok) << change;
    EXPECT_FALSE(audit->findings.empty());
  }
}

TEST_F(StoreTest, AuditFindsATableThatWasRemoved) {
  for (const char* table : {"repairs", "constants", "head"}) {
    place_->erase("main");
    ASSERT_OK(open().add_constants(constants("MOS2A1", "current", 1), "w"));
    place_->tamper("main", fmt::format("ALTER TABLE {} RENAME TO aside", table));
    const auto audit = open().audit();
    ASSERT_OK(audit);
    EXPECT_FALSE(audit->ok) << table;
    EXPECT_NE(audit->brief().find(table), std::string::npos) << audit->brief();
  }
}

TEST_F(StoreTest, TheHeadIsPublishedAndFoundAgain) {
  Store store = open();
  EXPECT_EQ(store.head()->rows, 0);
  EXPECT_EQ(store.head()->head, std::string(64, '0'));
  RunRecord run;
  run.serial = "MOS2A1";
  run.kind = "jig";
  run.filter = "current";
  run.document = "{}";
  const auto id = store.add_run(run, {});
  ASSERT_OK(id);
  const std::string of_run = store.run(*id)->head;
  ASSERT_OK(store.add_constants(constants("MOS2A1", "current", 100, "1"), "w"));
  const auto head = store.head();
  ASSERT_OK(head);
  EXPECT_EQ(head->head, store.audit()->head);
  EXPECT_EQ(head->rows, store.audit()->rows);
  EXPECT_NE(of_run, head->head);
  EXPECT_EQ(of_run, store.head_of_run(*id).value());
  EXPECT_TRUE(store.audit(of_run)->ok);
  EXPECT_TRUE(store.audit(head->head)->ok);
  EXPECT_FAILS(store.head_of_run("none"), ErrorCode::no_input);
}

TEST_F(StoreTest, AnAuditSeesOneMomentWhileOthersWrite) {
  Store store = open();
  std::atomic<bool> stop = false;
  std::thread writer([&] {
    MemoryEnv env;
    auto other = Store::open(env.env, place_->location("main"));
    for (int i = 0; !stop; ++i) {
      static_cast<void>(other->add_constants(constants("MOS", "current", i), "w"));
    }
  });
  for (int i = 0; i < 20; ++i) {
    const auto audit = store.audit();
    EXPECT_TRUE(audit && audit->ok) << (audit ? audit->brief() : audit.error().brief());
  }
  stop = true;
  writer.join();
}

TEST_F(StoreTest, AnAuditIsSaidInOneSentenceAndAsJson) {
  Store store = open();
  ASSERT_OK(store.add_constants(constants("MOS2A1", "current", 100), "w"));
  const auto whole = store.audit();
  ASSERT_OK(whole);
  EXPECT_EQ(whole->brief(), "3 rows, nothing touched, head " + whole->head);
  EXPECT_EQ(whole->to_json().dump(),
            R"({"ok":true,"rows":3,"head":")" + whole->head + R"(","findings":[]})");
  EXPECT_EQ(store.head()->to_json().dump(), R"({"rows":3,"head":")" + whole->head + R"("})");
  place_->tamper("main", "UPDATE constants SET made_at_ns = 7");
  const auto touched = store.audit();
  ASSERT_OK(touched);
  ASSERT_EQ(touched->findings.size(), 1U);
  EXPECT_EQ(touched->brief(), "3 rows, 1 findings, the first: " + touched->findings[0]);
  EXPECT_THAT(touched->findings[0], testing::HasSubstr("row 3 (constants "));
  EXPECT_EQ(touched->to_json()["ok"], false);
  EXPECT_EQ(touched->to_json()["findings"][0], touched->findings[0]);
}

TEST_F(StoreTest, OfManyFindingsAnAuditNamesTheFirst20) {
  Store store = open();
  for (int i = 0; i < 25; ++i) {
    ASSERT_OK(store.add_constants(constants("MOS2A1", "current", i), "w"));
  }
  place_->tamper("main", "UPDATE constants SET made_at_ns = made_at_ns + 1");
  const auto audit = store.audit();
  ASSERT_OK(audit);
  ASSERT_EQ(audit->findings.size(), 20U);
  EXPECT_THAT(audit->findings.front(), testing::HasSubstr("row 3 (constants "));
  EXPECT_THAT(audit->findings.back(), testing::HasSubstr("row 22 (constants "));
}

}  // namespace
}  // namespace sixpoint::db
