// The one file that uses Boost.Asio, Boost.Beast and TLS.
#include "station/page/server.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <charconv>
#include <limits>
#include <map>
#include <mutex>
#include <thread>
#include <vector>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <fmt/format.h>
#include <openssl/x509v3.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "station/page/own_address.h"

namespace sixpoint::station {

namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using asio::ip::tcp;
using asio::local::stream_protocol;
using PlainStream = beast::tcp_stream;
using LocalStream = beast::basic_stream<stream_protocol>;
using TlsStream = beast::ssl_stream<beast::tcp_stream>;
using NetworkError = boost::system::error_code;

constexpr std::chrono::milliseconds kBetweenEvents{33};
constexpr std::uint32_t kMostHead_bytes = 16U << 10U;  // a browser's request is below 2 KiB
constexpr std::size_t kMostTarget_bytes = 8192;

// "%2Fetc" -> "/etc". In a query, a plus stands for a blank.
std::string decoded(std::string_view text, bool plus_is_blank) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char* const at = text.data() + i;
    unsigned code = 0;
    if (*at == '%' && i + 2 < text.size() &&
        std::from_chars(at + 1, at + 3, code, 16).ptr == at + 3) {
      out += static_cast<char>(code);
      i += 2;
    } else {
      out += plus_is_blank && *at == '+' ? ' ' : *at;
    }
  }
  return out;
}

std::string_view bytes_of(const ASN1_STRING* text) {
  return {reinterpret_cast<const char*>(ASN1_STRING_get0_data(text)),
          static_cast<std::size_t>(ASN1_STRING_length(text))};
}

// The addresses and the names of one machine in the certificate's subjectAltName, in its order.
std::vector<std::string> names_in(const X509* certificate) {
  std::vector<std::string> names;
  const std::unique_ptr<GENERAL_NAMES, decltype(&GENERAL_NAMES_free)> all(
      static_cast<GENERAL_NAMES*>(
          X509_get_ext_d2i(certificate, NID_subject_alt_name, nullptr, nullptr)),
      GENERAL_NAMES_free);
  for (int i = 0; i < sk_GENERAL_NAME_num(all.get()); ++i) {
    const GENERAL_NAME* const each = sk_GENERAL_NAME_value(all.get(), i);
    if (each->type == GEN_DNS) {
      std::string name(bytes_of(each->d.dNSName));
      std::ranges::transform(name, name.begin(), [](char c) {
        return 'A' <= c && c <= 'Z' ? static_cast<char>(c + 32) : c;
      });
      if (!name.starts_with('*')) {
        names.push_back(std::move(name));
      }
    } else if (each->type == GEN_IPADD) {
      const std::string_view bytes = bytes_of(each->d.iPAddress);
      asio::ip::address_v4::bytes_type v4{};
      asio::ip::address_v6::bytes_type v6{};
      if (bytes.size() == v4.size()) {
        std::ranges::copy(bytes, v4.begin());
        names.push_back(asio::ip::address_v4(v4).to_string());
      } else if (bytes.size() == v6.size()) {
        std::ranges::copy(bytes, v6.begin());
        names.push_back(asio::ip::address_v6(v6).to_string());
      }
    }
  }
  return names;
}

ApiRequest request_of(const http::request_header<>& head) {
  const auto text = [](beast::string_view view) { return std::string(view.data(), view.size()); };
  ApiRequest request;
  request.method = text(head.method_string());
  request.host = text(head[http::field::host]);
  request.origin = text(head[http::field::origin]);
  request.fetch_site = text(head["Sec-Fetch-Site"]);
  request.authorization = text(head[http::field::authorization]);
  request.cookie = text(head[http::field::cookie]);
  request.client = text(head["X-Sixpoint-Client"]);
  request.before = text(head["X-Sixpoint-Before"]);
  const std::string target = text(head.target());
  const std::size_t path_end = std::min(target.find('?'), target.size());
  request.path = decoded(std::string_view(target).substr(0, path_end), false);
  std::string_view query = std::string_view(target).substr(std::min(path_end + 1, target.size()));
  while (!query.empty()) {
    const std::string_view item = query.substr(0, query.find('&'));
    query.remove_prefix(std::min(item.size() + 1, query.size()));
    const std::size_t name_end = std::min(item.find('='), item.size());
    request.parameters.emplace(decoded(item.substr(0, name_end), true),
                               decoded(item.substr(std::min(name_end + 1, item.size())), true));
  }
  return request;
}

ApiAnswer refused(int status, std::string_view code, std::string_view what) {
  return {status,
          "application/json",
          fmt::format(R"({{"error":{{"code":"{}","what":"{}","hint":""}}}})", code, what),
          {{"X-Content-Type-Options", "nosniff"}, {"Cache-Control", "no-store"}}};
}

bool is_malformed(const NetworkError& error) {
  return error.category() == http::make_error_code(http::error::bad_method).category() &&
         error != http::error::end_of_stream && error != http::error::partial_message;
}

}  // namespace

struct Server::Impl {
  class Idle {
   public:
    virtual ~Idle() = default;
    virtual void close_oldest() = 0;
  };
  template <class Stream>
  class Connection;

  Impl(Env& its_env, Api& its_api, const ServerOptions& its_options)
      : env(its_env), api(its_api), options(its_options) {}
  Status listen();
  Status use_tls();
  Status listen_locally();
  void accept();
  void accept_locally();
  template <class Stream, class Socket, class... TlsContext>
  void begin(Socket socket, TlsContext&... tls_context);

  Env& env;
  Api& api;
  const ServerOptions options;
  std::mutex mutex;  // guards `idle`
  // By order of arrival: connections whose request is not complete, or whose answer was sent.
  std::map<std::uint64_t, std::weak_ptr<Idle>> idle;
  std::atomic<std::uint64_t> arrivals = 0;
  std::optional<asio::ssl::context> tls;  // where it serves https
  std::vector<std::string> names;         // in its certificate
  asio::io_context io;  // its destructor ends the connections, which use the members above
  tcp::acceptor acceptor{io};
  stream_protocol::acceptor local_acceptor{io};
};

// One request and its answer, or one event stream. Everything runs on the connection's strand, and
// every pending operation holds a shared_ptr to the connection.
template <class Stream>
class Server::Impl::Connection : public Idle,
                                 public std::enable_shared_from_this<Connection<Stream>> {
 public:
  template <class Socket, class... TlsContext>
  Connection(Impl& server, std::uint64_t number, Socket socket, TlsContext&... tls_context)
      : server_(server),
        number_(number),
        stream_(std::move(socket), tls_context...),
        timer_(stream_.get_executor()) {
    NetworkError ignored;  // neither is needed for a right answer
    if constexpr (!kIsLocal) {
      plain().socket().set_option(tcp::no_delay(true), ignored);
    }
    plain().socket().set_option(
        asio::socket_base::send_buffer_size(server_.options.most_unread_bytes), ignored);
    parser_.header_limit(kMostHead_bytes);
    parser_.body_limit(std::numeric_limits<std::uint64_t>::max());  // on_head() has the limit
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection() override { set_idle(false); }

  void start() {
    asio::dispatch(stream_.get_executor(), [self = this->shared_from_this()] {
      self->limit_time();
      if constexpr (std::is_same_v<Stream, TlsStream>) {
        self->stream_.async_handshake(asio::ssl::stream_base::server,
                                      self->then(&Connection::read_head));
      } else {
        self->read_head();
      }
    });
  }

  // There are too many idle connections, and this is the oldest.
  void close_oldest() override {
    asio::post(stream_.get_executor(), [self = this->shared_from_this()] {
      if (!self->busy_) {
        self->plain().close();
      }
    });
  }

  void set_idle(bool is_idle) {
    const std::lock_guard lock(server_.mutex);
    if (is_idle) {
      server_.idle.emplace(number_, this->weak_from_this());
    } else {
      server_.idle.erase(number_);
    }
  }

 private:
  static constexpr bool kIsLocal = std::is_same_v<Stream, LocalStream>;

  // Handler of an operation: goes on with `next`; closes the connection on an error.
  auto then(void (Connection::*next)()) {
    return [self = this->shared_from_this(), next](const NetworkError& error,
                                                   std::size_t /*bytes*/ = 0) {
      error ? self->plain().close() : (self.get()->*next)();
    };
  }
  // The stream of the socket, below TLS where there is any.
  auto& plain() { return beast::get_lowest_layer(stream_); }
  void limit_time() {
    plain().expires_after(std::chrono::seconds(server_.options.request_time_out_s));
  }

  void read_head() {
    http::async_read_header(
        stream_, buffer_, parser_,
        [self = this->shared_from_this()](const NetworkError& error, std::size_t /*bytes*/) {
          self->on_head(error);
        });
  }
  void on_head(const NetworkError& error) {
    if (is_malformed(error)) {
      return respond(refused(400, "bad_request", "the request makes no sense"));
    }
    if (error) {
      return plain().close();
    }
    const auto& head = parser_.get();
    if (head.count(http::field::host) > 1) {  // RFC 9112, 3.2
      return respond(refused(400, "bad_request", "the request names more than one host"));
    }
    request_ = request_of(head);
    request_.is_local_user = kIsLocal;
    // Before the body is read: a client without permission does not send a body either.
    if (const auto refusal = server_.api.guard(request_)) {
      return respond(*refusal);
    }
    if (head.target().size() > kMostTarget_bytes) {
      return respond(refused(414, "bad_request", "the request makes no sense"));
    }
    // A chunked body has no length in advance; a compressed one unpacks to a hundred times its
    // size.
    if (head.count(http::field::transfer_encoding) + head.count(http::field::content_encoding) >
        0) {
      return respond(refused(411, "length_required", "send the body plain and with its length"));
    }
    const std::uint64_t body_bytes = parser_.content_length().value_or(0);
    if (head.method() != http::verb::post || body_bytes == 0) {
      return handle();
    }
    if (body_bytes > server_.options.most_body_bytes) {
      return respond(refused(413, "too_large", "the body is too large"));
    }
    http::async_read(stream_, buffer_, parser_, then(&Connection::handle));
  }

  void handle() {
    busy_ = true;
    set_idle(false);
    request_.body = std::move(parser_.get().body());
    try {
      if (request_.path == "/api/events" && request_.method == "GET") {
        return stream_events();
      }
      respond(server_.api.handle(request_));
    } catch (const std::exception&) {
      respond(refused(500, "internal", "a defect of this program"));
    }
  }

  void respond(const ApiAnswer& answer) {
    response_.result(static_cast<unsigned>(answer.status));
    response_.set(http::field::content_type, answer.content_type);
    for (const auto& [name, value] : answer.headers) {
      response_.set(name, value);
    }
    response_.keep_alive(false);
    response_.content_length(answer.body.size());
    response_.body() = request_.method == "HEAD" ? std::string() : answer.body;
    limit_time();
    http::async_write(stream_, response_, then(&Connection::finish));
  }

  // The client may still send a body that was refused. To close now would reset the connection, and
  // the client would lose the answer.
  void finish() {
    NetworkError ignored;
    plain().socket().shutdown(asio::socket_base::shutdown_send, ignored);
    busy_ = false;
    set_idle(true);
    limit_time();
    discard_input();
  }
  // Below TLS: what comes is not read.
  void discard_input() {
    plain().async_read_some(asio::buffer(discarded_), then(&Connection::discard_input));
  }

  void stream_events() {
    events_ = server_.api.open_events();
    if (!events_) {
      ApiAnswer refusal = refused(503, "too_many_streams", "too many pages are open; close some");
      refusal.headers.emplace_back("Retry-After", "5");
      return respond(refusal);
    }
    plain().expires_never();
    discard_input();  // ends the connection when the client closes it
    write_events(
        "HTTP/1.1 200 OK\r\nCache-Control: no-store\r\nConnection: close\r\n"
        "Content-Type: text/event-stream\r\nTransfer-Encoding: chunked\r\n"
        "X-Content-Type-Options: nosniff\r\n\r\n");
  }
  void write_events(std::string text) {
    text_ = std::move(text);
    limit_time();  // of the write alone: the read of discard_input() is under way
    asio::async_write(stream_, asio::buffer(text_), then(&Connection::wait_for_events));
  }
  void wait_for_events() {
    timer_.expires_after(kBetweenEvents);
    timer_.async_wait(then(&Connection::send_events));
  }
  void send_events() {
    if (!plain().socket().is_open()) {
      return;
    }
    try {
      const std::string text = events_->next();
      text.empty() ? wait_for_events()
                   : write_events(fmt::format("{:x}\r\n{}\r\n", text.size(), text));
    } catch (const std::exception&) {  // as in handle(); the page opens another stream
      plain().close();
    }
  }

  Impl& server_;
  const std::uint64_t number_;
  Stream stream_;
  asio::steady_timer timer_;
  beast::flat_buffer buffer_;
  http::request_parser<http::string_body> parser_;
  ApiRequest request_;
  http::response<http::string_body> response_;
  std::unique_ptr<EventStream> events_;
  std::string text_;  // of events, while it is written
  std::array<char, 4096> discarded_{};
  bool busy_ = false;
};

Status Server::Impl::listen() {
  NetworkError error;
  tcp::resolver resolver(io);
  const auto all =
      resolver.resolve(options.bind, std::to_string(options.port), tcp::resolver::passive, error);
  if (error) {
    return fail(ErrorCode::device_unavailable,
                "this machine finds no address of that name: " + error.message(),
                "--bind " + printable(options.bind, 80), "name an address of this machine");
  }
  for (const auto& found : all) {
    try {
      acceptor = tcp::acceptor(io, found.endpoint());
      return {};
    } catch (const boost::system::system_error&) {
      continue;  // the name may have another address
    }
  }
  return fail(ErrorCode::device_unavailable, "this address and port cannot be listened on",
              fmt::format("{}:{}", options.bind, options.port),
              "another station may be running; choose another --port");
}

// Of the user who runs this program; the mode of the socket's file says the same.
bool is_own_user(stream_protocol::socket& socket) {
  ucred peer{};
  socklen_t size = sizeof(peer);
  return ::getsockopt(socket.native_handle(), SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 &&
         peer.uid == ::geteuid();
}

Status Server::Impl::listen_locally() {
  if (options.unix_socket.empty()) {
    return {};
  }
  const std::string& path = options.unix_socket;
  if (path.size() >= sizeof(sockaddr_un{}.sun_path)) {
    return fail(ErrorCode::usage, "the name of this socket is too long", path,
                "107 bytes at most: name one in /run/user");
  }
  const stream_protocol::endpoint endpoint(path);
  NetworkError error;
  if (const auto there = env.files.link_info(path)) {
    if (there->kind != FileKind::socket) {
      return fail(ErrorCode::usage, "there is something of that name that is no socket", path,
                  "choose another --socket");
    }
    stream_protocol::socket probe{io};
    probe.connect(endpoint, error);
    if (error != asio::error::connection_refused) {
      return fail(ErrorCode::device_unavailable, "another program listens on this socket", path,
                  "choose another --socket");
    }
    SIXPOINT_CHECK(env.files.remove(path));  // a station that was killed left it
  }
  local_acceptor.open(endpoint.protocol(), error);
  // Before the socket has its name: there is no moment in which others may connect.
  if (error || ::fchmod(local_acceptor.native_handle(), S_IRUSR | S_IWUSR) != 0 ||
      local_acceptor.bind(endpoint, error) ||
      local_acceptor.listen(asio::socket_base::max_listen_connections, error)) {
    return fail(ErrorCode::cannot_create, "this socket cannot be made", path,
                "name it in a folder that is there and that you may write");
  }
  return {};
}

void Server::Impl::accept_locally() {
  local_acceptor.async_accept(
      asio::make_strand(io), [this](const NetworkError& error, stream_protocol::socket socket) {
        if (error) {
          env.clock.sleep(std::chrono::milliseconds(1));  // no descriptor is free
        }
        accept_locally();  // before what may throw
        if (!error && is_own_user(socket)) {
          begin<LocalStream>(std::move(socket));
        }
      });
}

void Server::Impl::accept() {
  acceptor.async_accept(
      asio::make_strand(io), [this](const NetworkError& error, tcp::socket socket) {
        if (error) {
          env.clock.sleep(std::chrono::milliseconds(1));  // no descriptor is free
        }
        accept();  // before what may throw
        if (!error) {
          tls ? begin<TlsStream>(std::move(socket), *tls) : begin<PlainStream>(std::move(socket));
        }
      });
}

template <class Stream, class Socket, class... TlsContext>
void Server::Impl::begin(Socket socket, TlsContext&... tls_context) {
  auto connection =
      std::make_shared<Connection<Stream>>(*this, ++arrivals, std::move(socket), tls_context...);
  connection->set_idle(true);
  connection->start();
  std::shared_ptr<Idle> oldest;
  {
    const std::lock_guard lock(mutex);
    if (idle.size() > options.most_idle) {
      oldest = idle.begin()->second.lock();
      idle.erase(idle.begin());
    }
  }
  if (oldest) {
    oldest->close_oldest();
  }
}

Status Server::Impl::use_tls() {
  if (options.tls_certificate.empty() && options.tls_key.empty()) {
    return {};
  }
  tls.emplace(asio::ssl::context::tls_server);
  SSL_CTX_set_min_proto_version(tls->native_handle(), TLS1_2_VERSION);
  NetworkError error;
  tls->use_certificate_chain(asio::buffer(options.tls_certificate), error);
  if (!error) {
    tls->use_private_key(asio::buffer(options.tls_key), asio::ssl::context::pem, error);
  }
  if (error || SSL_CTX_check_private_key(tls->native_handle()) != 1) {
    return fail(ErrorCode::bad_data, "this certificate and this key do not go together", {},
                "give PEM files: the certificate with its chain, and its key without a password");
  }
  names = names_in(SSL_CTX_get0_certificate(tls->native_handle()));
  api.set_names(names);
  return {};
}

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Server::~Server() {
  stop();
  if (impl_->local_acceptor.is_open()) {
    static_cast<void>(impl_->env.files.remove(impl_->options.unix_socket));
  }
}

Result<std::unique_ptr<Server>> Server::open(Env& env, Api& api, const ServerOptions& options) {
  auto impl = std::make_unique<Impl>(env, api, options);
  SIXPOINT_CHECK(impl->use_tls());
  SIXPOINT_CHECK(impl->listen());
  SIXPOINT_CHECK(impl->listen_locally());
  std::unique_ptr<Server> server(new Server(std::move(impl)));
  api.set_port(server->port());
  return server;
}

std::string Server::host() const {
  std::string host = impl_->options.bind;
  NetworkError error;
  if (const auto bind = asio::ip::make_address(host, error); !error && bind.is_unspecified()) {
    if (const auto name = std::ranges::find_if_not(impl_->names, is_loopback);
        name != impl_->names.end()) {
      host = printable(*name, 255);
    } else {
      // Connecting sends nothing: the system chooses the address by which it would send.
      asio::ip::udp::socket socket(impl_->io);
      asio::ip::udp::endpoint local;
      if (!socket.open(asio::ip::udp::v4(), error) &&
          !socket.connect({asio::ip::make_address("192.0.2.1"), 9}, error)) {  // RFC 5737: no one's
        local = socket.local_endpoint(error);
      }
      // Without a default route it chooses none.
      host = error || local.address().is_unspecified()
                 ? choose_address(addresses_of_machine(), bind.is_v6())
                 : local.address().to_string();
    }
  }
  return host.find(':') == std::string::npos ? host : '[' + host + ']';
}

int Server::port() const { return impl_->acceptor.local_endpoint().port(); }

void Server::serve() {
  impl_->accept();
  if (impl_->local_acceptor.is_open()) {
    impl_->accept_locally();
  }
  std::vector<std::jthread> threads;
  for (std::size_t i = 0; i < impl_->options.threads; ++i) {
    threads.emplace_back([this] {
      for (;;) {
        try {
          impl_->io.run();
          return;
        } catch (const std::exception&) {
          // Its connection ends with the handler that threw; the lanes and the others go on.
        }
      }
    });
  }
}

void Server::stop() { impl_->io.stop(); }

}  // namespace sixpoint::station
