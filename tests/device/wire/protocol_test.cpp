#include "device/wire/protocol.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include "base/crc_ccitt.h"
#include "base/random.h"
#include "device/wire/payload.h"
#include "expect_result.h"

namespace sixpoint::device {
namespace {

// Oracle: docs/protocol.md, byte by byte.
TEST(Protocol, AReportIsLaidOutAsWritten) {
  const Report report = encode({ReportKind::request, 0x1234, Command::start_stream, ReplyCode::ok,
                                PayloadWriter().put(std::uint16_t{100}).take()});
  EXPECT_EQ(report[0], 1);
  EXPECT_EQ(report[1], 1);
  EXPECT_EQ(report[2], 0x34);
  EXPECT_EQ(report[3], 0x12);
  EXPECT_EQ(report[4], 10);
  EXPECT_EQ(report[5], 0);
  EXPECT_EQ(report[6], 2);
  EXPECT_EQ(report[8], 100);
  EXPECT_EQ(report[9], 0);
  const std::uint16_t crc = crc_ccitt(std::span(report).first(62));
  EXPECT_EQ(report[62], crc & 0xFF);
  EXPECT_EQ(report[63], crc >> 8);
}

TEST(Protocol, RoundTrips) {
  const Message message{ReportKind::reply, 65535, Command::commit, ReplyCode::crc_mismatch,
                        Bytes(kPayloadBytes, 0xAB)};
  EXPECT_EQ(*decode(encode(message)), message);

  Identity identity;
  identity.battery_mv = 4100;
  identity.serial = "MOS2A45130450";
  identity.firmware = "1.5.0";
  identity.model = "wGT3XBT";
  const Bytes payload = encode_identity(identity);
  EXPECT_LE(payload.size(), kPayloadBytes);
  EXPECT_EQ(*decode_identity(payload), identity);

  const FilterState filter{FilterConfiguration::current, FilterConfiguration::legacy};
  EXPECT_EQ(*decode_filter(encode_filter(filter)), filter);

  SampleBlock block;
  block.sequence = 77;
  block.first_index = 0xFFFFFFF0;
  block.device_time_us = 1ULL << 40U;
  block.temperature_c = -12.34;
  block.counts.assign(kSamplesPerReport, RawCounts{-2048, 2047, -1});
  const Message samples = encode_samples(block);
  EXPECT_LE(samples.payload.size(), kPayloadBytes);
  EXPECT_EQ(*decode_samples(*decode(encode(samples))), block);

  RecordingEntry entry{4096, {2, 1ULL << 32U, 1'400'000'000, {}}};  // the most there may be
  entry.info.sha256.fill(9);
  EXPECT_LE(encode_recording(entry).size(), kPayloadBytes);
  EXPECT_EQ(decode_recording(encode_recording(entry))->info, entry.info);
  EXPECT_EQ(decode_recording(encode_recording({}))->count, 0);

  const Bytes content(kBulkContentBytes, 0x5A);
  const Bytes bulk = encode_bulk({7, true, 1ULL << 33U, content});
  EXPECT_EQ(bulk.size(), kBulkBlockBytes);
  const auto decoded = decode_bulk(bulk);
  ASSERT_OK(decoded);
  EXPECT_EQ(decoded->recording, 7);
  EXPECT_TRUE(decoded->last);
  EXPECT_EQ(decoded->offset, 1ULL << 33U);
  EXPECT_EQ(Bytes(decoded->content.begin(), decoded->content.end()), content);
}

// CRC-CCITT finds every change within 16 bits: each byte turned into each other value, and each
// truncation, must be refused.
TEST(Protocol, EveryFlippedByteOfAReportIsRefused) {
  SampleBlock block;
  block.counts.assign(kSamplesPerReport, RawCounts{300, -20, 47});
  const Report whole = encode(encode_samples(block));
  ASSERT_OK(decode(whole));
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (unsigned flip = 1; flip < 256; ++flip) {
      Report report = whole;
      report[at] = static_cast<std::uint8_t>(report[at] ^ flip);
      ASSERT_FALSE(decode(report)) << "byte " << at << " flip " << flip;
    }
  }
  for (std::size_t length = 0; length < whole.size(); ++length) {
    EXPECT_FAILS(decode(std::span(whole).first(length)), ErrorCode::bad_data);
  }
  Bytes longer(whole.begin(), whole.end());
  longer.push_back(0);
  EXPECT_FAILS(decode(longer), ErrorCode::bad_data);
}

TEST(Protocol, EveryFlippedByteOfABulkBlockIsRefused) {
  const Bytes content(100, 0x11);
  const Bytes whole = encode_bulk({7, false, 4096, content});
  ASSERT_OK(decode_bulk(whole));
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (unsigned flip = 1; flip < 256; ++flip) {
      Bytes bytes = whole;
      bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ flip);
      ASSERT_FALSE(decode_bulk(bytes)) << "byte " << at;
    }
  }
  for (std::size_t length = 0; length < whole.size(); ++length) {
    ASSERT_FALSE(decode_bulk(std::span(whole).first(length)));
  }
  EXPECT_FAILS(decode_bulk(Bytes(kBulkBlockBytes + 1)), ErrorCode::bad_data);
}

// With a right CRC the content may still be impossible: a hostile unit computes CRCs too.
TEST(Protocol, WellFormedNonsenseIsRefused) {
  const auto refused = [](Report report) {
    const std::uint16_t crc = crc_ccitt(std::span(report).first(62));
    report[62] = static_cast<std::uint8_t>(crc & 0xFF);
    report[63] = static_cast<std::uint8_t>(crc >> 8);
    return !decode(report).has_value();
  };
  const Report good = encode({});
  EXPECT_FALSE(refused(good));
  for (const auto& [at, value] :
       {std::pair{0, 2}, {1, 0}, {1, 4}, {6, 55}, {6, 255}, {7, 1}, {8, 1}}) {
    Report report = good;
    report[static_cast<std::size_t>(at)] = static_cast<std::uint8_t>(value);
    EXPECT_TRUE(refused(report)) << at << " = " << value;
  }

  Identity identity;
  identity.serial = "MOS2\x1b[2J";
  EXPECT_FAILS(decode_identity(encode_identity(identity)), ErrorCode::bad_data);
  identity.serial = "";
  EXPECT_FAILS(decode_identity(encode_identity(identity)), ErrorCode::bad_data);
  identity.serial = "MOS2A45130450";
  identity.accel_scale_lsb_per_g = 0;
  EXPECT_FAILS(decode_identity(encode_identity(identity)), ErrorCode::bad_data);
  EXPECT_FAILS(decode_identity(Bytes(47)), ErrorCode::bad_data);
  EXPECT_FAILS(decode_filter(Bytes{2, 0}), ErrorCode::bad_data);
  EXPECT_FAILS(decode_filter(Bytes{0}), ErrorCode::bad_data);
  EXPECT_FAILS(decode_recording(Bytes{1, 0, 5}), ErrorCode::bad_data);
  EXPECT_FAILS(decode_recording(Bytes{}), ErrorCode::bad_data);
  EXPECT_FAILS(decode_recording(encode_recording({4097, {}})), ErrorCode::bad_data);
  EXPECT_FAILS(decode_recording(encode_recording({1, {1, (1ULL << 32U) + 1, 0, {}}})),
               ErrorCode::bad_data);

  SampleBlock block;
  block.counts.assign(2, RawCounts{});
  for (const unsigned count : {0U, 1U, 3U, 7U, 255U}) {
    Message message = encode_samples(block);
    message.payload[15] = static_cast<std::uint8_t>(count);
    EXPECT_FAILS(decode_samples(message), ErrorCode::bad_data);
  }
  Message filter = encode_samples(block);
  filter.payload[14] = 9;
  EXPECT_FAILS(decode_samples(filter), ErrorCode::bad_data);
}

TEST(Protocol, RandomBytesNeverPassAndNeverCrash) {
  Random random(3);
  int accepted = 0;
  for (int i = 0; i < 20'000; ++i) {
    Bytes bytes(random.below(100));
    for (auto& byte : bytes) {
      byte = static_cast<std::uint8_t>(random.below(256));
    }
    accepted += decode(bytes).has_value() ? 1 : 0;
    accepted += decode_bulk(bytes).has_value() ? 1 : 0;
    decode_identity(bytes).has_value();
    Message message{ReportKind::samples, 0, Command::none, ReplyCode::ok, bytes};
    if (const auto block = decode_samples(message)) {
      EXPECT_LE(block->counts.size(), kSamplesPerReport);
    }
  }
  EXPECT_EQ(accepted, 0);
}

// Found by the fuzzer: the field can hold -325 degrees.
TEST(Samples, ColderThanAbsoluteZeroIsDamage) {
  SampleBlock block;
  block.counts.push_back({1, 2, 3});
  block.temperature_c = -273.15;
  EXPECT_OK(decode_samples(encode_samples(block)));
  Message message = encode_samples(block);
  message.payload[12] = 0xFF;
  message.payload[13] = 0x80;
  EXPECT_FAILS(decode_samples(message), ErrorCode::bad_data);
}

// A block with a right CRC (zlib's, as the header says) and one wrong field.
TEST(Protocol, ABulkBlockWithAWrongHeaderIsRefused) {
  struct Row {
    std::size_t at;
    std::uint8_t value;
  };
  const Bytes whole = encode_bulk({7, true, 4096, Bytes(100, 0x11)});
  const auto with = [&](const Row& row) {
    Bytes bytes(whole.begin(), whole.end() - 4);
    bytes[row.at] = row.value;
    const auto crc = ::crc32(0, bytes.data(), static_cast<unsigned>(bytes.size()));
    for (unsigned shift = 0; shift < 32; shift += 8) {
      bytes.push_back(static_cast<std::uint8_t>((crc >> shift) & 0xFFU));
    }
    return bytes;
  };
  EXPECT_EQ(with({0, 'S'}), whole);
  for (const Row& row : {Row{0, 's'}, Row{3, '2'}, Row{16, 0}, Row{16, 99}, Row{16, 101}}) {
    const auto block = decode_bulk(with(row));
    EXPECT_FAILS(block, ErrorCode::bad_data);
    EXPECT_EQ(block.error().what, "a bulk block's header makes no sense") << row.at;
  }
}

TEST(Protocol, WhatIsOfAnotherKindIsNotTakenForSamplesOrAFilter) {
  SampleBlock block;
  block.counts.assign(2, RawCounts{});
  Message message = encode_samples(block);
  EXPECT_OK(decode_samples(message));
  message.kind = ReportKind::reply;
  EXPECT_FAILS(decode_samples(message), ErrorCode::bad_data);
  EXPECT_FAILS(decode_filter(Bytes{0, 2}), ErrorCode::bad_data);
  Identity identity;
  identity.serial = "MOS2A45130450";
  identity.version = 0;
  EXPECT_FAILS(decode_identity(encode_identity(identity)), ErrorCode::bad_data);
  EXPECT_EQ(to_string(static_cast<Command>(77)), "unknown");
  EXPECT_EQ(to_string(static_cast<ReplyCode>(77)), "unknown code");
}

}  // namespace
}  // namespace sixpoint::device
