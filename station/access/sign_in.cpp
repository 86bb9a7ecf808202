#include "station/access/sign_in.h"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "station/access/secrets.h"

namespace sixpoint::station {

namespace {

constexpr std::size_t kMostCodes = 16;  // that wait for their browsers; more push out the oldest
constexpr std::size_t kMostTokenBytes = 200;

// As a person types it -> as random_code() makes it.
std::string plain_code(std::string_view typed) {
  std::string code;
  for (const char c : typed.substr(0, kMostTokenBytes)) {
    if (c != '-' && c != ' ') {
      code += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
    }
  }
  return code;
}

std::int64_t unix_s(Clock& clock) {
  return std::chrono::duration_cast<std::chrono::seconds>(clock.now().time_since_epoch()).count();
}

// The keyed hash of what stands before it. The word keeps it apart from other uses of the token.
std::string seal_of(const std::string& token, std::string_view session) {
  return keyed_hash(token, fmt::format("sixpoint session {}", session));
}

}  // namespace

Result<std::string> read_or_make_token(FileSystem& files, const std::string& path) {
  if (const auto there = files.info(path); !there && there.error().code == ErrorCode::no_input) {
    const std::string token = random_hex(16);
    SIXPOINT_CHECK(make_private_folders(files, folder_of(path)));
    SIXPOINT_CHECK(write_private_file(files, path, token + "\n"));
    return token;
  }
  SIXPOINT_ASSIGN(const Bytes bytes, read_file(files, path, 4096));
  std::string token(bytes.begin(), bytes.end());
  token.resize(std::min(token.find_first_of("\r\n"), token.size()));
  const bool is_plain = std::all_of(token.begin(), token.end(), [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
           std::string_view("-_.~").find(c) != std::string_view::npos;
  });
  if (token.size() < kFewestTokenBytes || token.size() > kMostTokenBytes || !is_plain) {
    return fail(ErrorCode::bad_data,
                fmt::format("a token is {} to {} letters, digits and -_.~", kFewestTokenBytes,
                            kMostTokenBytes),
                path, "remove the file: the station makes a new one");
  }
  return token;
}

bool is_loopback(std::string_view address) {
  return address == "127.0.0.1" || address == "localhost" || address == "[::1]" || address == "::1";
}

Status may_listen(const std::string& address, bool has_certificate, bool has_key) {
  if (has_certificate != has_key) {
    return fail(ErrorCode::usage, "TLS needs a certificate and its key", {},
                "give both --tls-cert and --tls-key");
  }
  if (!is_loopback(address) && !has_certificate) {
    return fail(ErrorCode::usage,
                fmt::format("on {} others could read what goes to and from this station: it needs "
                            "--tls-cert and --tls-key",
                            printable(address, 60)),
                {}, "docs/security.md has the line that makes them; or leave --bind out");
  }
  return {};
}

SignIn::SignIn(Clock& clock, std::string token)
    : clock_(clock), token_(std::move(token)), first_code_(random_code()) {}

std::string SignIn::new_code() {
  const std::lock_guard lock(mutex_);
  if (codes_.size() >= kMostCodes) {
    codes_.erase(std::min_element(codes_.begin(), codes_.end(), [](const auto& a, const auto& b) {
      return a.second < b.second;
    }));
  }
  std::string code = random_code();
  codes_.emplace(plain_code(code), clock_.elapsed());
  return code;
}

std::optional<std::string> SignIn::session_for(std::string_view shown) {
  const std::string code = plain_code(shown);
  bool permitted = is_token(shown);
  if (!permitted) {
    const std::lock_guard lock(mutex_);
    if (same_secret(code, plain_code(first_code_))) {
      permitted = !std::exchange(first_code_is_used_, true);
    } else if (const auto found = codes_.find(code); found != codes_.end()) {
      permitted = clock_.elapsed() - found->second <= kCodeLife;
      codes_.erase(found);
    }
  }
  if (!permitted) {
    return std::nullopt;
  }
  const std::string session = fmt::format("{}.{}", unix_s(clock_), random_hex(16));
  return fmt::format("{}.{}", session, seal_of(token_, session));
}

bool SignIn::session_holds(std::string_view session) const {
  const std::size_t seal_at = std::min(session.rfind('.'), session.size());
  const std::string_view sealed = session.substr(0, seal_at);
  if (seal_at == session.size() ||
      !same_secret(session.substr(seal_at + 1), seal_of(token_, sealed))) {
    return false;
  }
  std::int64_t made_s = 0;
  std::from_chars(sealed.data(), sealed.data() + sealed.size(), made_s);
  const std::chrono::seconds age(unix_s(clock_) - made_s);
  return age <= kSessionLife && age >= std::chrono::minutes(-10);  // a clock may be set a little
}

bool SignIn::is_token(std::string_view shown) const { return same_secret(shown, token_); }

}  // namespace sixpoint::station
