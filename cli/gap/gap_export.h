// gap challenge --export: bundles and sealed labels for the makers of other methods.
//
//   ExportOptions how;
//   how.folder = "bundles";
//   how.labels = "labels.jsonl";  // out of their reach; empty: in that folder
//   SIXPOINT_CHECK(export_challenge(how, context));
//
// Writes FOLDER/NAME/ for each trial, the labels, and last FOLDER/challenge.json with the names and
// the SHA-256 of the labels. Nothing but the samples tells what is in a bundle: names come from a
// hash, their order is that of the names, headers are drawn before the effects, the seed stands in
// the labels alone, and all files have one time. The same seed writes the same bytes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "cli/context.h"
#include "cli/output.h"
#include "gap/challenge/trials.h"

namespace sixpoint::cli {

struct ExportOptions {
  std::size_t trials = 100;
  std::uint64_t seed = 1;
  sim::StandardProtocol protocol = sim::StandardProtocol::engineering;
  std::vector<std::string> only;
  gap::TrialShares shares;
  std::string folder;
  std::string labels;
  unsigned jobs = 1;
  bool dry_run = false;
  OutputOptions outputs;
  bool json = false;
};

// 73 for a folder that holds anything, with --force too: bundles of two challenges would mix.
Status export_challenge(const ExportOptions& options, Context& context);

}  // namespace sixpoint::cli
