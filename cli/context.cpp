#include "cli/context.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <ctime>
#include <filesystem>

#include <fmt/format.h>
#include <spdlog/logger.h>
#include <spdlog/sinks/ostream_sink.h>

#include "cli/stop_request.h"
#include "repair/batch/answers.h"

namespace sixpoint::cli {

namespace {

// The rank of an exit code in the table of Context::worsen().
int rank(int code) {
  switch (code) {
    case kExitInconclusive:
      return 1;
    case kExitFailed:
      return 2;
    default:
      return code;
  }
}

}  // namespace

spdlog::logger& Context::log() {
  if (logger == nullptr) {
    logger = std::make_shared<spdlog::logger>(
        "sixpoint", std::make_shared<spdlog::sinks::ostream_sink_mt>(people, /*force_flush=*/true));
    logger->set_pattern("sixpoint: %v");
  }
  return *logger;
}

void Context::worsen(int code) {
  if (rank(code) > rank(exit_code)) {
    exit_code = code;
  }
}

void Context::worsen_as_incomplete() { exit_code = std::max(exit_code, kExitInconclusive); }

int exit_of_stop(int signal) {
  return signal == SIGINT || signal == SIGHUP ? kExitStopped : kExitPassed;
}

void take_stop(Context& context, int signal) { context.worsen(exit_of_stop(signal)); }

Json document(std::string_view command) {
  Json json;
  json["schema"] = fmt::format("sixpoint/{}/1", command);
  return json;
}

void write_document(Context& context, std::string_view text) {
  sigset_t before;
  sigset_t too_late = block_stop_signals(&before);
  context.out << text << std::flush;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    if (sigismember(&before, signal) == 1) {
      sigdelset(&too_late, signal);  // held back before: who did that asks for it
    }
  }
  const timespec at_once{};
  while (sigtimedwait(&too_late, nullptr, &at_once) > 0) {
  }
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

Status print_json(Context& context, const Json& json) {
  // A file may hold bytes that are not UTF-8: they are replaced.
  write_document(context, json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n');
  return {};
}

Status print_answer(Context& context, bool as_json, const Json& json, std::string_view text) {
  if (as_json) {
    return print_json(context, json);
  }
  context.text() << text;
  return {};
}

Json error_to_json(const Error& error) { return repair::error_document(error); }

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json text_or_null(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

void report_error(Context& context, const Error& error) {
  context.log().error(error.brief());
  context.worsen(error.code);
}

void report_error(Context& context, std::string_view command, const Error& error, bool json) {
  report_error(context, error);
  if (json) {
    Json document_of_error = document(command);
    document_of_error["error"] = error_to_json(error);
    print_json(context, document_of_error);
  }
}

std::string this_program() {
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
  return error ? "sixpoint" : program.string();
}

Progress::Progress(Context& context, std::string doing, std::uint64_t total)
    : context_(context),
      doing_(std::move(doing)),
      total_(total),
      start_(context.env.clock.elapsed()) {}

Progress::~Progress() {
  if (context_.people_at_terminal && last_percent_ >= 0) {
    context_.people << "\r\x1b[K" << std::flush;
  }
}

std::string bytes_text(std::uint64_t bytes) {
  constexpr std::array<const char*, 5> kUnits = {"kB", "MB", "GB", "TB", "PB"};
  double value = static_cast<double>(bytes) / 1000;
  std::size_t unit = 0;
  for (; value >= 999.5 && unit + 1 < kUnits.size(); ++unit) {
    value /= 1000;
  }
  return bytes < 1000 ? fmt::format("{} bytes", bytes)
                      : fmt::format("{:.{}f} {}", value, value < 9.95 ? 1 : 0, kUnits[unit]);
}

void Progress::at(std::uint64_t done, std::uint64_t bytes, std::uint64_t failed) {
  if (total_ == 0) {
    return;
  }
  const double elapsed_s =
      std::chrono::duration<double>(context_.env.clock.elapsed() - start_).count();
  const auto percent = static_cast<int>(std::min<std::uint64_t>(100, done * 100 / total_));
  const double rate = elapsed_s > 0 ? static_cast<double>(done) / elapsed_s : 0;
  const int left_s =
      rate > 0 ? static_cast<int>(static_cast<double>(total_ - std::min(done, total_)) / rate) : 0;
  const auto said = [&](const char* between) {
    return (bytes > 0 ? between + bytes_text(bytes) : "") +
           (failed > 0 ? fmt::format("{}{} failed", between, failed) : "");
  };
  if (!context_.people_at_terminal) {
    // A line a minute, for logs.
    const auto minute = static_cast<int>(elapsed_s / 60);
    if (minute > 0 && minute != last_percent_) {
      last_percent_ = minute;
      context_.people << fmt::format("{}: {} of {} ({} %){}, {:.1f} a second, {} min left\n",
                                     doing_, done, total_, percent, said(", "), rate,
                                     (left_s + 59) / 60)
                      << std::flush;
    }
    return;
  }
  if (percent == last_percent_ && failed == last_failed_) {
    return;
  }
  last_percent_ = percent;
  last_failed_ = failed;
  const int filled = percent / 5;
  context_.people << fmt::format(
                         "\r{}  [{:=<{}}{: <{}}] {:3} %{}  {:.1f} a second  {:02}:{:02} left",
                         doing_, "", filled, "", 20 - filled, percent, said("  "), rate,
                         left_s / 60, left_s % 60)
                  << std::flush;
}

}  // namespace sixpoint::cli
