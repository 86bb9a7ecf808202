#include "station/printing/label_printer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <list>
#include <mutex>
#include <thread>

#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/text/json_text.h"

namespace sixpoint::station {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kMostFile_bytes = 1U << 20U;
constexpr std::size_t kMostShown = 40;  // that do not wait
constexpr std::string_view kEnding = ".json";

struct Entry {
  Label label;
  std::string state = "waiting";
  std::int64_t added_ms = 0;  // the order in which they are sent
  std::string problem;
  int failures = 0;
};

std::string text_of(const Entry& entry) {
  const Json json = {{"schema", "sixpoint/label/1"}, {"run", entry.label.run},
                     {"serial", entry.label.serial}, {"state", entry.state},
                     {"added_ms", entry.added_ms},   {"zpl", entry.label.zpl}};
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

Result<Entry> read_entry(FileSystem& files, const std::string& path) {
  SIXPOINT_ASSIGN(const Bytes bytes, read_file(files, path, kMostFile_bytes));
  const Json json = parse_json(as_text(bytes));
  const auto has = [&](const char* key) { return json.contains(key) && json[key].is_string(); };
  if (!json.is_object() || !has("run") || !has("serial") || !has("state") || !has("zpl") ||
      !json.contains("added_ms") || !json["added_ms"].is_number_integer() ||
      file_name_of(path) != json["run"].get<std::string>() + std::string(kEnding)) {
    return fail(ErrorCode::bad_data, "this is no label of a station", path,
                "print the label again from the list of runs");
  }
  Entry entry;
  entry.label = {json["run"], json["serial"], json["zpl"]};
  entry.state = json["state"];
  entry.added_ms = json["added_ms"];
  return entry;
}

}  // namespace

bool is_run_id(std::string_view run) {
  return !run.empty() && run.size() <= 64 &&
         run.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

double retry_pause_s(int failures, const LabelPrinterOptions& options) {
  const double doubled = options.first_pause_s * std::pow(2.0, std::clamp(failures, 1, 60) - 1);
  return std::min(doubled, options.longest_pause_s);
}

struct LabelPrinter::Impl {
  Impl(Env& its_env, std::string its_printer, std::string its_folder, LabelSender its_send,
       const LabelPrinterOptions& its_options)
      : env(its_env),
        printer(std::move(its_printer)),
        folder(std::move(its_folder)),
        send(std::move(its_send)),
        options(its_options) {}

  Status read_folder();
  Status put(const Label& label, bool again);
  void work(const std::stop_token& stop);
  void note(const std::string& run, const Result<Sent>& sent);
  void forget_oldest();
  std::string path_of(const std::string& run) const {
    return folder + "/" + run + std::string(kEnding);
  }
  Status write(const Entry& entry) {
    return write_private_file(env.files, path_of(entry.label.run), text_of(entry));
  }
  // With `mutex` held.
  std::list<Entry>::iterator find(const std::string& run) {
    return std::find_if(entries.begin(), entries.end(),
                        [&](const Entry& each) { return each.label.run == run; });
  }
  std::list<Entry>::iterator oldest_waiting() {
    return std::find_if(entries.begin(), entries.end(),
                        [](const Entry& each) { return each.state == "waiting"; });
  }

  Env& env;
  const std::string printer;
  const std::string folder;
  const LabelSender send;
  const LabelPrinterOptions options;
  std::atomic<std::uint64_t> changes{1};

  std::mutex files_mutex;  // one writer in the folder; taken before `mutex`
  mutable std::mutex mutex;
  std::condition_variable_any wake;
  std::list<Entry> entries;  // in the order in which they are sent
  int failures = 0;          // in a row
  bool try_now = false;
  std::jthread thread;  // last: it uses all of the above
};

Status LabelPrinter::Impl::read_folder() {
  SIXPOINT_CHECK(make_private_folders(env.files, folder));
  SIXPOINT_ASSIGN(const auto names, env.files.list(folder));
  for (const std::string& name : names) {
    if (!name.ends_with(kEnding)) {
      continue;
    }
    const std::string path = folder + "/" + name;
    if (auto entry = read_entry(env.files, path)) {
      entries.push_back(*std::move(entry));
    } else if (entry.error().code == ErrorCode::bad_data) {
      SIXPOINT_CHECK(env.files.rename(path, path + ".unreadable"));
    } else {
      return fail(entry.error());
    }
  }
  entries.sort([](const Entry& a, const Entry& b) { return a.added_ms < b.added_ms; });
  return {};
}

Status LabelPrinter::Impl::put(const Label& label, bool again) {
  if (!is_run_id(label.run)) {
    return fail(ErrorCode::usage, "this is no id of a run", printable(label.run, 80),
                "ask for the label of a run that the store has");
  }
  const std::lock_guard files_lock(files_mutex);
  Entry entry;
  entry.label = label;
  {
    const std::lock_guard lock(mutex);
    if (const auto known = find(label.run); known != entries.end()) {
      if (!again) {
        return {};
      }
      if (known->state == "waiting") {
        try_now = true;
        wake.notify_all();
        return {};
      }
    }
    const auto waiting = std::count_if(entries.begin(), entries.end(),
                                       [](const Entry& each) { return each.state == "waiting"; });
    if (static_cast<std::size_t>(waiting) >= options.most_waiting) {
      return fail(ErrorCode::io, "too many labels wait for the printer", printer,
                  "look at the printer; the label can be printed later, from the list of runs");
    }
    entry.added_ms =
        std::chrono::duration_cast<std::chrono::milliseconds>(env.clock.now().time_since_epoch())
            .count();
  }
  SIXPOINT_CHECK(write(entry));
  const std::lock_guard lock(mutex);
  if (const auto known = find(label.run); known != entries.end()) {
    entries.erase(known);
  }
  entries.push_back(std::move(entry));
  try_now = try_now || again;
  ++changes;
  wake.notify_all();
  return {};
}

void LabelPrinter::Impl::work(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    Label label;
    {
      std::unique_lock lock(mutex);
      if (!wake.wait(lock, stop, [&] { return oldest_waiting() != entries.end(); })) {
        return;
      }
      if (failures > 0) {
        const std::chrono::duration<double> pause(retry_pause_s(failures, options));
        wake.wait_for(lock, stop, pause, [&] { return try_now; });
      }
      if (stop.stop_requested()) {
        return;
      }
      try_now = false;
      label = oldest_waiting()->label;
    }
    const Result<Sent> sent = send(label.zpl, stop);
    if (!sent && stop.stop_requested()) {
      return;
    }
    note(label.run, sent);
    forget_oldest();
  }
}

void LabelPrinter::Impl::note(const std::string& run, const Result<Sent>& sent) {
  const std::lock_guard files_lock(files_mutex);
  Entry printed;
  {
    const std::lock_guard lock(mutex);
    Entry& entry = *find(run);
    ++changes;
    if (!sent) {
      ++failures;
      ++entry.failures;
      entry.problem = sent.error().brief();
      return;
    }
    failures = 0;
    entry.problem.clear();
    entry.state = *sent == Sent::taken ? "printed" : "unconfirmed";
    printed = entry;
  }
  if (const Status noted = write(printed); !noted) {
    const std::lock_guard lock(mutex);
    find(run)->problem = "printed again after a restart: " + noted.error().brief();
  }
}

void LabelPrinter::Impl::forget_oldest() {
  const std::lock_guard files_lock(files_mutex);
  const std::lock_guard lock(mutex);
  auto done = static_cast<std::size_t>(std::count_if(
      entries.begin(), entries.end(), [](const Entry& each) { return each.state != "waiting"; }));
  for (auto each = entries.begin(); each != entries.end() && done > options.remembered;) {
    if (each->state != "waiting") {
      static_cast<void>(
          env.files.remove(path_of(each->label.run)));  // tried again at the next start
      each = entries.erase(each);
      --done;
    } else {
      ++each;
    }
  }
}

LabelPrinter::LabelPrinter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LabelPrinter::~LabelPrinter() = default;

Result<std::unique_ptr<LabelPrinter>> LabelPrinter::open(Env& env, const std::string& printer,
                                                         const std::string& folder,
                                                         LabelSender send,
                                                         const LabelPrinterOptions& options) {
  auto impl = std::make_unique<Impl>(env, printer, folder, std::move(send), options);
  SIXPOINT_CHECK(impl->read_folder());
  impl->forget_oldest();
  impl->thread = std::jthread([raw = impl.get()](const std::stop_token& stop) { raw->work(stop); });
  return std::unique_ptr<LabelPrinter>(new LabelPrinter(std::move(impl)));
}

Status LabelPrinter::add(const Label& label) { return impl_->put(label, false); }
Status LabelPrinter::add_again(const Label& label) { return impl_->put(label, true); }
std::uint64_t LabelPrinter::changes() const { return impl_->changes; }

Json LabelPrinter::to_json() const {
  const std::lock_guard lock(impl_->mutex);
  Json labels = Json::array();
  std::size_t others = 0;
  for (auto each = impl_->entries.rbegin(); each != impl_->entries.rend(); ++each) {
    if (each->state != "waiting" && ++others > kMostShown) {
      continue;
    }
    labels.push_back({{"run", each->label.run},
                      {"serial", each->label.serial},
                      {"state", each->state},
                      {"problem", printable(each->problem)},
                      {"failures", each->failures}});
  }
  return {{"printer", impl_->printer}, {"labels", std::move(labels)}};
}

}  // namespace sixpoint::station
