// The seam to cpp-httplib: sockets in, Api (api.h) behind them.
#pragma once

#include <memory>
#include <string>

#include "base/env.h"
#include "base/result.h"
#include "station/api.h"

namespace sixpoint::station {

struct ServerOptions {
  std::string bind = "127.0.0.1";
  int port = 0;  // 0: any that is free
  // Requests are small JSON objects.
  std::size_t most_body_bytes = 64U << 10U;
  // Threads that answer; every event stream holds one of them.
  std::size_t threads = 48;
  // For a request, from connecting to its end, and for every write that the client does not take.
  int request_time_out_s = 5;
  // Connections whose request is not there yet. Below the 1,024 descriptors that a process usually
  // has; sixteen lanes and their pages need two hundred.
  std::size_t most_waiting = 512;
};

class Server {
 public:
  // Listens; answers once serve() runs. device_unavailable when the address or port is taken.
  static Result<std::unique_ptr<Server>> open(Env& env, Api& api, const ServerOptions& options);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  int port() const;
  void serve();  // until stop()
  void stop();   // from any thread

 private:
  struct Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sixpoint::station
