#include "station/page/repair_job.h"

#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>

#include <nlohmann/json.hpp>

#include "base/thrown.h"
#include "repair/archive/output_lock.h"
#include "repair/batch/manifest.h"
#include "repair/batch/repair_files.h"
#include "repair/rescale/constants_finder.h"
#include "repair/rescale/repair_records.h"
#include "repair/units/unit_needs.h"
#include "repair/units/unit_pool.h"
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

std::string name_below(const std::string& folder, const std::string& path) {
  return path.starts_with(folder + "/") ? path.substr(folder.size() + 1) : file_name_of(path);
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

// What a job begins with.
struct PlannedJob {
  RepairOrder order;
  std::unique_ptr<FileLock> lock;  // of the output folder; null where its file system has none
  std::vector<repair::NamedFile> files;
};

Result<PlannedJob> plan_job(FileSystem& files, const RepairOrder& order) {
  SIXPOINT_CHECK(files.info(order.folder));
  if (!order.calibration_file.empty()) {
    SIXPOINT_CHECK(repair::check_calibration_recording(files, order.calibration_file));
  }
  PlannedJob job{order, nullptr, repair::named_files(files, {order.folder}, {".gt3x"}).files};
  const auto no_files = fail(ErrorCode::no_input, "there is no .gt3x file in this folder",
                             order.folder, "choose the folder with your recordings");
  if (job.files.empty()) {
    return no_files;
  }
  SIXPOINT_CHECK(repair::check_manifest(files, order.output));
  SIXPOINT_ASSIGN(job.lock, repair::lock_for_repair(files, order.output, {order.folder}));
  repair::leave_out_outputs(files, job.files, order.output);
  repair::refuse_same_outputs(job.files, order.output);
  return job.files.empty() ? Result<PlannedJob>(no_files) : std::move(job);
}

Status leave_manifest(Env& env, const std::string& folder,
                      const std::vector<repair::RepairReport>& reports, repair::UnitTable& table) {
  for (const repair::RepairReport& report : reports) {
    table.add(report);
  }
  SIXPOINT_CHECK(
      repair::write_manifest(env.files, folder, reports, env.clock.now(), software_and_build()));
  return repair::write_units(env.files, folder, table.rows());
}

}  // namespace

struct RepairJob::Impl {
  Impl(Env& its_env, StoreOpener opener) : env(its_env), open_store(std::move(opener)) {}

  void work(const std::stop_token& stop, PlannedJob job);
  void begin(std::size_t files) {
    const std::lock_guard lock(mutex);
    state = "running";
    error.clear();
    total = files;
    forget_files();
  }
  // Under the mutex, as add().
  void forget_files() {
    done = 0;
    summary = Json::object();
    shown_files = Json::array();
    ++changes;
  }
  void add(const std::string& name, const repair::RepairReport& report);
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
  std::mutex starting;       // one start() at a time
  mutable std::mutex mutex;  // guards what follows
  std::string state = "none";
  std::string error;
  std::string current;
  std::size_t done = 0;
  std::size_t total = 0;
  Json summary = Json::object();
  Json shown_files = Json::array();
  std::jthread thread;
};

void RepairJob::Impl::add(const std::string& name, const repair::RepairReport& report) {
  const std::string status(repair::to_string(report.status));
  summary[status] = summary.value(status, 0) + 1;
  if (shown_files.size() < kShownFiles) {
    shown_files.push_back(shown(name, report));
  }
  ++done;
  ++changes;
}

void RepairJob::Impl::work(const std::stop_token& stop, PlannedJob job) {
  Result<db::Store> store = open_store();
  if (!store) {
    job.lock.reset();
    end("failed", store.error().brief());
    return;
  }
  const RepairOrder& order = job.order;
  repair::UnitPool pool;
  repair::ConstantsFinderOptions sources;
  sources.store = &*store;
  sources.unit = &pool;
  if (!order.calibration_file.empty()) {
    sources.calibration_file = order.calibration_file;
  }
  repair::ConstantsFinder finder(env, sources);
  repair::RepairFilesOptions how;
  how.folder = order.output;
  how.repair.resume = true;  // a job that was cancelled goes on
  how.jobs = 1;              // files come in their order
  std::atomic<bool> stopping{false};
  const std::stop_callback on_stop(stop, [&] { stopping = true; });
  repair::RepairWatch watch;
  watch.begin = [&](const char* doing, std::size_t /*files*/) {
    const std::lock_guard lock(mutex);
    current = done < total ? name_below(order.folder, job.files[done].path) : doing;
    ++changes;
  };
  watch.did = [&](repair::RepairReport& report) {
    if (const std::string problem = store_problem(*store, report); !problem.empty()) {
      report.reasons.push_back(problem);
    }
    const std::lock_guard lock(mutex);
    if (done < total) {  // the first pass
      add(name_below(order.folder, report.input), report);
      current = done < total ? name_below(order.folder, job.files[done].path) : "";
    }
  };
  const auto reports = repair::repair_files(env, job.files, how, finder, pool, watch, &stopping);
  repair::UnitTable table(repair::sources_in_order(sources));
  const Status left = leave_manifest(env, order.output, reports, table);
  {
    const std::lock_guard lock(mutex);
    forget_files();
    for (const repair::RepairReport& report : reports) {
      add(name_below(order.folder, report.input), report);
    }
  }
  job.lock.reset();
  if (!left) {
    end("failed", left.error().brief());
  } else {
    end(reports.size() < job.files.size() ? "cancelled" : "done", "");
  }
}

RepairJob::RepairJob(Env& env, StoreOpener open_store)
    : impl_(std::make_unique<Impl>(env, std::move(open_store))) {}
RepairJob::~RepairJob() = default;

Status RepairJob::start(const RepairOrder& order) {
  const std::lock_guard starting(impl_->starting);
  {
    const std::lock_guard lock(impl_->mutex);
    if (impl_->state == "running") {
      return fail(ErrorCode::usage, "files are being repaired already", {},
                  "wait, or cancel that job");
    }
  }
  SIXPOINT_ASSIGN(auto job, plan_job(impl_->env.files, order));
  if (impl_->thread.joinable()) {
    impl_->thread.join();  // it has ended: its state says so
  }
  impl_->begin(job.files.size());
  auto work = [this, job = std::move(job)](const std::stop_token& stop) mutable {
    // As Lane::work(): an exception is a defect, and ends this job alone.
    try {
      impl_->work(stop, std::move(job));
    } catch (const std::exception& defect) {
      impl_->end("failed", "a defect of the program ended the repair: " + printable(defect.what()));
    }
  };
  try {
    const std::lock_guard lock(impl_->mutex);
    impl_->thread = std::jthread(std::move(work));
  } catch (const std::system_error& no_thread) {
    Error error = error_of(no_thread);
    impl_->end("failed", error.brief());
    return fail(std::move(error));
  }
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
  json["files"] = impl_->shown_files;
  json["error"] = impl_->error;
  return json;
}

}  // namespace sixpoint::station
