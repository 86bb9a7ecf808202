#include "mocks/usb/fat_image.h"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "base/random.h"
#include "expect_result.h"
#include "skip_unless.h"
#include "temporary_folder.h"

namespace sixpoint::mocks {
namespace {

std::shared_ptr<const Bytes> bytes_of(std::size_t size, std::uint64_t seed) {
  Random random(seed);
  auto bytes = std::make_shared<Bytes>(size);
  for (auto& byte : *bytes) {
    byte = static_cast<std::uint8_t>(random.bits());
  }
  return bytes;
}

std::string save(const FatImage& image, const std::string& path) {
  std::ofstream out(path, std::ios::binary);
  std::array<std::uint8_t, kBlockBytes> block{};
  for (std::uint32_t i = 0; i < image.blocks(); ++i) {
    image.read(i, block);
    out.write(reinterpret_cast<const char*>(block.data()), block.size());
  }
  return path;
}

struct ToolAnswer {
  int status = -1;
  std::string output;
};
ToolAnswer run_tool(const std::string& command) {
  ToolAnswer answer;
  FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  std::array<char, 4096> part{};
  for (std::size_t count = 0; (count = std::fread(part.data(), 1, part.size(), pipe)) > 0;) {
    answer.output.append(part.data(), count);
  }
  answer.status = ::pclose(pipe);
  return answer;
}

bool has_tools() {
  return std::system(
             "PATH=$PATH:/usr/sbin; command -v mcopy >/dev/null && command -v fsck.vfat "
             ">/dev/null") == 0;
}

// The oracles are mtools and dosfstools, neither of which knows this code.
TEST(FatImage, ToolsReadTheFilesBack) {
  SIXPOINT_SKIP_UNLESS(has_tools(), "install the Debian packages mtools and dosfstools");
  tests::TemporaryFolder folder;
  const UtcTime time = *parse_iso8601("2015-04-09T14:04:32");
  std::vector<FatFile> files = {
      {"info.txt", bytes_of(700, 1), time},
      {"log.bin", bytes_of(32U << 20U, 2), time},
      {"EMPTY.TXT", bytes_of(0, 3), time},
      {"REC00001/info.txt", bytes_of(512, 4), time},
      {"REC00001/log.bin", bytes_of((10U << 20U) + 1, 5), time},
      {"REC00002/log.bin", bytes_of(1, 6), time},
  };
  const auto image = FatImage::make(files);
  ASSERT_OK(image);
  const std::string path = save(*image, folder.path() + "/volume");
  EXPECT_EQ(std::filesystem::file_size(path), 96U << 20U);

  const auto check = run_tool("PATH=$PATH:/usr/sbin:/sbin fsck.vfat -n -v '" + path + "'");
  EXPECT_EQ(check.status, 0) << check.output;
  EXPECT_NE(check.output.find("16 bit entries"), std::string::npos) << check.output;
  // Six files, two folders, the label.
  EXPECT_NE(check.output.find(": 9 files"), std::string::npos) << check.output;

  for (const FatFile& file : files) {
    const std::string out = folder.path() + "/out";
    const auto copied =
        run_tool("mcopy -n -o -i '" + path + "' '::" + file.path + "' '" + out + "'");
    ASSERT_EQ(copied.status, 0) << copied.output;
    std::ifstream in(out, std::ios::binary);
    const Bytes back((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    EXPECT_TRUE(back == *file.content) << file.path << " differs";
  }
  const auto listing = run_tool("mdir -i '" + path + "' ::");
  EXPECT_EQ(listing.status, 0);
  EXPECT_NE(listing.output.find("SIXPOINT"), std::string::npos) << listing.output;
  EXPECT_NE(listing.output.find("2015-04-09  14:04"), std::string::npos) << listing.output;
}

TEST(FatImage, RefusesWhatDoesNotFit) {
  EXPECT_FAILS(FatImage::make({{"log.bin", bytes_of(96U << 20U, 1), {}}}),
               ErrorCode::configuration);
  // The root folder has 512 entries, one of which is the label.
  std::vector<FatFile> files;
  for (int i = 0; i < 512; ++i) {
    files.push_back({std::to_string(i) + ".txt", bytes_of(1, 1), {}});
  }
  EXPECT_FAILS(FatImage::make(files), ErrorCode::configuration);
  files.pop_back();
  EXPECT_OK(FatImage::make(files));
}

TEST(FatImage, AnEmptyVolumeTakesLittleMemoryAndReadsToItsEnd) {
  const auto image = FatImage::make({});
  ASSERT_OK(image);
  EXPECT_EQ(image->blocks(), (96U << 20U) / 512U);
  std::array<std::uint8_t, kBlockBytes> block{};
  block.fill(1);
  image->read(image->blocks() - 1, block);
  EXPECT_EQ(block, (std::array<std::uint8_t, kBlockBytes>{}));
}

}  // namespace
}  // namespace sixpoint::mocks
