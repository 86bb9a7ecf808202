#include "cli/gap/gap_sources.h"

#include <utility>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "base/text/counted.h"
#include "cli/command.h"
#include "cli/output.h"
#include "cli/store_option.h"
#include "station/records/jig_bundle.h"

namespace sixpoint::cli {

namespace {

constexpr std::string_view kServer = "postgresql://";

bool is_bundle(FileSystem& files, const std::string& folder) {
  return files.info(folder + "/protocol.json").has_value();
}

Status add_runs(Context& context, const std::string& location, std::vector<GapSource>& sources) {
  SIXPOINT_ASSIGN(db::Store store, open_existing_store(context, location));
  SIXPOINT_ASSIGN(const auto runs, station::stored_jig_runs(store));
  std::size_t without = 0;
  for (const station::StoredRun& run : runs) {
    if (station::samples_of_run(store, run.id)) {
      sources.push_back({GapSource::Kind::run, run.id, location});
    } else {
      ++without;
    }
  }
  if (without > 0) {
    context.log().warn("{}: {} without samples left out", printable(location),
                       counted(without, "run"));
  }
  return {};
}

Status add_folder(FileSystem& files, const std::string& folder, std::vector<GapSource>& sources) {
  if (is_bundle(files, folder)) {
    sources.push_back({GapSource::Kind::bundle, folder, {}});
    return {};
  }
  SIXPOINT_ASSIGN(const auto names, files.list(folder));
  const std::size_t before = sources.size();
  for (const std::string& name : names) {
    std::string path = folder;
    path += '/';
    path += name;
    if (is_bundle(files, path)) {
      sources.push_back({GapSource::Kind::bundle, path, {}});
    }
  }
  if (sources.size() == before) {
    return fail(ErrorCode::no_input, "this is no bundle, and holds none", folder,
                "a bundle is a folder with protocol.json and recording.gt3x");
  }
  return {};
}

}  // namespace

void add_source_options(CLI::App& command, SourceOptions& options, const char* name,
                        const char* about) {
  command.add_option(name, options.inputs, about);
  add_store_option(command, options.store);
}

Status guard_sources(Outputs& outputs, const SourceOptions& options) {
  if (options.inputs.empty() && options.store.empty()) {
    return fail(ErrorCode::usage, "nothing is named to learn from", {},
                "name bundles, a folder of bundles, answers of `gap diagnose --json` or a store");
  }
  for (const std::string& input : options.inputs) {
    SIXPOINT_CHECK(outputs.input(input));
  }
  return outputs.input(options.store.empty() ? "" : store_file(options.store));
}

Result<std::vector<GapSource>> find_sources(Context& context, const SourceOptions& options) {
  const auto& [inputs, store] = options;
  FileSystem& files = context.env.files;
  std::vector<GapSource> sources;
  for (const std::string& input : inputs) {
    if (input.starts_with(kServer)) {
      SIXPOINT_CHECK(add_runs(context, input, sources));
      continue;
    }
    SIXPOINT_ASSIGN(const FileInfo info, files.info(input));
    if (info.is_folder) {
      SIXPOINT_CHECK(add_folder(files, input, sources));
    } else if (look_at(files, input, {}) == Target::database) {
      SIXPOINT_CHECK(add_runs(context, input, sources));
    } else {
      sources.push_back({GapSource::Kind::document, input, {}});
    }
  }
  if (!store.empty()) {
    SIXPOINT_CHECK(add_runs(context, store, sources));
  }
  if (sources.empty()) {
    return fail(ErrorCode::no_input, "there is no run with samples",
                store.empty() && !inputs.empty() ? inputs.front() : store,
                "measure a unit with `sixpoint jig`, or name bundles");
  }
  return sources;
}

Result<gap::RecordedBundle> record_of_source(Context& context, const GapSource& source) {
  if (source.kind == GapSource::Kind::document) {
    return fail(ErrorCode::usage, "a document holds no samples", source.name,
                "give the bundle that it was made from, or the store");
  }
  if (source.kind == GapSource::Kind::bundle) {
    SIXPOINT_ASSIGN(gap::Bundle bundle, gap::read_bundle(context.env.files, source.name));
    return gap::recorded_bundle(std::move(bundle), {});
  }
  SIXPOINT_ASSIGN(db::Store store, open_existing_store(context, source.store));
  SIXPOINT_ASSIGN(const station::StoredRun run, station::stored_run(store, source.name));
  SIXPOINT_ASSIGN(const std::string samples, station::samples_of_run(store, run.id));
  SIXPOINT_ASSIGN(gap::Bundle bundle, station::bundle_of_run(run, samples));
  gap::DiagnoseOptions how;
  how.uncalibrated = true;
  return gap::recorded_bundle(std::move(bundle), how);
}

Result<gap::DocumentEvidence> evidence_of_source(Context& context, const GapSource& source) {
  if (source.kind == GapSource::Kind::document) {
    constexpr std::size_t kLargest = std::size_t{16} << 20U;  // a hundred times a long answer
    SIXPOINT_ASSIGN(const Bytes text, read_file(context.env.files, source.name, kLargest));
    return gap::read_evidence(as_text(text), source.name);
  }
  SIXPOINT_ASSIGN(const gap::RecordedBundle recorded, record_of_source(context, source));
  gap::DocumentEvidence evidence = gap::evidence_of(recorded.diagnosis);
  evidence.source = source.name;
  return evidence;
}

}  // namespace sixpoint::cli
