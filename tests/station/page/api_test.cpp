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

TEST(Api, EveryRequestNeedsTheToken) {
  const tests::TemporaryFolder folder;
  Station station({"virtual:seed=7"}, folder.path(), "correct-horse");
  auto client = station.client();
  EXPECT_EQ(client.Get("/")->status, 401);
  EXPECT_EQ(client.Get("/api/state")->status, 401);
  EXPECT_EQ(client.Get("/api/events")->status, 401);
  EXPECT_EQ(client.Get("/?token=wrong")->status, 401);
  EXPECT_EQ(client.Get("/api/state?token=correct-horse")->status, 401) << "only for the first page";
  EXPECT_EQ(client.Get("/api/state", {{"Authorization", "Bearer correct-horse"}})->status, 200);
  EXPECT_EQ(client.Get("/api/state", {{"Authorization", "Bearer correct-hors"}})->status, 401);
  const auto first = client.Get("/?token=correct-horse");
  EXPECT_EQ(first->status, 303);
  const std::string cookie = first->get_header_value("Set-Cookie");
  EXPECT_THAT(cookie, HasSubstr("HttpOnly; SameSite=Strict"));
  EXPECT_EQ(client.Get("/", {{"Cookie", cookie.substr(0, cookie.find(';'))}})->status, 200);
  EXPECT_EQ(client.Get("/", {{"Cookie", "a=b; sixpoint_token=x"}})->status, 401);
}

}  // namespace
}  // namespace sixpoint::station
