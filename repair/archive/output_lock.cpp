#include "repair/archive/output_lock.h"

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "repair/archive/record_folder.h"

namespace sixpoint::repair {
namespace {

constexpr int kLockAttempts = 40;
constexpr std::chrono::milliseconds kLockPause{50};

constexpr std::string_view kShardPrefix = ".sixpoint-shard-";
constexpr std::string_view kShardEnding = ".lock";
constexpr std::size_t kPlanDigits = 16;

std::string repair_lock_in(const std::string& folder) { return folder + "/.sixpoint-repair.lock"; }

// Its file goes with it.
class ShardsLock final : public FileLock {
 public:
  ShardsLock(FileSystem& files, std::string path, std::unique_ptr<FileLock> held)
      : files_(files), path_(std::move(path)), held_(std::move(held)) {}
  ShardsLock(const ShardsLock&) = delete;
  ShardsLock& operator=(const ShardsLock&) = delete;
  // Removed while it is held, so that no other run's file is.
  ~ShardsLock() override { static_cast<void>(files_.remove(path_)); }

 private:
  FileSystem& files_;
  std::string path_;
  std::unique_ptr<FileLock> held_;
};

// Removes what killed shards left.
bool a_shard_is_at_work(FileSystem& files, const std::string& folder) {
  for (const std::string& name : files.list(folder).value_or(std::vector<std::string>{})) {
    if (!name.starts_with(kShardPrefix) || !name.ends_with(kShardEnding)) {
      continue;
    }
    const std::string path = fmt::format("{}/{}", folder, name);
    auto lock = files.lock(path);
    if (lock && *lock == nullptr) {
      return true;
    }
    if (lock) {
      const ShardsLock left_over(files, path, *std::move(lock));
    }
  }
  return false;
}

tl::unexpected<Error> refusal(const std::string& folder) {
  return fail(ErrorCode::cannot_create, "another run is repairing into this folder", folder,
              "wait for it, then run this again");
}

Status refuse_record(FileSystem& files, const std::string& folder) {
  return is_bundle(files, folder) || is_plan(files, folder)
             ? Status(fail(ErrorCode::cannot_create,
                           "this is a bundle or the plan of an archive; it stays as it is", folder,
                           "choose another folder"))
             : Status();
}

Status refuse_folder_of_inputs(FileSystem& files, const std::string& folder,
                               const std::vector<std::string>& inputs) {
  const auto output = files.real_path(folder);
  if (!output) {
    return {};  // it is not there yet
  }
  for (const std::string& input : inputs) {
    const auto info = files.info(input);
    const auto real = files.real_path(info && info->is_folder ? input : folder_of(input));
    if (info && real && *real == *output) {
      return fail(ErrorCode::usage, "the output folder is the folder of the recordings", folder,
                  "choose another one; a folder below it will do");
    }
  }
  return {};
}

}  // namespace

Result<std::unique_ptr<FileLock>> lock_for_repair(FileSystem& files, const std::string& folder,
                                                  const std::vector<std::string>& inputs) {
  SIXPOINT_CHECK(refuse_record(files, folder));
  SIXPOINT_CHECK(refuse_folder_of_inputs(files, folder, inputs));
  SIXPOINT_CHECK(make_synced_folders(files, folder));
  auto lock = files.lock(repair_lock_in(folder));
  if (!lock) {
    return nullptr;
  }
  if (*lock == nullptr || a_shard_is_at_work(files, folder)) {
    return refusal(folder);
  }
  return lock;
}

Result<std::unique_ptr<FileLock>> lock_for_shard(Env& env, const std::string& folder,
                                                 const std::string& plan_id, std::size_t shard) {
  SIXPOINT_CHECK(refuse_record(env.files, folder));
  SIXPOINT_CHECK(make_synced_folders(env.files, folder));
  const std::string path = fmt::format("{}/{}{}-{:05}{}", folder, kShardPrefix,
                                       plan_id.substr(0, kPlanDigits), shard, kShardEnding);
  auto held = wait_for_lock(env, path);
  if (!held) {
    return nullptr;
  }
  if (*held == nullptr) {
    return refusal(folder);
  }
  auto own = std::make_unique<ShardsLock>(env.files, path, *std::move(held));
  const std::string of_repair = repair_lock_in(folder);
  if (env.files.info(of_repair)) {
    SIXPOINT_ASSIGN(const auto free, wait_for_lock(env, of_repair));
    if (free == nullptr) {
      return refusal(folder);
    }
  }
  return own;
}

Result<std::unique_ptr<FileLock>> wait_for_lock(Env& env, const std::string& path) {
  for (int attempt = 0;; ++attempt) {
    SIXPOINT_ASSIGN(auto lock, env.files.lock(path));
    if (lock != nullptr || attempt == kLockAttempts) {
      return lock;
    }
    env.clock.sleep(kLockPause);
  }
}

}  // namespace sixpoint::repair
