#include "station/server.h"

#include <atomic>

#include <fmt/format.h>
#include <httplib.h>
#include <sys/socket.h>

namespace sixpoint::station {

namespace {

constexpr std::chrono::milliseconds kBetweenEvents{33};

ApiRequest request_of(const httplib::Request& from) {
  ApiRequest request;
  request.method = from.method;
  request.path = from.path;
  request.body = from.body;
  request.host = from.get_header_value("Host");
  request.origin = from.get_header_value("Origin");
  request.fetch_site = from.get_header_value("Sec-Fetch-Site");
  request.authorization = from.get_header_value("Authorization");
  request.cookie = from.get_header_value("Cookie");
  request.client = from.get_header_value("X-Sixpoint-Client");
  request.path_parameter = from.get_param_value("path");
  request.token_parameter = from.get_param_value("token");
  for (const auto& [name, value] : from.params) {
    request.parameters.emplace(name, value);
  }
  return request;
}

void give(const ApiAnswer& answer, httplib::Response& response) {
  response.status = answer.status;
  for (const auto& [name, value] : answer.headers) {
    response.set_header(name.c_str(), value);
  }
  response.set_content(answer.body, answer.content_type.c_str());
}

ApiAnswer refused(int status, std::string_view code, std::string_view what) {
  return {status,
          "application/json",
          fmt::format(R"({{"error":{{"code":"{}","what":"{}","hint":""}}}})", code, what),
          {{"X-Content-Type-Options", "nosniff"}, {"Cache-Control", "no-store"}}};
}

// The library lets five connections wait to be accepted; a burst of pages would wait for seconds.
class PatientServer : public httplib::Server {
 public:
  void widen_backlog() { ::listen(svr_sock_, 256); }
};

}  // namespace

struct Server::Impl {
  Impl(Env& its_env, Api& its_api, const ServerOptions& its_options)
      : env(its_env), api(its_api), options(its_options) {}

  void set_up();
  void stream(httplib::Response& response);

  Env& env;
  Api& api;
  ServerOptions options;
  PatientServer server;
  int port = 0;
  std::atomic<bool> stopping{false};
};

void Server::Impl::stream(httplib::Response& response) {
  std::shared_ptr<EventStream> events = api.open_events();
  if (!events) {
    give(refused(503, "too_many_streams", "too many pages are open; close some"), response);
    response.set_header("Retry-After", "5");
    return;
  }
  response.set_header("Cache-Control", "no-store");
  response.set_header("X-Content-Type-Options", "nosniff");
  response.set_chunked_content_provider(
      "text/event-stream", [this, events](std::size_t /*offset*/, httplib::DataSink& sink) {
        if (stopping) {
          sink.done();
          return true;
        }
        const std::string text = events->next();
        if (!text.empty() && !sink.write(text.data(), text.size())) {
          return false;
        }
        env.clock.sleep(kBetweenEvents);
        return true;
      });
}

void Server::Impl::set_up() {
  server.set_payload_max_length(options.most_body_bytes);
  server.set_tcp_nodelay(true);
  // The library would share the port with another station (SO_REUSEPORT), and each would get half.
  server.set_socket_options([](socket_t socket) {
    const int yes = 1;
    setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  });
  server.set_read_timeout(options.request_time_out_s);
  server.set_write_timeout(options.request_time_out_s);
  server.set_keep_alive_timeout(2);
  // One request per connection: a page that was refused must not hold a thread any longer.
  server.set_keep_alive_max_count(1);
  server.new_task_queue = [this] { return new httplib::ThreadPool(options.threads); };
  // Before the body is read: who may not ask, does not send either.
  server.set_pre_routing_handler([this](const httplib::Request& from, httplib::Response& response) {
    if (auto no = api.guard(request_of(from))) {
      give(*no, response);
      return httplib::Server::HandlerResponse::Handled;
    }
    // Bodies of a length that nobody announced, or that unpack to a hundred times their size.
    if (from.has_header("Transfer-Encoding") || from.has_header("Content-Encoding")) {
      give(refused(411, "length_required", "send the body plain and with its length"), response);
      return httplib::Server::HandlerResponse::Handled;
    }
    // A request that announces no body has none (RFC 9112, 6.3); the library would wait for one.
    const bool without_body = from.method == "POST" && !from.has_header("Content-Length");
    if (without_body || (from.method != "GET" && from.method != "HEAD" && from.method != "POST")) {
      give(api.handle(request_of(from)), response);
      return httplib::Server::HandlerResponse::Handled;
    }
    return httplib::Server::HandlerResponse::Unhandled;
  });
  server.Get(".*", [this](const httplib::Request& from, httplib::Response& response) {
    if (from.path == "/api/events") {
      stream(response);
    } else {
      give(api.handle(request_of(from)), response);
    }
  });
  server.Post(".*", [this](const httplib::Request& from, httplib::Response& response) {
    give(api.handle(request_of(from)), response);
  });
  server.set_exception_handler([](const httplib::Request& /*from*/, httplib::Response& response,
                                  const std::exception_ptr& /*error*/) {
    give(refused(500, "internal", "a defect of this program"), response);
  });
  server.set_error_handler([](const httplib::Request& /*from*/, httplib::Response& response) {
    if (response.body.empty()) {
      const int status = response.status;
      give(refused(status, status == 413 ? "too_large" : "bad_request",
                   status == 413 ? "the body is too large" : "the request makes no sense"),
           response);
    }
  });
}

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Server::~Server() { stop(); }

Result<std::unique_ptr<Server>> Server::open(Env& env, Api& api, const ServerOptions& options) {
  auto impl = std::make_unique<Impl>(env, api, options);
  impl->set_up();
  if (options.port == 0) {
    impl->port = impl->server.bind_to_any_port(options.bind);
  } else if (impl->server.bind_to_port(options.bind, options.port)) {
    impl->port = options.port;
  }
  if (impl->port <= 0) {
    return fail(ErrorCode::device_unavailable, "this address and port cannot be listened on",
                fmt::format("{}:{}", options.bind, options.port),
                "another station may be running; choose another --port");
  }
  impl->server.widen_backlog();
  api.set_port(impl->port);
  return std::unique_ptr<Server>(new Server(std::move(impl)));
}

int Server::port() const { return impl_->port; }
void Server::serve() { impl_->server.listen_after_bind(); }
void Server::stop() {
  impl_->stopping = true;
  impl_->server.stop();
}

}  // namespace sixpoint::station
