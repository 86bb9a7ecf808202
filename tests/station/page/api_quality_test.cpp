// The routes of check units, the lock, statistics and gage studies; the answers' numbers come from
// the records that each test puts into its store.
#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "expect_result.h"
#include "mocks/in_process/in_process.h"
#include "station/page/api.h"
#include "station/page/quality_control.h"
#include "temporary_folder.h"

namespace sixpoint::station {

using Json = nlohmann::ordered_json;

namespace {

class ApiQuality : public testing::Test {
 protected:
  ApiQuality() {
    mocks::register_virtual(devices_);
    LanesOptions options;
    options.devices = {"virtual:seed=7"};
    options.state_folder = folder_ / "state";
    auto lanes = Lanes::open(
        posix_env(), devices_, options,
        [](const JigReport&, const RunLabels&) -> Result<RunInStore> { return RunInStore{}; },
        [](const CaptureReport&) { return KeptConstants{}; });
    EXPECT_OK(lanes);
    lanes_ = *std::move(lanes);
    api_ = std::make_unique<Api>(
        ApiOptions{},
        ApiParts{posix_env(), *lanes_, repairs_, sign_in_, nullptr, {}, {}, &quality_});
    api_->set_port(6020);
  }

  Result<db::Store> open() { return db::Store::open(posix_env(), folder_ / "s.db"); }
  std::vector<db::StationEvent> events() { return *open()->station_events(); }

  ApiRequest request(const std::string& method, const std::string& path) const {
    ApiRequest request;
    request.method = method;
    request.path = path;
    request.host = "127.0.0.1:6020";
    request.client = "page-a";
    request.authorization = "Bearer 0123456789abcdef";
    return request;
  }
  ApiAnswer get(const std::string& path, const std::map<std::string, std::string>& query = {}) {
    ApiRequest asked = request("GET", path);
    asked.parameters = query;
    return api_->handle(asked);
  }
  ApiAnswer post(const std::string& path, const Json& body) {
    ApiRequest asked = request("POST", path);
    asked.body = body.dump();
    return api_->handle(asked);
  }
  static Json json(const ApiAnswer& answer) { return Json::parse(answer.body, nullptr, false); }

  // A run as the store has it after a jig run; with a study's name, one of that study.
  void add_run(const std::string& serial, const std::string& operator_name, bool passed,
               double zero_offset_mg = 100, const std::string& study = {}) {
    Json document = {{"firmware", "1.5.0"}, {"quantities", Json::array()}};
    document["quantities"].push_back({{"name", "zero_offset_mg"},
                                      {"axis", "x"},
                                      {"value", zero_offset_mg},
                                      {"expanded_uncertainty", 0.7},
                                      {"low", -700},
                                      {"high", 700},
                                      {"verdict", passed ? "pass" : "fail"},
                                      {"code", ""}});
    if (!study.empty()) {
      document["study"] = study;
    }
    db::RunRecord run;
    run.serial = serial;
    run.model = "wGT3X-BT";
    run.kind = study.empty() ? "jig" : kStudyKind;
    run.filter = "current";
    run.started = *parse_iso8601("2026-03-01T08:00:00Z") + std::chrono::hours(runs_++);
    run.ended = run.started + std::chrono::seconds(90);
    run.operator_name = operator_name;
    run.station = "bench-1";
    run.jig = "J1";
    run.verdict = passed ? "pass" : "fail";
    run.software = "test";
    run.document = document.dump();
    if (!passed) {
      run.codes = {"zero_high"};
    }
    EXPECT_OK(open()->add_run(run, {}));
  }

  tests::TemporaryFolder folder_;
  int runs_ = 0;
  device::TransportRegistry devices_;
  std::unique_ptr<Lanes> lanes_;
  RepairJob repairs_{posix_env(), [this] { return open(); }};
  QualityControl quality_{[this] { return open(); }, "bench-1", default_limits(),
                          posix_env().clock};
  SignIn sign_in_{posix_env().clock, "0123456789abcdef"};
  std::unique_ptr<Api> api_;
};

// Oracle: the row of the store. The station is the page's own, and no request says another.
TEST_F(ApiQuality, ACheckUnitThatIsNamedIsInTheStoreAndInTheAnswer) {
  Json body = {{"serial", "MOS2A45130007"},
               {"action", "add"},
               {"operator", "Eve"},
               {"reason", "checks bench 1"}};
  const ApiAnswer answer = post("/api/check-units", body);
  body["station"] = "bench-9";
  EXPECT_EQ(post("/api/check-units", body).status, 400);
  ASSERT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(json(answer)["lock"]["check_units"], Json::array({"MOS2A45130007"}));
  EXPECT_NE(json(answer)["stored_id"], "");
  ASSERT_EQ(events().size(), 1U);
  EXPECT_EQ(events()[0].action, "check_unit");
  EXPECT_EQ(events()[0].serial, "MOS2A45130007");
  EXPECT_EQ(events()[0].operator_name, "Eve");
  EXPECT_EQ(events()[0].reason, "checks bench 1");
  EXPECT_EQ(events()[0].station, "bench-1");
  const Json listed = json(get("/api/check-units"));
  EXPECT_EQ(listed["check_units"], Json::array({"MOS2A45130007"}));
  EXPECT_EQ(listed["locked"], false);
  EXPECT_EQ(listed["baseline_runs"], 10);

  EXPECT_EQ(post("/api/check-units", {{"serial", "MOS2A45130007"},
                                      {"action", "remove"},
                                      {"operator", "Eve"},
                                      {"reason", "worn out"}})
                .status,
            200);
  EXPECT_EQ(events().at(1).action, "check_unit_end");
  EXPECT_EQ(json(get("/api/check-units"))["check_units"], Json::array());
}

TEST_F(ApiQuality, ASignatureSaysWhetherTheBaselineIsNew) {
  const Json who = {{"operator", "Eve"}, {"reason", "new nest"}};
  EXPECT_EQ(post("/api/station-lock", who).status, 200);
  Json anew = who;
  anew["new_baseline"] = true;
  EXPECT_EQ(post("/api/station-lock", anew).status, 200);
  anew["new_baseline"] = false;
  EXPECT_EQ(post("/api/station-lock", anew).status, 200);
  const auto stored = events();
  ASSERT_EQ(stored.size(), 3U);
  EXPECT_EQ(stored[0].action, "sign");
  EXPECT_EQ(stored[1].action, "sign_new_baseline");
  EXPECT_EQ(stored[2].action, "sign");
  EXPECT_EQ(stored[0].serial, "");
}

// Each row is a decision that must not be stored.
TEST_F(ApiQuality, WrongDecisionsAreRefusedAndNothingIsStored) {
  const Json good = {
      {"serial", "MOS2A1"}, {"action", "add"}, {"operator", "Eve"}, {"reason", "why"}};
  const auto with = [&](const char* key, const Json& value) {
    Json body = good;
    body[key] = value;
    return body;
  };
  for (const Json& body :
       {with("operator", ""), with("operator", " \t"), with("operator", 7), with("reason", ""),
        with("reason", std::string(201, 'x')), with("serial", ""), with("serial", "two words"),
        with("serial", std::string(17, 'A')), with("serial", nullptr), with("action", "drop"),
        with("action", nullptr), Json::object()}) {
    EXPECT_EQ(post("/api/check-units", body).status, 400) << body;
  }
  for (const Json& body : {Json{{"operator", "Eve"}}, Json{{"reason", "why"}},
                           Json{{"operator", "Eve"}, {"reason", "why"}, {"new_baseline", "yes"}}}) {
    EXPECT_EQ(post("/api/station-lock", body).status, 400) << body;
  }
  ApiRequest foreign = request("POST", "/api/station-lock");
  foreign.client.clear();
  foreign.body = Json{{"operator", "Eve"}, {"reason", "why"}}.dump();
  const ApiAnswer refused = api_->handle(foreign);
  EXPECT_EQ(refused.status, 403) << "a form of another page cannot send the page's header";
  EXPECT_EQ(json(refused)["error"]["code"], "client_needed");
  EXPECT_TRUE(events().empty());
}

// Where the machine has operators, the name of a decision is the engineer's who signed in.
TEST_F(ApiQuality, OnlyAnEngineerSigns) {
  Operators operators(posix_env(), folder_ / "operators.json");
  EXPECT_OK(operators.add("Ada", OperatorRole::technician, "471100"));
  EXPECT_OK(operators.add("Eve", OperatorRole::engineer, "081500"));
  Api api(
      ApiOptions{},
      ApiParts{posix_env(), *lanes_, repairs_, sign_in_, nullptr, {}, {}, &quality_, &operators});
  api.set_port(6020);
  ApiRequest sign = request("POST", "/api/station-lock");
  sign.body = R"({"operator": "Eve", "reason": "seat cleaned"})";
  EXPECT_EQ(api.handle(sign).status, 403) << "no one";
  EXPECT_OK(operators.sign_in("the token", "Ada", "471100"));
  EXPECT_EQ(api.handle(sign).status, 403) << "a technician";
  EXPECT_TRUE(events().empty());
  EXPECT_OK(operators.sign_in("the token", "Eve", "081500"));
  sign.body = R"({"operator": "Mallory", "reason": "seat cleaned"})";
  EXPECT_EQ(api.handle(sign).status, 200);
  ASSERT_EQ(events().size(), 1U);
  EXPECT_EQ(events().front().operator_name, "Eve");
}

// Oracle: five runs by hand: Ada's two units pass at once; of Bo's two, one fails and passes the
// second time.
TEST_F(ApiQuality, StatisticsCountTheRunsOfTheStore) {
  add_run("MOS2A1", "Ada", true);
  add_run("MOS2A2", "Ada", true);
  add_run("MOS2A3", "Bo", false);
  add_run("MOS2A3", "Bo", true);
  add_run("MOS2A4", "Bo", true);
  const Json all = json(get("/api/statistics", {{"by", "operator"}}));
  EXPECT_EQ(all["all"]["runs"], 5);
  EXPECT_EQ(all["all"]["units"], 4);
  ASSERT_EQ(all["groups"].size(), 2U);
  EXPECT_EQ(all["groups"][0]["name"], "Ada");
  EXPECT_EQ(all["groups"][0]["runs"], 2);
  EXPECT_EQ(all["groups"][1]["name"], "Bo");
  EXPECT_EQ(all["groups"][1]["runs"], 3);
  EXPECT_TRUE(all["codes"].contains("zero_high")) << "with its meaning, for people";
  // All runs began on the first of March.
  EXPECT_EQ(json(get("/api/statistics", {{"from", "2026-03-02"}}))["all"]["runs"], 0);
  EXPECT_EQ(json(get("/api/statistics", {{"to", "2026-03-01"}}))["all"]["runs"], 0);
  EXPECT_EQ(
      json(get("/api/statistics", {{"from", "2026-03-01"}, {"to", "2026-03-02"}}))["all"]["runs"],
      5);
  EXPECT_EQ(get("/api/statistics", {{"by", "moon"}}).status, 400);
  EXPECT_EQ(get("/api/statistics", {{"from", "31.3.2027"}}).status, 400);
}

// Oracle: by hand: three parts, two operators, two trials; a tolerance halved doubles its share.
// The list "Today", and all runs of a unit whose label is scanned. Oracle: the rows of the store.
TEST_F(ApiQuality, TheRunsOfADayAndOfAUnitAreListed) {
  add_run("MOS2A45130001", "Ada", true);
  add_run("MOS2A45130002", "Bo", false);
  add_run("MOS2A45130001", "Bo", true);
  const Json today = json(get("/api/runs", {{"from", "2026-03-01T09:00:00Z"}}));
  ASSERT_EQ(today["runs"].size(), 2U);
  EXPECT_EQ(today["runs"][0]["operator"], "Bo") << "newest first";
  EXPECT_EQ(today["runs"][1]["serial"], "MOS2A45130002");
  EXPECT_EQ(today["runs"][1]["verdict"], "fail");
  EXPECT_EQ(today["runs"][1]["written"], false);
  EXPECT_EQ(today["runs"][1]["documents"], Json({"report.json"})) << "too little for a certificate";
  const Json unit = json(get("/api/runs", {{"serial", "sixpoint:mos2a45130001:0f"}}));
  ASSERT_EQ(unit["runs"].size(), 2U);
  EXPECT_EQ(unit["runs"][1]["operator"], "Ada");
  EXPECT_EQ(json(get("/api/runs", {{"serial", "no such unit"}}))["runs"].size(), 0U);
  EXPECT_EQ(get("/api/runs", {{"from", "yesterday"}}).status, 400);
  EXPECT_EQ(get("/api/runs").status, 400);
}

TEST_F(ApiQuality, AGageStudyIsAnsweredByItsName) {
  for (const double trial_mg : {-0.5, 0.5}) {
    for (const char* who : {"Ada", "Bo"}) {
      for (int part = 0; part < 3; ++part) {
        add_run("MOS2A" + std::to_string(part), who, true, 100 * part + trial_mg, "spring");
      }
    }
  }
  const Json studies = json(get("/api/gage-rr"));
  EXPECT_EQ(studies["studies"], Json::array({"spring"}));
  ASSERT_EQ(studies["quantities"].size(), 1U);
  EXPECT_EQ(studies["quantities"][0]["name"], "zero_offset_mg");
  EXPECT_EQ(studies["quantities"][0]["axes"], Json::array({"x"}));
  const std::map<std::string, std::string> query = {
      {"study", "spring"}, {"quantity", "zero_offset_mg"}, {"axis", "x"}};
  const Json study = json(get("/api/gage-rr", query));
  EXPECT_EQ(study["parts"], 3);
  EXPECT_EQ(study["operators"], 2);
  EXPECT_EQ(study["trials"], 2);
  EXPECT_TRUE(study["grr_percent_of_tolerance"].is_null()) << "none was stated";
  const auto of_tolerance = [&](const std::string& tolerance) {
    auto with = query;
    with["tolerance"] = tolerance;
    return json(get("/api/gage-rr", with))["grr_percent_of_tolerance"].get<double>();
  };
  EXPECT_GT(of_tolerance("100"), 0);
  EXPECT_NEAR(of_tolerance("50") / of_tolerance("100"), 2, 1e-9);
  for (const char* wrong : {"0", "-1", "wide", "1x", "nan", " 1"}) {
    auto with = query;
    with["tolerance"] = wrong;
    EXPECT_EQ(get("/api/gage-rr", with).status, 400) << wrong;
  }
  EXPECT_EQ(get("/api/gage-rr", {{"study", "autumn"}}).status, 404);
  EXPECT_EQ(
      get("/api/gage-rr", {{"study", "spring"}, {"quantity", "beauty"}, {"axis", "x"}}).status,
      400);
}

// A station without a store of its own has none of these routes.
TEST_F(ApiQuality, WithoutQualityControlTheRoutesAreUnknown) {
  Api plain(ApiOptions{}, ApiParts{posix_env(), *lanes_, repairs_, sign_in_});
  plain.set_port(6020);
  for (const char* path : {"/api/check-units", "/api/statistics", "/api/gage-rr"}) {
    EXPECT_EQ(plain.handle(request("GET", path)).status, 404) << path;
  }
  ApiRequest sign = request("POST", "/api/station-lock");
  sign.body = R"({"operator": "Eve", "reason": "why"})";
  EXPECT_EQ(plain.handle(sign).status, 404);
}

}  // namespace
}  // namespace sixpoint::station
