#include "protocol/tile_frame.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace spectra::protocol {
namespace {

TileFrameHeader example() {
  TileFrameHeader header;
  header.kind = FrameKind::Colours;
  header.child_mask = 0x81;
  header.sequence = 0x04030201;
  header.generation = 9;
  header.tile = {3, 5, 6, 0xFFFFFFFF};
  header.revision = 77;
  header.vertex_count = 32'000;
  header.origin_m = {1.5F, -2.25F, 1e-3F};
  header.position_step_m = 0.001953125F;
  header.geometric_error_m = 0.25F;
  header.lowest_celsius = -12.5F;
  header.highest_celsius = 99.0F;
  header.payload_size_bytes = 5;
  header.colour_error_levels = 3.5F;
  header.temperature_error_celsius = 0.5F;
  return header;
}

std::vector<std::byte> message(const TileFrameHeader& header, std::size_t payload_size) {
  const auto bytes = encoded_header(header);
  std::vector<std::byte> all(bytes.begin(), bytes.end());
  for (std::size_t i = 0; i < payload_size; ++i) all.push_back(static_cast<std::byte>(i));
  return all;
}

TEST(EncodedHeader, PutsEveryFieldWhereTheTableSays) {
  const auto bytes = encoded_header(example());
  const auto at = [&bytes](std::size_t i) { return std::to_integer<int>(bytes.at(i)); };
  EXPECT_EQ(at(0), 'S');
  EXPECT_EQ(at(1), 'P');
  EXPECT_EQ(at(2), 'C');
  EXPECT_EQ(at(3), '1');
  EXPECT_EQ(at(4), 2);
  EXPECT_EQ(at(5), 0x81);
  EXPECT_EQ(at(6) | at(7) << 8, 80);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(at(kTileFrameSequenceOffset + static_cast<std::size_t>(i)), i + 1);
  EXPECT_EQ(at(12), 9);
  EXPECT_EQ(at(16), 3);
  EXPECT_EQ(at(17) | at(18) | at(19), 0);
  EXPECT_EQ(at(20), 5);
  EXPECT_EQ(at(24), 6);
  EXPECT_EQ(at(31), 0xFF);
  EXPECT_EQ(at(32), 77);
  EXPECT_EQ(at(36) | at(37) << 8, 32'000);
  EXPECT_EQ(at(42) | at(43) << 8, 0x3FC0);  // 1.5
  EXPECT_EQ(at(54) | at(55) << 8, 0x3B00);  // 2^-9
  EXPECT_EQ(at(58) | at(59) << 8, 0x3E80);  // 0.25
  EXPECT_EQ(at(62) | at(63) << 8, 0xC148);  // -12.5
  EXPECT_EQ(at(66) | at(67) << 8, 0x42C6);  // 99
  EXPECT_EQ(at(68), 5);
  EXPECT_EQ(at(74) | at(75) << 8, 0x4060);  // 3.5
  EXPECT_EQ(at(78) | at(79) << 8, 0x3F00);  // 0.5
}

TEST(DecodedFrame, GivesBackWhatWasEncoded) {
  const auto bytes = message(example(), 5);
  const auto frame = decoded_frame(bytes);
  ASSERT_TRUE(frame.has_value()) << frame.error().message;
  const TileFrameHeader& header = frame.value().header;
  EXPECT_EQ(header.kind, FrameKind::Colours);
  EXPECT_EQ(header.tile, (TileId{3, 5, 6, 0xFFFFFFFF}));
  EXPECT_EQ(header.sequence, 0x04030201U);
  EXPECT_EQ(header.origin_m, example().origin_m);
  EXPECT_EQ(frame.value().payload.size(), 5U);
  EXPECT_EQ(encoded_header(header), encoded_header(example()));
}

TEST(DecodedFrame, KeepsMissingTemperatureAsNaN) {
  TileFrameHeader header = example();
  header.lowest_celsius = header.highest_celsius = std::numeric_limits<float>::quiet_NaN();
  header.payload_size_bytes = 0;
  const auto bytes = message(header, 0);
  const auto frame = decoded_frame(bytes);
  ASSERT_TRUE(frame.has_value());
  EXPECT_TRUE(std::isnan(frame.value().header.lowest_celsius));
  EXPECT_TRUE(std::isnan(frame.value().header.highest_celsius));
}

TEST(DecodedFrame, SkipsALargerHeaderAndPassesUnknownKindsOn) {
  auto bytes = message(example(), 5 + 8);
  bytes[6] = std::byte{88};
  bytes[4] = std::byte{200};
  const auto frame = decoded_frame(bytes);
  ASSERT_TRUE(frame.has_value()) << frame.error().message;
  EXPECT_EQ(static_cast<int>(frame.value().header.kind), 200);
  EXPECT_EQ(frame.value().payload.front(), std::byte{8});
}

TEST(DecodedFrame, TakesAHeaderThatEndsBeforeTheErrors) {
  auto bytes = message(example(), 5);
  bytes.erase(bytes.begin() + 72, bytes.begin() + 80);
  bytes[6] = std::byte{72};
  const auto frame = decoded_frame(bytes);
  ASSERT_TRUE(frame.has_value()) << frame.error().message;
  EXPECT_TRUE(std::isnan(frame.value().header.colour_error_levels));
  EXPECT_TRUE(std::isnan(frame.value().header.temperature_error_celsius));
  EXPECT_EQ(frame.value().payload.size(), 5U);
  EXPECT_EQ(frame.value().payload.front(), std::byte{0});
}

TEST(DecodedFrame, RefusesEveryTruncationAndExcess) {
  const auto bytes = message(example(), 5);
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_TRUE(decoded_frame(std::span(bytes).first(size)).has_error()) << size;
  EXPECT_TRUE(decoded_frame(message(example(), 6)).has_error());
}

TEST(DecodedFrame, RefusesWrongMagicAndHeaderSize) {
  auto wrong_magic = message(example(), 5);
  wrong_magic[0] = std::byte{'X'};
  EXPECT_EQ(decoded_frame(wrong_magic).error().field, "magic");
  auto small_header = message(example(), 5);
  small_header[6] = std::byte{71};
  EXPECT_EQ(decoded_frame(small_header).error().field, "header_size");
  auto large_header = message(example(), 5);
  large_header[7] = std::byte{1};
  EXPECT_EQ(decoded_frame(large_header).error().field, "header_size");
}

}  // namespace
}  // namespace spectra::protocol
