// Downloads of a WireUnit: what is saved is what the unit holds, or nothing is.
#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/memory_env.h"
#include "base/sha256.h"
#include "device/made_links.h"
#include "device/wire/made_bench.h"
#include "device/wire/wire_unit.h"
#include "expect_result.h"

namespace sixpoint::device {
namespace {

using mocks::TamperingTransport;
using tests::Bench;
using tests::record;

TEST(WireDownload, RecordsListsAndDownloads) {
  Bench bench;
  auto unit = *WireUnit::open(bench.link());
  EXPECT_TRUE(unit->recordings()->empty());
  const RecordingInfo info = record(bench, *unit, 300);
  record(bench, *unit, 10);
  EXPECT_EQ(unit->recordings()->size(), 2U);
  MemoryEnv env;
  std::uint64_t reported = 0;
  ASSERT_OK(unit->download(info, env.files, "x.gt3x", [&](std::uint64_t at) { reported = at; }));
  EXPECT_EQ(reported, info.bytes);
  EXPECT_EQ(sha256(*read_file(env.files, "x.gt3x")), info.sha256);
  EXPECT_EQ(*read_file(env.files, "x.gt3x"), bench.plugged->unit.recordings()[0]);
  EXPECT_EQ(env.files.list(".")->size(), 1U) << "no .part is left";
  EXPECT_FAILS(unit->download(info, env.files, "x.gt3x"), ErrorCode::cannot_create);
}

TEST(WireDownload, ABrokenDownloadResumes) {
  Bench bench;
  auto unit = *WireUnit::open(bench.link());
  const RecordingInfo info = record(bench, *unit, 300);
  MemoryEnv env;
  // The unit goes away in mid-download.
  const auto pull = [&](std::uint64_t at) { bench.plugged->unplugged = at > info.bytes / 2; };
  EXPECT_FAILS(unit->download(info, env.files, "x.gt3x", pull), ErrorCode::device_unavailable);
  EXPECT_FALSE(env.files.info("x.gt3x"));
  const auto left = env.files.list(".");
  ASSERT_EQ(left->size(), 1U);
  const std::uint64_t kept = env.files.info(left->front())->size;
  EXPECT_GT(kept, info.bytes / 2);
  env.files.lose_power();  // what was kept was synced
  EXPECT_EQ(env.files.info(left->front())->size, kept);

  bench.plugged->unplugged = false;
  std::uint64_t first = 0;
  ASSERT_OK(unit->download(info, env.files, "x.gt3x",
                           [&](std::uint64_t at) { first = first == 0 ? at : first; }));
  EXPECT_GT(first, kept) << "went on where it broke";
  EXPECT_EQ(sha256(*read_file(env.files, "x.gt3x")), info.sha256);
  EXPECT_EQ(env.files.list(".")->size(), 1U);
}

// Blocks lost, doubled and damaged on the way; the file is right or there is none.
TEST(WireDownload, DownloadSurvivesLossDamageAndRepetition) {
  Bench bench;
  Link link = bench.link();
  int block = 0;
  link.bulk =
      std::make_unique<TamperingTransport>(std::move(link.bulk), nullptr, [&](Bytes& bytes) {
        ++block;
        if (block % 5 == 2) {
          bytes[bytes.size() / 2] ^= 1;
        }
        return block % 7 == 3 ? 0 : block % 4 == 1 ? 2 : 1;
      });
  auto unit = *WireUnit::open(std::move(link));
  const RecordingInfo info = record(bench, *unit, 600);
  MemoryEnv env;
  ASSERT_OK(unit->download(info, env.files, "x.gt3x"));
  EXPECT_EQ(sha256(*read_file(env.files, "x.gt3x")), info.sha256);
}

TEST(WireDownload, ADownloadThatIsNotWhatWasAnnouncedIsThrownAway) {
  Bench bench;
  auto unit = *WireUnit::open(bench.link());
  RecordingInfo info = record(bench, *unit, 60);
  info.sha256[0] ^= 1;
  MemoryEnv env;
  EXPECT_FAILS(unit->download(info, env.files, "x.gt3x"), ErrorCode::bad_data);
  EXPECT_TRUE(env.files.list(".")->empty());
  info.bytes += 5;
  EXPECT_FAILS(unit->download(info, env.files, "y.gt3x"), ErrorCode::bad_data);
}

std::string text_of(const Bytes& bytes) { return {bytes.begin(), bytes.end()}; }

// A device on reports alone, over Bluetooth for example.
TEST(WireDownload, WithoutABulkChannelThereIsNoDownload) {
  Bench bench;
  Link link = bench.link();
  link.bulk.reset();
  auto unit = *WireUnit::open(std::move(link));
  EXPECT_FALSE(unit->abilities().offers_recordings);
  const RecordingInfo info = record(bench, *unit, 60);
  MemoryEnv env;
  EXPECT_FAILS(unit->download(info, env.files, "x.gt3x"), ErrorCode::device_unavailable);
  EXPECT_TRUE(env.files.list(".")->empty());
}

// Oracle: the unit's own bytes. What an earlier call kept may be of any length; a part of another
// recording has another name and is left alone.
TEST(WireDownload, APartOfAnyLengthIsContinued) {
  Bench bench;
  auto unit = *WireUnit::open(bench.link());
  const RecordingInfo info = record(bench, *unit, 300);
  const Bytes whole = bench.plugged->unit.recordings()[0];
  ASSERT_EQ(whole.size(), info.bytes);
  const std::string part = "x.gt3x." + to_hex(info.sha256).substr(0, 12) + ".part";
  for (const std::size_t kept :
       {std::size_t{0}, std::size_t{1}, whole.size() / 2, whole.size() - 1, whole.size()}) {
    MemoryEnv env;
    ASSERT_OK(write_file(env.files, part, text_of(whole).substr(0, kept)));
    ASSERT_OK(write_file(env.files, "x.gt3x.000000000000.part", "another"));
    std::uint64_t first = 0;
    ASSERT_OK(unit->download(info, env.files, "x.gt3x",
                             [&](std::uint64_t at) { first = first == 0 ? at : first; }));
    EXPECT_EQ(*read_file(env.files, "x.gt3x"), whole) << kept;
    EXPECT_TRUE(kept == whole.size() ? first == 0 : first > kept) << kept;
    EXPECT_EQ(env.files.info("x.gt3x.000000000000.part")->size, 7U);
    EXPECT_FALSE(env.files.info(part));
  }
}

// A loss of power while the part was copied leaves two files: the longer is continued.
TEST(WireDownload, OfTwoPartsTheLongerIsContinued) {
  Bench bench;
  auto unit = *WireUnit::open(bench.link());
  const RecordingInfo info = record(bench, *unit, 300);
  const Bytes whole = bench.plugged->unit.recordings()[0];
  const std::string part = "x.gt3x." + to_hex(info.sha256).substr(0, 12) + ".part";
  const std::size_t half = whole.size() / 2;
  for (const auto& [in_part, in_before] :
       {std::pair{std::size_t{100}, half}, std::pair{half, std::size_t{100}}}) {
    MemoryEnv env;
    ASSERT_OK(write_file(env.files, part, text_of(whole).substr(0, in_part)));
    ASSERT_OK(write_file(env.files, part + ".before", text_of(whole).substr(0, in_before)));
    std::uint64_t first = 0;
    ASSERT_OK(unit->download(info, env.files, "x.gt3x",
                             [&](std::uint64_t at) { first = first == 0 ? at : first; }));
    EXPECT_EQ(*read_file(env.files, "x.gt3x"), whole);
    EXPECT_GT(first, half);
    EXPECT_EQ(env.files.list(".")->size(), 1U) << "neither part is left";
  }
}

// Nothing that is wrong stays: a part with other bytes makes the hash fail, and the next call
// begins anew.
TEST(WireDownload, ADamagedPartIsThrownAwayAndTheNextCallBeginsAnew) {
  Bench bench;
  auto unit = *WireUnit::open(bench.link());
  const RecordingInfo info = record(bench, *unit, 60);
  Bytes damaged = bench.plugged->unit.recordings()[0];
  damaged.resize(damaged.size() / 2);
  damaged[100] ^= 1;
  MemoryEnv env;
  const std::string part = "x.gt3x." + to_hex(info.sha256).substr(0, 12) + ".part";
  ASSERT_OK(write_file(env.files, part, text_of(damaged)));
  EXPECT_FAILS(unit->download(info, env.files, "x.gt3x"), ErrorCode::bad_data);
  EXPECT_TRUE(env.files.list(".")->empty());
  EXPECT_OK(unit->download(info, env.files, "x.gt3x"));
  EXPECT_EQ(*read_file(env.files, "x.gt3x"), bench.plugged->unit.recordings()[0]);
}

// A unit whose blocks never come: the download ends after its attempts and says how far it came.
TEST(WireDownload, SilenceOnTheBulkChannelEndsTheDownload) {
  Bench bench;
  Link link = bench.link();
  link.bulk =
      std::make_unique<TamperingTransport>(std::move(link.bulk), nullptr, [](Bytes&) { return 0; });
  WireOptions options;
  options.download_attempts = 3;
  auto unit = *WireUnit::open(std::move(link), options);
  const RecordingInfo info = record(bench, *unit, 60);
  MemoryEnv env;
  const Status came = unit->download(info, env.files, "x.gt3x");
  EXPECT_FAILS(came, ErrorCode::device_unavailable);
  EXPECT_NE(came.error().what.find("stopped at byte 0 of " + std::to_string(info.bytes)),
            std::string::npos)
      << came.error().what;
  EXPECT_FALSE(env.files.info("x.gt3x"));
}

TEST(WireDownload, AnOfferOfAnotherLengthIsRefused) {
  const std::vector<tests::Change> rows = {[](Message& reply) { reply.payload[0] ^= 1; },
                                           [](Message& reply) { reply.payload.pop_back(); }};
  for (const tests::Change& row : rows) {
    Bench bench;
    const auto unit = *WireUnit::open(tests::changed(bench.link(), {}, [&](Message& reply) {
      if (reply.command == Command::download) {
        row(reply);
      }
    }));
    const RecordingInfo info = record(bench, *unit, 60);
    MemoryEnv env;
    const Status came = unit->download(info, env.files, "x.gt3x");
    EXPECT_FAILS(came, ErrorCode::bad_data);
    EXPECT_EQ(came.error().what, "the unit offers another length than its list says");
    EXPECT_FALSE(env.files.info("x.gt3x"));
  }
}

// Oracle: the unit's own bytes. A whole block, with a right CRC, that belongs elsewhere: before the
// first right one of a request it is left over from an earlier one, and later the rest is asked for
// again. More blocks are in no pipe than the 64 that are dropped: then too.
TEST(WireDownload, BlocksThatBelongElsewhereAreDropped) {
  const auto forged = [](const Bytes& bytes, const std::function<void(BulkBlock&)>& change) {
    BulkBlock block = *decode_bulk(bytes);
    change(block);
    return encode_bulk(block);
  };
  const Bytes too_long(kBulkContentBytes, 0xEE);
  const std::vector<std::function<void(BulkBlock&)>> rows = {
      [](BulkBlock& block) { ++block.recording; },
      [](BulkBlock& block) { ++block.offset; },
      [&](BulkBlock& block) { block.content = too_long; },
  };
  for (std::size_t row = 0; row < rows.size(); ++row) {
    for (const int times : {1, 70}) {
      for (const int at : {0, 1}) {
        SCOPED_TRACE(testing::Message() << row << ", " << times << " times, at block " << at);
        Bench bench;
        Link link = bench.link();
        int number = 0;
        link.bulk =
            std::make_unique<TamperingTransport>(std::move(link.bulk), nullptr, [&](Bytes& bytes) {
              // The last block is the one that must not be longer than what is left.
              const bool now =
                  row == 2 ? decode_bulk(bytes)->last && number++ == 0 : number++ == at;
              if (now) {
                bytes = forged(bytes, rows[row]);
              }
              return now ? times : 1;
            });
        const auto unit = *WireUnit::open(std::move(link));
        const RecordingInfo info = record(bench, *unit, 600);
        ASSERT_GT(info.bytes, 3 * kBulkContentBytes);
        MemoryEnv env;
        ASSERT_OK(unit->download(info, env.files, "x.gt3x"));
        EXPECT_EQ(*read_file(env.files, "x.gt3x"), bench.plugged->unit.recordings()[0]);
      }
    }
  }
}

// A unit that sends nothing but other blocks does not keep the station for ever.
TEST(WireDownload, AFloodOfOtherBlocksEndsTheDownload) {
  Bench bench;
  Link link = bench.link();
  const Bytes other = encode_bulk({99, false, 0, Bytes(1000, 0xEE)});
  link.bulk =
      std::make_unique<TamperingTransport>(std::move(link.bulk), nullptr, [&](Bytes& bytes) {
        bytes = other;
        return 100;
      });
  const auto unit = *WireUnit::open(std::move(link));
  const RecordingInfo info = record(bench, *unit, 600);
  MemoryEnv env;
  EXPECT_FAILS(unit->download(info, env.files, "x.gt3x"), ErrorCode::device_unavailable);
  EXPECT_FALSE(env.files.info("x.gt3x"));
}

}  // namespace
}  // namespace sixpoint::device
