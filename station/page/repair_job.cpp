#include "station/repair_job.h"

#include <atomic>
#include <mutex>
#include <thread>

#include <nlohmann/json.hpp>

#include "repair/constants_finder.h"
#include "repair/file_tree.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;
constexpr std::size_t kShownFiles = 2000;

}  // namespace

db::RepairRecord repair_record_of(const repair::RepairReport& report, UtcTime made_at) {
  db::RepairRecord record;
  record.serial = report.serial;
  record.made_at = made_at;
  record.input = report.input;
  record.input_sha256 = report.input_sha256;
  record.output_sha256 = report.output_sha256;
  record.method = report.method;
  record.constants_id = report.constants_id;
  record.document = report.to_json().dump(-1, ' ', false, Json::error_handler_t::replace);
  return record;
}

struct RepairJob::Impl {
  Impl(Env& its_env, StoreOpener opener) : env(its_env), open_store(std::move(opener)) {}

  void work(const std::stop_token& stop, const RepairOrder& order, const repair::FileTree& tree);
  void end(std::string how, std::string problem) {
    const std::lock_guard lock(mutex);
    state = std::move(how);
    error = std::move(problem);
    current.clear();
    ++changes;
  }

  Env& env;
  StoreOpener open_store;
  std::atomic<std::uint64_t> changes{0};
  mutable std::mutex mutex;  // guards what follows
  std::string state = "none";
  std::string error;
  std::string current;
  std::size_t done = 0;
  std::size_t total = 0;
  Json summary = Json::object();
  Json files = Json::array();
  std::jthread thread;
};

void RepairJob::Impl::work(const std::stop_token& stop, const RepairOrder& order,
                           const repair::FileTree& tree) {
  Result<db::Store> store = open_store();
  if (!store) {
    end("failed", store.error().brief());
    return;
  }
  repair::ConstantsFinderOptions options;
  options.store = &*store;
  if (!order.calibration_file.empty()) {
    options.calibration_file = order.calibration_file;
  }
  repair::ConstantsFinder finder(env, options);
  for (const repair::RefusedPath& refused : tree.refused) {
    const std::lock_guard lock(mutex);
    summary["failed"] = summary.value("failed", 0) + 1;
    if (files.size() < kShownFiles) {
      files.push_back({{"input", printable(refused.path)},
                       {"status", "failed"},
                       {"method", ""},
                       {"reasons", {refused.error.brief()}},
                       {"still_error_mg", {{"before", nullptr}, {"after", nullptr}}}});
    }
    ++changes;
  }
  for (const repair::FoundFile& file : tree.files) {
    if (stop.stop_requested()) {
      end("cancelled", "");
      return;
    }
    {
      const std::lock_guard lock(mutex);
      current = file.relative;
      ++changes;
    }
    const std::string output = order.output + "/" + file.relative;
    repair::RepairReport report;
    if (const Status made = env.files.make_folders(folder_of(output)); !made) {
      report.input = file.path;
      report.reasons.push_back(made.error().brief());
    } else {
      repair::RepairOptions how;
      how.resume = true;  // a job that was cancelled goes on
      report = repair::repair_file(env, file.path, output, finder, how);
    }
    std::string problem;
    if (report.status == repair::RepairStatus::repaired) {
      const auto kept = store->add_repair(repair_record_of(report, env.clock.now()));
      problem = kept ? "" : kept.error().brief();
    }
    const std::lock_guard lock(mutex);
    ++done;
    const std::string status(repair::to_string(report.status));
    summary[status] = summary.value(status, 0) + 1;
    if (files.size() < kShownFiles) {
      Json row{{"input", printable(file.relative)},
               {"status", status},
               {"method", report.method},
               {"reasons", report.reasons}};
      if (!problem.empty()) {
        row["reasons"].push_back(problem);
      }
      row["still_error_mg"]["before"] =
          report.still_error_before_mg ? Json(*report.still_error_before_mg) : Json(nullptr);
      row["still_error_mg"]["after"] =
          report.still_error_after_mg ? Json(*report.still_error_after_mg) : Json(nullptr);
      files.push_back(std::move(row));
    }
    ++changes;
  }
  end("done", "");
}

RepairJob::RepairJob(Env& env, StoreOpener open_store)
    : impl_(std::make_unique<Impl>(env, std::move(open_store))) {}
RepairJob::~RepairJob() = default;

Status RepairJob::start(const RepairOrder& order) {
  SIXPOINT_ASSIGN(auto tree, repair::find_files(impl_->env.files, order.folder, {{".gt3x"}}));
  // What an earlier job made lies below the folder when the output does: not mended again.
  std::erase_if(tree.files, [&](const repair::FoundFile& file) {
    return file.path.starts_with(order.output + "/");
  });
  const std::lock_guard lock(impl_->mutex);
  if (impl_->state == "running") {
    return fail(ErrorCode::usage, "files are being mended already", {}, "wait, or cancel that job");
  }
  if (tree.files.empty()) {
    return fail(ErrorCode::no_input, "there is no .gt3x file in this folder", order.folder,
                "choose the folder with your recordings");
  }
  if (impl_->thread.joinable()) {
    impl_->thread.join();  // it has ended: its state says so
  }
  impl_->state = "running";
  impl_->error.clear();
  impl_->done = 0;
  impl_->total = tree.files.size();
  impl_->summary = Json::object();
  impl_->files = Json::array();
  ++impl_->changes;
  impl_->thread = std::jthread([this, order, tree = std::move(tree)](const std::stop_token& stop) {
    impl_->work(stop, order, tree);
  });
  return {};
}

void RepairJob::cancel() {
  const std::lock_guard lock(impl_->mutex);
  impl_->thread.request_stop();
}

std::uint64_t RepairJob::changes() const { return impl_->changes; }

Json RepairJob::to_json() const {
  const std::lock_guard lock(impl_->mutex);
  Json json;
  json["state"] = impl_->state;
  json["done"] = impl_->done;
  json["total"] = impl_->total;
  json["current"] = printable(impl_->current);
  json["summary"] = impl_->summary;
  json["files"] = impl_->files;
  json["error"] = impl_->error;
  return json;
}

}  // namespace sixpoint::station
