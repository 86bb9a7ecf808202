#include "postgres_server.h"

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <fcntl.h>
#include <libpq-fe.h>
#include <netinet/in.h>
#include <pwd.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

namespace sixpoint::db::tests {
namespace {

// Debian keeps the server's programs out of PATH, a folder per version; the newest. Empty where
// there is none.
std::string programs() {
  std::string newest;
  int newest_version = 0;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/usr/lib/postgresql", error)) {
    const int version = std::atoi(entry.path().filename().c_str());
    if (version > newest_version && std::filesystem::exists(entry.path() / "bin/initdb")) {
      newest_version = version;
      newest = entry.path() / "bin/";
    }
  }
  return newest;
}

int free_port() {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  if (::bind(socket, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
      ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    throw std::runtime_error("no free port on loopback");
  }
  ::close(socket);
  return ntohs(address.sin_port);
}

// The server refuses to run as root.
const passwd* unprivileged() { return ::geteuid() == 0 ? ::getpwnam("postgres") : nullptr; }

std::string text_of_file(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

pid_t spawn(const std::vector<std::string>& words, const std::string& log, bool dies_with_us,
            [[maybe_unused]] const std::string& full_disk_flag = {}) {
  std::vector<char*> arguments;
  for (const std::string& word : words) {
    arguments.push_back(const_cast<char*>(word.c_str()));
  }
  arguments.push_back(nullptr);
  const passwd* user = unprivileged();
  const pid_t child = ::fork();
  if (child != 0) {
    return child;
  }
  if (user != nullptr && (::setgid(user->pw_gid) != 0 || ::setuid(user->pw_uid) != 0)) {
    ::_exit(126);
  }
  if (dies_with_us) {
    ::prctl(PR_SET_PDEATHSIG, SIGQUIT);
  }
#ifdef SIXPOINT_FULL_DISK_PRELOAD
  if (!full_disk_flag.empty()) {
    ::setenv("LD_PRELOAD", (full_disk_flag + ".so").c_str(), 1);
    ::setenv("SIXPOINT_FULL_DISK", full_disk_flag.c_str(), 1);
  }
#endif
  const int out = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
  ::dup2(out, STDOUT_FILENO);
  ::dup2(out, STDERR_FILENO);
  ::execv(arguments[0], arguments.data());
  ::_exit(127);
}

bool answers(const std::string& location) {
  PGconn* connection = ::PQconnectdb(location.c_str());
  const bool good = ::PQstatus(connection) == CONNECTION_OK;
  ::PQfinish(connection);
  return good;
}

}  // namespace

std::string PostgresServer::missing() {
  if (programs().empty()) {
    return "Debian's package 'postgresql' is not installed";
  }
  if (::geteuid() == 0 && unprivileged() == nullptr) {
    return "the user 'postgres' of Debian's package 'postgresql' is not there";
  }
  return "";
}

int PostgresServer::run(const std::string& program, const std::string& arguments) const {
  std::vector<std::string> words = {programs() + program};
  std::istringstream split(arguments);
  for (std::string word; split >> word;) {
    words.push_back(word);
  }
  const pid_t child = spawn(words, folder_ / "log", false);
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

PostgresServer::PostgresServer() : port_(free_port()) {
  if (const passwd* user = unprivileged(); user != nullptr) {
    if (::chown(folder_.path().c_str(), user->pw_uid, user->pw_gid) != 0) {
      throw std::runtime_error("cannot give the temporary folder to the server's user");
    }
  }
  const std::string data = folder_ / "data";
  if (run("initdb", "-D " + data + " -U postgres -E UTF8 --locale=C --auth=trust") != 0) {
    throw std::runtime_error("initdb fails: " + text_of_file(folder_ / "log"));
  }
  std::ofstream(data + "/pg_hba.conf") << "local all postgres trust\n"
                                          "host all all 127.0.0.1/32 scram-sha-256\n";
  start();
  PGconn* connection = ::PQconnectdb(superuser("postgres").c_str());
  const std::string role =
      std::string("CREATE ROLE station LOGIN CREATEDB PASSWORD '") + kPassword + "'";
  ::PQclear(::PQexec(connection, role.c_str()));
  ::PQfinish(connection);
}

PostgresServer::~PostgresServer() { kill(); }

void PostgresServer::start() {
#ifdef SIXPOINT_FULL_DISK_PRELOAD
  // A copy that the server's user can read, wherever the build lies.
  std::filesystem::copy_file(SIXPOINT_FULL_DISK_PRELOAD, folder_ / "full.so",
                             std::filesystem::copy_options::skip_existing);
  std::filesystem::permissions(folder_ / "full.so", std::filesystem::perms(0755));
#endif
  const std::string options[] = {folder_ / "data", std::to_string(port_), folder_.path()};
  pid_ = spawn({programs() + "postgres", "-D", options[0], "-p", options[1], "-k", options[2], "-c",
                "listen_addresses=127.0.0.1", "-c", "fsync=on", "-c", "max_connections=60"},
               folder_ / "log", true, folder_ / "full");
  for (int i = 0; i < 600; ++i) {
    if (answers(superuser("postgres"))) {
      return;
    }
    int status = 0;
    if (::waitpid(pid_, &status, WNOHANG) == pid_) {
      // Processes of the server that was killed may hold its memory for a moment.
      if (i > 100) {
        break;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      return start();
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  throw std::runtime_error("the server does not start: " + text_of_file(folder_ / "log"));
}

std::string PostgresServer::make_database(const std::string& name) {
  PGconn* connection = ::PQconnectdb(superuser("postgres").c_str());
  PGresult* result =
      ::PQexec(connection, ("CREATE DATABASE \"" + name + "\" OWNER station").c_str());
  const bool good = ::PQresultStatus(result) == PGRES_COMMAND_OK;
  const std::string words = ::PQerrorMessage(connection);
  ::PQclear(result);
  ::PQfinish(connection);
  if (!good) {
    throw std::runtime_error("cannot make the database: " + words);
  }
  return location(name);
}

void PostgresServer::fill_disk(bool full) {
  if (full) {
    std::ofstream(folder_ / "full") << "full";
  } else {
    std::filesystem::remove(folder_ / "full");
  }
}

void PostgresServer::kill() {
  if (pid_ <= 0) {
    return;
  }
  // Its own processes, by the kernel's list of children, then itself.
  const std::string list =
      "/proc/" + std::to_string(pid_) + "/task/" + std::to_string(pid_) + "/children";
  std::vector<pid_t> children;
  std::istringstream split(text_of_file(list));
  for (pid_t child = 0; split >> child;) {
    children.push_back(child);
  }
  ::kill(pid_, SIGKILL);
  for (const pid_t child : children) {
    ::kill(child, SIGKILL);
  }
  ::waitpid(pid_, nullptr, 0);
  pid_ = -1;
}

std::string PostgresServer::location(const std::string& database,
                                     const std::string& password) const {
  std::string escaped;
  for (const char c : password) {
    escaped += c == '/' ? "%2F" : c == '@' ? "%40" : std::string(1, c);
  }
  return "postgresql://station:" + escaped + "@127.0.0.1:" + std::to_string(port_) + "/" + database;
}

std::string PostgresServer::superuser(const std::string& database) const {
  return "host=" + folder_.path() + " port=" + std::to_string(port_) +
         " user=postgres dbname=" + database;
}

PostgresServer& server() {
  static PostgresServer one;
  return one;
}

}  // namespace sixpoint::db::tests
