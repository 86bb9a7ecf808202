// The papers of a run, over the Api alone.
#include <gmock/gmock.h>

#include "station/page/station_in_process.h"

namespace sixpoint::station {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

class ApiPapers : public testing::Test {
 protected:
  ApiPapers() {
    auto opened = LabelPrinter::open(posix_env(), "tcp://printer:9100", folder_ / "labels",
                                     [](std::string_view, const std::stop_token&) -> Result<Sent> {
                                       return fail(ErrorCode::device_unavailable, "it is away");
                                     },
                                     {3600, 3600});
    EXPECT_OK(opened);
    printer_ = *std::move(opened);
  }
  ApiParts parts(bool with_printer) {
    ApiParts parts{posix_env(), *station_.lanes, *station_.repairs, station_.sign_in};
    parts.run_document = [](const std::string&, const std::string& kind) -> Result<RunDocument> {
      return RunDocument{kind == "certificate.pdf" ? "application/pdf" : "application/json",
                         "paper"};
    };
    if (with_printer) {
      parts.printer = printer_.get();
      parts.print_again = [this](const std::string& run) -> Status {
        if (run == "ff") {
          return fail(ErrorCode::bad_data, "no label: the unit did not pass");
        }
        return printer_->add_again({run, "MOS2A1", "^XA^XZ"});
      };
    }
    return parts;
  }
  static ApiRequest asked(const std::string& method, const std::string& path) {
    ApiRequest request;
    request.method = method;
    request.path = path;
    request.host = "127.0.0.1:6020";
    request.authorization = std::string("Bearer ") + Station::kToken;
    return request;
  }
  static std::string header(const ApiAnswer& answer, const std::string& name) {
    std::string all;
    for (const auto& [key, value] : answer.headers) {
      all += key == name ? value + "|" : "";
    }
    return all;
  }

  tests::TemporaryFolder folder_;
  Station station_{{"virtual:seed=7"}, folder_.path()};
  std::unique_ptr<LabelPrinter> printer_;
};

// The browser shows and prints the certificate; the link that says "save" saves it.
TEST_F(ApiPapers, ThePdfIsShownAndTheOthersAreSaved) {
  Api api({}, parts(false));
  api.set_port(6020);
  const auto shown = api.handle(asked("GET", "/api/runs/0123abcd/certificate.pdf"));
  EXPECT_EQ(shown.status, 200);
  EXPECT_EQ(header(shown, "Content-Disposition"),
            "inline; filename=\"sixpoint-0123abcd-certificate.pdf\"|");
  EXPECT_EQ(header(shown, "Content-Security-Policy"), "frame-ancestors 'none'|") << "once";
  EXPECT_EQ(header(shown, "X-Content-Type-Options"), "nosniff|");
  auto saving = asked("GET", "/api/runs/0123abcd/certificate.pdf");
  saving.parameters["download"] = "1";
  const auto saved = api.handle(saving);
  EXPECT_THAT(header(saved, "Content-Disposition"), StartsWith("attachment; "));
  EXPECT_THAT(header(saved, "Content-Security-Policy"), HasSubstr("default-src 'none'"));
  for (const char* kind : {"certificate.json", "certificate.dcc.xml", "report.json", "label.zpl"}) {
    const auto other = api.handle(asked("GET", std::string("/api/runs/0123abcd/") + kind));
    EXPECT_THAT(header(other, "Content-Disposition"), StartsWith("attachment; ")) << kind;
    EXPECT_THAT(header(other, "Content-Security-Policy"), HasSubstr("default-src 'none'"));
  }
  EXPECT_EQ(api.handle(asked("GET", "/api/runs/..%2F/certificate.pdf")).status, 404);
}

TEST_F(ApiPapers, ALabelIsPrintedAgainAndItsStateIsShown) {
  Api api({}, parts(true));
  api.set_port(6020);
  EXPECT_EQ(api.handle(asked("POST", "/api/runs/aa/print")).status, 202);
  const auto state = Json::parse(api.handle(asked("GET", "/api/state")).body);
  EXPECT_EQ(state["printer"]["printer"], "tcp://printer:9100");
  ASSERT_EQ(state["printer"]["labels"].size(), 1);
  EXPECT_EQ(state["printer"]["labels"][0]["run"], "aa");
  EXPECT_EQ(state["printer"]["labels"][0]["state"], "waiting");
  const auto refused = api.handle(asked("POST", "/api/runs/ff/print"));
  EXPECT_EQ(refused.status, 400);
  EXPECT_THAT(refused.body, HasSubstr("did not pass"));
  EXPECT_EQ(api.handle(asked("POST", "/api/runs/xyz/print")).status, 404) << "no id";
  auto stranger = asked("POST", "/api/runs/aa/print");
  stranger.authorization.clear();
  EXPECT_EQ(api.handle(stranger).status, 401);

  Api without({}, parts(false));
  without.set_port(6020);
  EXPECT_EQ(without.handle(asked("POST", "/api/runs/aa/print")).status, 404);
  EXPECT_EQ(Json::parse(without.handle(asked("GET", "/api/state")).body)["printer"], nullptr);
}

}  // namespace
}  // namespace sixpoint::station
