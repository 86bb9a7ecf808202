#include "repair/batch/stoppable_files.h"

#include <utility>

namespace sixpoint::repair {
namespace {

class StoppableFile final : public ReadableFile {
 public:
  StoppableFile(std::unique_ptr<ReadableFile> file, const std::atomic<bool>& stop)
      : file_(std::move(file)), stop_(stop) {}

  std::uint64_t size() const override { return file_->size(); }
  Result<std::size_t> read_at(std::uint64_t offset, std::span<std::uint8_t> out) const override {
    if (stop_) {
      return fail(ErrorCode::io, "it was stopped", {}, "run it again");
    }
    return file_->read_at(offset, out);
  }

 private:
  std::unique_ptr<ReadableFile> file_;
  const std::atomic<bool>& stop_;
};

}  // namespace

Result<std::unique_ptr<ReadableFile>> StoppableFiles::open(const std::string& path) {
  SIXPOINT_ASSIGN(auto file, disk().open(path));
  return std::make_unique<StoppableFile>(std::move(file), stop_);
}

}  // namespace sixpoint::repair
