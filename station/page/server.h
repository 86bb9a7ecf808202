// The HTTP server of the page: sockets here, routes and answers in Api (api.h).
//
//   ServerOptions options;
//   options.port = 6020;
//   SIXPOINT_ASSIGN(const auto server, Server::open(env, api, options));
//   std::jthread ender([&] {
//     end.wait(false);  // until a signal sets it
//     server->stop();
//   });
//   server->serve();
//
// One request per connection. A connection that sends nothing, or sends slowly, costs a descriptor
// and no thread. Boost.Beast and OpenSSL's TLS are used in server.cpp alone.
#pragma once

#include <memory>
#include <string>

#include "base/env.h"
#include "base/result.h"
#include "station/page/api.h"

namespace sixpoint::station {

struct ServerOptions {
  std::string bind = "127.0.0.1";
  int port = 0;  // 0: any that is free
  // Requests are small JSON objects.
  std::size_t most_body_bytes = 64U << 10U;
  // Threads that answer. An answer may wait for the store.
  std::size_t threads = 16;
  // From connecting to the end of the request, and for every write.
  int request_time_out_s = 5;
  // Connections without a complete request; above this the oldest is closed. Below the 1,024
  // descriptors that a process usually has; sixteen lanes and their pages need two hundred.
  std::size_t most_idle = 512;
  // Events that wait for a page that does not read them. The time-out above begins when they are
  // more; a page that reads has a few KiB waiting.
  int most_unread_bytes = 128 << 10;
  // A unix socket for programs of the same user: the same interface, without session or token. Mode
  // 0600, and other users are refused by their number too. Empty: none. One that a killed station
  // left is replaced; anything else of that name is not.
  std::string unix_socket = {};
  // PEM; both empty: plain HTTP. The names in the certificate are names of the station
  // (Api::set_names); one with a * is not, because it is a name of other machines too.
  std::string tls_certificate = {};
  std::string tls_key = {};
};

class Server {
 public:
  // Listens; answers once serve() runs. device_unavailable when the address, port or socket is
  // taken, usage where the socket's name is too long or is that of another file, bad_data for a
  // certificate and key that do not go together. `env` and `api` outlive the server.
  static Result<std::unique_ptr<Server>> open(Env& env, Api& api, const ServerOptions& options);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  int port() const;
  // The host of the page's address: `bind`. 0.0.0.0 and :: stand for all addresses of this machine
  // and open nothing elsewhere: for them the first name or address of the certificate
  // (subjectAltName) that is not this machine's for itself (127.0.0.1), else an address of this
  // machine (own_address.h).
  std::string host() const;
  void serve();  // until stop()
  void stop();   // from any thread

 private:
  struct Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sixpoint::station
