#include "station/page/repair_job.h"

#include <atomic>
#include <mutex>
#include <thread>

#include <nlohmann/json.hpp>

#include "repair/rescale/constants_finder.h"
#include "repair/rescale/repair_file.h"
#include "repair/rescale/repair_records.h"
#include "repair/triage/file_tree.h"
#include "station/records/software.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;
constexpr std::size_t kShownFiles = 2000;

// Adds what the store does not know yet of this file; the reason where it does not take it.
std::string store_problem(db::Store& store, const repair::RepairReport& report) {
  const auto made = repair::records_of(store, {report}, software_and_build());
  if (!made.refused.empty()) {
    return made.refused.front().error.brief();
  }
  for (const db::RepairRecord& record : made.records) {
    if (const auto added = store.add_repair(record); !added) {
      return added.error().brief();
    }
  }
  return {};
}

repair::RepairReport repair_one(Env& env, const repair::FoundFile& file, const std::string& folder,
                                repair::ConstantsSource& constants) {
  const std::string output = folder + "/" + file.relative;
  if (const Status made = env.files.make_folders(folder_of(output)); !made) {
    repair::RepairReport report;
    report.input = file.path;
    report.reasons.push_back(made.error().brief());
    return report;
  }
  repair::RepairOptions options;
  options.resume = true;  // a job that was cancelled goes on
  return repair::repair_file(env, file.path, output, constants, options);
}

// What the page shows of one file.
Json shown(const std::string& name, const repair::RepairReport& report) {
  const Json all = report.to_json();
  return {{"input", printable(name)},
          {"status", all["status"]},
          {"method", report.method},
          {"reasons", report.reasons},
          {"still_error_mg", all["still_error_mg"]}};
}

}  // namespace

struct RepairJob::Impl {
  Impl(Env& its_env, StoreOpener opener) : env(its_env), open_store(std::move(opener)) {}

  void work(const std::stop_token& stop, const RepairOrder& order, const repair::FileTree& tree);
  void add(const std::string& name, const repair::RepairReport& report);  // under the mutex
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

void RepairJob::Impl::add(const std::string& name, const repair::RepairReport& report) {
  const std::string status(repair::to_string(report.status));
  summary[status] = summary.value(status, 0) + 1;
  if (files.size() < kShownFiles) {
    files.push_back(shown(name, report));
  }
  ++changes;
}

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
    repair::RepairReport report;
    report.reasons.push_back(refused.error.brief());
    const std::lock_guard lock(mutex);
    add(refused.path, report);
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
    repair::RepairReport report = repair_one(env, file, order.output, finder);
    if (const std::string problem = store_problem(*store, report); !problem.empty()) {
      report.reasons.push_back(problem);
    }
    const std::lock_guard lock(mutex);
    ++done;
    add(file.relative, report);
  }
  end("done", "");
}

RepairJob::RepairJob(Env& env, StoreOpener open_store)
    : impl_(std::make_unique<Impl>(env, std::move(open_store))) {}
RepairJob::~RepairJob() = default;

Status RepairJob::start(const RepairOrder& order) {
  SIXPOINT_ASSIGN(auto tree, repair::find_files(impl_->env.files, order.folder, {{".gt3x"}}));
  // What an earlier job made lies below the folder when the output does: not repaired again.
  std::erase_if(tree.files, [&](const repair::FoundFile& file) {
    return file.path.starts_with(order.output + "/");
  });
  const std::lock_guard lock(impl_->mutex);
  if (impl_->state == "running") {
    return fail(ErrorCode::usage, "files are being repaired already", {},
                "wait, or cancel that job");
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
