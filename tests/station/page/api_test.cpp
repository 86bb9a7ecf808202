// Requests that the station refuses: wrong ones, and those of other pages.
#include "station/page/api.h"

#include "station/page/station_in_process.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;

TEST(Api, WrongRequestsAreRefused) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  auto client = station.client();
  const auto post = [&](const std::string& path, const std::string& body) {
    const auto answer = client.Post(path, body, "application/json");
    return answer ? answer->status : 0;
  };
  EXPECT_EQ(post("/api/run", "{"), 400);
  EXPECT_EQ(post("/api/run", "[]"), 400);
  EXPECT_EQ(post("/api/run", R"({"lane": "one"})"), 400);
  EXPECT_EQ(post("/api/run", R"({"lane": -1})"), 400);
  EXPECT_EQ(post("/api/run", R"({"lane": 99})"), 404);
  EXPECT_EQ(
      post("/api/run", R"({"operator": )" + std::string("\"") + std::string(500, 'x') + "\"}"),
      400);
  EXPECT_EQ(post("/api/run", R"({"operator": "A\u0000da"})"), 400) << "no store takes a NUL";
  EXPECT_EQ(post("/api/run", std::string(40'000, '[')), 400) << "deep";
  EXPECT_EQ(post("/api/run", std::string(1'000'000, ' ')), 413);
  EXPECT_EQ(post("/api/nothing", "{}"), 404);
  EXPECT_EQ(post("/", "{}"), 404);
  EXPECT_EQ(client.Get("/api/nothing")->status, 404);
  EXPECT_EQ(client.Get("/api/lanes/0")->status, 404);
  EXPECT_EQ(client.Get("/api/lanes/1x")->status, 404);
  EXPECT_EQ(client.Get("/../../etc/passwd")->status, 404);
  EXPECT_EQ(client.Get("/" + std::string(7000, 'a'))->status, 404);
  EXPECT_EQ(client.Delete("/api/run")->status, 405);
  EXPECT_EQ(client.Get("/api/files?path=../..")->status, 403);
  EXPECT_EQ(client.Get("/api/files?path=%2Fetc")->status, 403);
  EXPECT_EQ(client.Get("/api/files?path=nowhere")->status, 404);
  EXPECT_EQ(post("/api/check", R"({"file": "../x.gt3x"})"), 403);
  EXPECT_EQ(post("/api/repair", R"({"folder": "", "output": "../out"})"), 403);
  EXPECT_EQ(post("/api/lanes/1/undo", ""), 409) << "nothing runs";
  // Every answer is JSON with a code, and none may be framed, sniffed or cached.
  const auto answer = client.Get("/api/nothing");
  EXPECT_EQ(Json::parse(answer->body)["error"]["code"], "not_found");
  EXPECT_THAT(answer->get_header_value("Content-Security-Policy"), HasSubstr("default-src 'none'"));
  EXPECT_EQ(answer->get_header_value("Access-Control-Allow-Origin"), "");
  EXPECT_EQ(answer->get_header_value("Cache-Control"), "no-store");
}

TEST(Api, OtherPagesInTheBrowserMayNotCommandIt) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  station.wait_state(1, "idle");
  auto client = station.client();
  const std::string own = "127.0.0.1:" + std::to_string(station.server->port());
  const auto ask = [&](httplib::Headers headers) {
    return client.Post("/api/run", headers, "{}", "text/plain")->status;
  };
  EXPECT_EQ(ask({{"Origin", "http://evil.example"}}), 403);
  EXPECT_EQ(ask({{"Origin", "null"}}), 403);
  EXPECT_EQ(ask({{"Origin", "https://" + own}}), 403) << "the scheme is part of it";
  EXPECT_EQ(ask({{"Sec-Fetch-Site", "cross-site"}}), 403);
  EXPECT_EQ(ask({{"Sec-Fetch-Site", "same-site"}}), 403) << "another port of this machine";
  // DNS rebinding: for the browser this station is evil.example.
  EXPECT_EQ(ask({{"Host", "evil.example:" + std::to_string(station.server->port())}}), 421);
  EXPECT_EQ(ask({{"Host", "127.0.0.1.evil.example"}}), 421);
  EXPECT_EQ(client.Get("/api/state", {{"Host", "evil.example"}})->status, 421);
  EXPECT_EQ(station.lane(1)["state"], "idle") << "none of them started anything";
  EXPECT_EQ(ask({{"Origin", "http://" + own}, {"Sec-Fetch-Site", "same-origin"}}), 202);
}

// Oracle: a browser leaves out the port that its scheme has anyway (RFC 9110, 4.2).
TEST(Api, TheHostMayLeaveOutThePortOfItsScheme) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  for (const bool tls : {false, true}) {
    ApiOptions options;
    options.tls = tls;
    Api api(options, {posix_env(), *station.lanes, *station.repairs, station.sign_in});
    ApiRequest request;
    request.method = "GET";
    request.path = "/";
    request.host = "127.0.0.1";
    for (const int port : {80, 443, 6020}) {
      api.set_port(port);
      EXPECT_EQ(api.handle(request).status, port == (tls ? 443 : 80) ? 200 : 421)
          << port << (tls ? " https" : " http");
    }
  }
}

// Oracle: RFC 9110, 4.2.3.
TEST(Api, LettersOfAHostMayBeLargeOrSmall) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  ApiOptions options;
  options.tls = true;
  options.bind = "Bench-4.Example";
  Api api(options, {posix_env(), *station.lanes, *station.repairs, station.sign_in});
  api.set_names({"bench-3"});
  api.set_port(6020);
  const auto status_of = [&](const std::string& host) {
    ApiRequest request;
    request.method = "GET";
    request.path = "/";
    request.host = host;
    return api.handle(request).status;
  };
  for (const char* host : {"bench-3:6020", "Bench-3:6020", "BENCH-3:6020", "bench-4.example:6020",
                           "Bench-4.Example:6020", "LocalHost:6020"}) {
    EXPECT_EQ(status_of(host), 200) << host;
  }
  for (const char* host : {"Bench-5:6020", "Bench-3:6021", "Bench-3", "Bench-3.example:6020"}) {
    EXPECT_EQ(status_of(host), 421) << host;
  }
}

// The page itself is given to everybody: it asks for the code. Nothing else is.
TEST(Api, EveryRequestNeedsTheTokenOrASession) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  auto client = station.client();
  client.set_default_headers({});
  for (const char* path : {"/", "/page.js", "/page.css", "/icon.svg"}) {
    EXPECT_EQ(client.Get(path)->status, 200) << path;
  }
  for (const char* path : {"/api/state", "/api/events", "/api/lanes/1", "/api/files", "/api/job",
                           "/api/me", "/api/runs/abc123/report.json", "/api/nothing", "/x",
                           "/api/state?token=0123456789abcdef", "/api/session"}) {
    EXPECT_EQ(client.Get(path)->status, 401) << path;
  }
  for (const char* path : {"/api/run", "/api/code", "/api/lanes/1/stop", "/api/repair"}) {
    EXPECT_EQ(client.Post(path, "{}", "application/json")->status, 401) << path;
  }
  EXPECT_EQ(client.Get("/api/state", {{"Authorization", "Bearer 0123456789abcdef"}})->status, 200);
  EXPECT_EQ(client.Get("/api/state", {{"Authorization", "Bearer 0123456789abcde"}})->status, 401);
  EXPECT_EQ(client.Get("/api/state", {{"Authorization", "0123456789abcdef"}})->status, 401);
  EXPECT_EQ(station.lane(1)["result"], Json(nullptr)) << "none of them did anything";
}

// A code opens one browser, by a cookie that holds neither the code nor the token.
TEST(Api, ACodeGivesOneBrowserASession) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  auto client = station.client();
  client.set_default_headers({});
  const auto sign_in = [&](const std::string& code) {
    return client.Post("/api/session", Json({{"code", code}}).dump(), "application/json");
  };
  const std::string code = station.sign_in.first_code();
  EXPECT_EQ(sign_in("AAAA-AAAA-AAAA")->status, 401);
  EXPECT_EQ(client.Post("/api/session", R"({"code": 7})", "application/json")->status, 401);
  const auto opened = sign_in(code);
  ASSERT_EQ(opened->status, 200);
  EXPECT_EQ(sign_in(code)->status, 401) << "used up";
  const std::string cookie = opened->get_header_value("Set-Cookie");
  EXPECT_THAT(cookie, HasSubstr("; HttpOnly; SameSite=Strict; Path=/"));
  EXPECT_THAT(cookie, testing::Not(HasSubstr("Secure"))) << "a browser drops it on plain http";
  EXPECT_THAT(cookie, testing::Not(HasSubstr(Station::kToken)));
  EXPECT_THAT(opened->body, testing::Not(HasSubstr(Station::kToken)));
  const std::string sent = cookie.substr(0, cookie.find(';'));
  EXPECT_EQ(client.Get("/api/state", {{"Cookie", "a=b; " + sent}})->status, 200);
  std::string changed = sent;
  changed.back() = changed.back() == '0' ? '1' : '0';
  EXPECT_EQ(client.Get("/api/state", {{"Cookie", changed}})->status, 401);
  EXPECT_EQ(client.Get("/api/state", {{"Cookie", "x" + sent}})->status, 401);
  // A page that is signed in lets the next one in.
  const auto next = client.Post("/api/code", {{"Cookie", sent}}, "{}", "application/json");
  ASSERT_EQ(next->status, 200);
  EXPECT_EQ(sign_in(Json::parse(next->body)["code"])->status, 200);
  EXPECT_NE(sign_in(Station::kToken)->get_header_value("Set-Cookie"), cookie) << "each its own";
}

// A person who knows a client's identifier may stop its run: what others are shown is another name.
TEST(Api, IdentifiersOfClientsStaySecret) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  station.wait_state(1, "idle");
  EXPECT_EQ(station.post("/api/run", {{"lane", 1}}, "secret-of-ada"), 202);
  station.wait_state(1, "running");
  const std::string state = station.client().Get("/api/state")->body;
  EXPECT_THAT(state, testing::Not(HasSubstr("secret-of-ada")));
  const auto me = station.client().Get("/api/me", {{"X-Sixpoint-Client", "secret-of-ada"}});
  const std::string name = Json::parse(me->body)["client"];
  EXPECT_EQ(station.lane(1)["client"], name) << "by which a page knows its own run";
  EXPECT_EQ(station.post("/api/lanes/1/stop", Json::object(), name), 409) << "and no more";
}

// The last run could be written at the address of a capture.
TEST(Api, ACaptureWritesNoConstants) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.wait_state(1, "idle");
  for (const char* key : {"write", "last_run"}) {
    EXPECT_EQ(station.post("/api/capture", {{key, true}}), 400) << key;
    EXPECT_EQ(station.post("/api/capture", {{key, 1}}), 400) << key;
  }
  EXPECT_EQ(station.lane(1)["state"], "idle");
  EXPECT_EQ(station.post("/api/capture", {{"write", false}, {"operator", "Ada"}}), 202);
}

// A request with `Lane` started lane 1, whose motor turns.
TEST(Api, AKeyThatIsNoneOfItsRouteStartsNothingAndIsNamed) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  station.wait_state(1, "idle");
  for (const char* path :
       {"session", "operator", "code", "run", "capture", "scan", "check", "check-units",
        "station-lock", "repair", "repair/cancel", "runs/0123456789abcdef0123456789abcdef/print",
        "lanes/1/undo", "lanes/1/stop", "lanes/1/placed", "lanes/1/jig-free", "lanes/1/take",
        "lanes/1/scan", "lanes/1/hand"}) {
    const auto answer =
        station.client().Post(std::string("/api/") + path, R"({"Lane": 2})", "application/json");
    EXPECT_EQ(answer->status, 400) << path;
    EXPECT_THAT(answer->body, HasSubstr("'Lane' is no key of this request")) << path;
  }
  EXPECT_EQ(station.post("/api/nothing", {{"Lane", 2}}), 404);
  EXPECT_EQ(station.lane(1)["state"], "idle");
}

// Where the machine has operators, a name comes from a PIN and not from the request.
TEST(Api, TheNameInARecordIsTheOneThatSignedIn) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7,jig=auto"}, folder.path());
  Operators operators(posix_env(), folder / "operators.json");
  EXPECT_OK(operators.add("Ada", OperatorRole::technician, "471100"));
  station.wait_state(1, "idle");
  const Json mallory = {{"operator", "Mallory"}};
  for (const char* path : {"/api/run", "/api/capture", "/api/lanes/1/take"}) {
    EXPECT_EQ(station.post(path, mallory), 403) << path;
  }
  EXPECT_EQ(station.post("/api/lanes/1/jig-free", Json::object()), 403);
  EXPECT_EQ(station.post("/api/operator", {{"name", "Ada"}, {"pin", "0000"}}), 403);
  EXPECT_EQ(station.post("/api/operator", {{"name", "Ada"}}), 403);
  EXPECT_EQ(station.post("/api/operator", {{"name", "Ada"}, {"pin", 471100}}), 400);
  EXPECT_EQ(station.get("/api/me")["operator"], Json(nullptr));
  EXPECT_EQ(station.post("/api/operator", {{"name", "Ada"}, {"pin", "471100"}}), 200);
  EXPECT_EQ(station.get("/api/me")["operator"]["role"], "technician");
  EXPECT_EQ(station.get("/api/me")["operators"], Json({"Ada"}));
  EXPECT_EQ(station.post("/api/run", mallory), 202);
  station.wait(1, [](const Json& json) {
    return json["result"].is_object() && json["result"]["stored"] == true;
  });
  EXPECT_EQ(station.operators.back(), "Ada");
  EXPECT_TRUE(station.authenticated.back());
  EXPECT_EQ(station.post("/api/operator", {{"name", ""}}), 200) << "signs out";
  EXPECT_EQ(station.post("/api/run", mallory), 403);
}

// A command that hung in the network for a while does not start a motor when no one expects it.
TEST(Api, ACommandThatComesTooLateIsNotCarriedOut) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path());
  station.wait_state(1, "idle");
  const auto now_ms = station.get("/api/me")["clock_ms"].get<std::int64_t>();
  const auto start = [&](const std::string& before) {
    return station.client().Post("/api/run", {{"X-Sixpoint-Before", before}}, "{}",
                                 "application/json");
  };
  EXPECT_EQ(start(std::to_string(now_ms - 1))->status, 408);
  EXPECT_EQ(start("0")->status, 408);
  EXPECT_EQ(start("soon")->status, 400);
  EXPECT_EQ(start("-1")->status, 400);
  EXPECT_EQ(station.lane(1)["state"], "idle");
  EXPECT_EQ(start(std::to_string(now_ms + 600'000))->status, 202);
}

}  // namespace
}  // namespace sixpoint::station
