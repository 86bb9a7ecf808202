#include "station/server.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <utility>

#include <fmt/format.h>
#include <httplib.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "station/waiting_room.h"

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

// A request of which the head was read already. Everything else of it must come before the
// deadline: the library would wait for every byte anew.
class Connection final : public httplib::Stream {
 public:
  Connection(int socket, std::string request, std::chrono::seconds time_out)
      : socket_(socket), request_(std::move(request)), time_out_(time_out) {}
  bool is_readable() const override { return at_ < request_.size() || ready(POLLIN, left()); }
  bool is_writable() const override {
    return ready(POLLOUT, time_out_) && !ready(POLLRDHUP, std::chrono::milliseconds(0));
  }
  ssize_t read(char* to, std::size_t size) override {
    if (at_ < request_.size()) {
      const std::size_t count = request_.copy(to, size, at_);
      at_ += count;
      return static_cast<ssize_t>(count);
    }
    return ready(POLLIN, left()) ? ::recv(socket_, to, size, 0) : -1;
  }
  ssize_t write(const char* from, std::size_t size) override {
    return ready(POLLOUT, time_out_) ? ::send(socket_, from, size, MSG_NOSIGNAL | MSG_DONTWAIT)
                                     : -1;
  }
  void get_remote_ip_and_port(std::string& /*ip*/, int& /*port*/) const override {}
  void get_local_ip_and_port(std::string& /*ip*/, int& /*port*/) const override {}
  int socket() const override { return socket_; }

 private:
  std::chrono::milliseconds left() const {
    const auto left = deadline_ - std::chrono::steady_clock::now();
    return std::max(std::chrono::milliseconds(0),
                    std::chrono::ceil<std::chrono::milliseconds>(left));
  }
  bool ready(short what, std::chrono::milliseconds within) const {
    pollfd one{socket_, what, 0};
    return ::poll(&one, 1, static_cast<int>(within.count())) > 0 && (one.revents & what) != 0;
  }

  int socket_;
  std::string request_;
  std::size_t at_ = 0;
  std::chrono::milliseconds time_out_;
  std::chrono::steady_clock::time_point deadline_ = std::chrono::steady_clock::now() + time_out_;
};

// The library gives every connection a thread as soon as it is made, before it has said anything.
// Here it waits in a room with all others until its request is there.
class PatientServer : public httplib::Server {
 public:
  // The library lets five connections wait to be accepted; a burst of pages would wait for seconds.
  void widen_backlog() { ::listen(svr_sock_, 256); }

  void receive(const ServerOptions& options) {
    new_task_queue = [this, &options] {
      auto* reception = new Reception(options, [this](int socket, std::string request) {
        bool closed = false;
        Connection connection(socket, std::move(request), std::chrono::seconds(read_timeout_sec_));
        process_request(connection, true, closed, nullptr);
        ::shutdown(socket, SHUT_RDWR);
        ::close(socket);
      });
      reception_ = reception;
      return reception;
    };
  }

 private:
  // What the library takes for its queue of threads: accepted connections go into the room at once,
  // requests to the threads.
  class Reception final : public httplib::TaskQueue {
   public:
    Reception(const ServerOptions& options,
              const std::function<void(int socket, std::string request)>& answer)
        : threads_(options.threads),
          room_(waiting(options), [this, answer](int socket, std::string request) {
            threads_.enqueue([answer, socket, its_request = std::move(request)]() mutable {
              answer(socket, std::move(its_request));
            });
          }) {}
    void enqueue(std::function<void()> accept) override { accept(); }
    void shutdown() override {
      room_.stop();
      threads_.shutdown();
    }
    void enter(int socket) { room_.enter(socket); }

   private:
    static WaitingRoomOptions waiting(const ServerOptions& options) {
      WaitingRoomOptions waiting;
      waiting.most_connections = options.most_waiting;
      waiting.most_body_bytes = options.most_body_bytes;
      waiting.time_out = std::chrono::seconds(options.request_time_out_s);
      return waiting;
    }
    httplib::ThreadPool threads_;
    WaitingRoom room_;
  };

  bool process_and_close_socket(socket_t socket) override {
    // A page that does not read what it is sent is let go of, and holds little until then.
    const int most_unread_bytes = 128 << 10;
    ::setsockopt(socket, SOL_SOCKET, SO_SNDBUF, &most_unread_bytes, sizeof(most_unread_bytes));
    reception_->enter(socket);
    return true;
  }

  Reception* reception_ = nullptr;  // the library's, while it listens
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
  server.receive(options);
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
