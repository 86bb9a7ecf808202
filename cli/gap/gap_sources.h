// What `gap adopt` and `gap report` read: bundles, folders of bundles, stores, and answers of
// `gap diagnose --json`.
//
//   const SourceOptions options = {{"bundles"}, ""};
//   SIXPOINT_ASSIGN(const std::vector<GapSource> sources, find_sources(context, options));
//   SIXPOINT_ASSIGN(const auto evidence, evidence_of_source(context, sources.front()));
//
// A source is a name and how to get it; nothing of a recording is read before it is wanted.
#pragma once

#include <string>
#include <vector>

#include "cli/context.h"
#include "cli/output.h"
#include "gap/adopt/evidence.h"
#include "gap/adopt/resimulation.h"

namespace CLI {
class App;
}

namespace sixpoint::cli {

// What the user named to learn from.
struct SourceOptions {
  std::vector<std::string> inputs;
  std::string store;
};
// The inputs as positional `name`, and --store.
void add_source_options(CLI::App& command, SourceOptions& options, const char* name,
                        const char* about);
// No output may be one of them. usage where nothing is named.
Status guard_sources(Outputs& outputs, const SourceOptions& options);

struct GapSource {
  enum class Kind { document, bundle, run };
  Kind kind = Kind::bundle;
  std::string name;   // path of the document or of the bundle; id of the run
  std::string store;  // of a run
};

// `inputs`: a folder is a bundle, or holds bundles; a database or postgresql:// address is a store,
// whose jig runs are taken as `gap trends` takes them (oldest first; those without samples are left
// out); any other file is a document. `store`: one more store; empty: none. no_input where an input
// is missing, or nothing is found in it.
Result<std::vector<GapSource>> find_sources(Context& context, const SourceOptions& options);

// The bundle of a source, diagnosed. usage for a document: it holds no samples.
Result<gap::RecordedBundle> record_of_source(Context& context, const GapSource& source);

// What the diagnosis of a source says for a population.
Result<gap::DocumentEvidence> evidence_of_source(Context& context, const GapSource& source);

}  // namespace sixpoint::cli
