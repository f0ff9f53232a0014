#include "protocol/codec/draco_codec.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <string>
#include <vector>

namespace spectra::protocol::codec {
namespace {

struct Input {
  std::vector<LatticePoint> positions;
  std::vector<TileTriangle> triangles;
};

/// A wavy sheet of side x side vertices.
Input sheet(std::int32_t side) {
  Input input;
  for (std::int32_t y = 0; y < side; ++y)
    for (std::int32_t x = 0; x < side; ++x) input.positions.push_back({10 * x, 10 * y, (x * x + 3 * y) % 17});
  const auto at = [side](std::int32_t x, std::int32_t y) { return static_cast<std::uint32_t>(y * side + x); };
  for (std::int32_t y = 0; y + 1 < side; ++y)
    for (std::int32_t x = 0; x + 1 < side; ++x) {
      input.triangles.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
      input.triangles.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
    }
  return input;
}

/// Triangles thrown together: non-manifold edges and vertices, duplicates, repeated indices, unused vertices.
Input soup(std::uint32_t seed, std::uint32_t vertex_count, std::uint32_t triangle_count, std::int32_t extent) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<std::int32_t> coordinate(0, extent);
  std::uniform_int_distribution<std::uint32_t> vertex(0, vertex_count - 1);
  Input input;
  for (std::uint32_t i = 0; i < vertex_count; ++i)
    input.positions.push_back({coordinate(random), coordinate(random), coordinate(random)});
  for (std::uint32_t i = 0; i < triangle_count; ++i)
    input.triangles.push_back({vertex(random), vertex(random), vertex(random)});
  return input;
}

/// How often each triangle is there, by input vertex, whatever its rotation.
std::map<TileTriangle, int> census(const std::vector<TileTriangle>& triangles) {
  std::map<TileTriangle, int> count;
  for (TileTriangle triangle : triangles) {
    std::rotate(triangle.begin(), std::min_element(triangle.begin(), triangle.end()), triangle.end());
    // Two corners that share the smallest index: the rotation that starts with both.
    if (triangle[0] == triangle[2]) std::rotate(triangle.begin(), triangle.begin() + 2, triangle.end());
    ++count[triangle];
  }
  return count;
}

/// Everything a client relies on, checked without the codec's own proof.
void expect_faithful(const Input& input, float step_m, int speed) {
  const auto encoded = encoded_geometry(input.positions, input.triangles, step_m, speed);
  ASSERT_TRUE(encoded.has_value()) << encoded.error().message;
  const auto decoded = decoded_geometry(encoded.value().payload);
  ASSERT_TRUE(decoded.has_value()) << decoded.error().message;
  const std::vector<std::uint32_t>& map = encoded.value().input_of_decoded;
  ASSERT_EQ(map.size(), decoded.value().positions_m.size());
  for (std::size_t i = 0; i < map.size(); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      ASSERT_EQ(decoded.value().positions_m[i][axis], static_cast<float>(input.positions.at(map[i])[axis]) * step_m);
  std::vector<TileTriangle> seen;
  for (const TileTriangle& t : decoded.value().triangles) seen.push_back({map.at(t[0]), map.at(t[1]), map.at(t[2])});
  EXPECT_EQ(census(seen), census(input.triangles));
}

TEST(EncodedGeometry, GivesBackEveryVertexAndTriangleOfASheetAtEverySpeed) {
  for (int speed = 0; speed <= 10; ++speed) expect_faithful(sheet(40), 0.00390625F, speed);
}

TEST(EncodedGeometry, GivesBackAnySoupOfTriangles) {
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    expect_faithful(soup(seed, 3 + seed * 7, 1 + seed * 11, 1000), 0.0625F, static_cast<int>(seed % 11));
    expect_faithful(soup(seed, 12, 200, 50), 5.0F / 1024, static_cast<int>(seed % 11));
  }
}

TEST(EncodedGeometry, KeepsTrianglesWhoseVerticesFallOnOnePoint) {
  Input input = sheet(12);
  for (LatticePoint& point : input.positions)
    for (std::int32_t& coordinate : point) coordinate /= 40;
  expect_faithful(input, 0.5F, 7);
  for (LatticePoint& point : input.positions) point = {0, 0, 0};
  expect_faithful(input, 0.5F, 7);
}

TEST(EncodedGeometry, KeepsATriangleThatNamesAVertexTwiceOrThrice) {
  expect_faithful({{{0, 0, 0}, {5, 0, 0}, {0, 5, 1}}, {{0, 1, 1}, {0, 1, 2}, {2, 1, 2}}}, 1.0F, 7);
  expect_faithful({{{3, 4, 5}}, {{0, 0, 0}}}, 1.0F, 7);
}

TEST(EncodedGeometry, KeepsAFanOfManyTrianglesWithCopiesOfItsCentre) {
  Input fan;
  constexpr std::int32_t kRim = 20'001;
  fan.positions.push_back({0, 0, 0});
  for (std::int32_t i = 0; i < kRim; ++i) fan.positions.push_back({1 + i % 150, 1 + i / 150, i % 7});
  for (std::uint32_t i = 1; i < kRim; ++i) fan.triangles.push_back({0, i, i + 1});
  expect_faithful(fan, 0.001F, 7);
  const auto encoded = encoded_geometry(fan.positions, fan.triangles, 0.001F, 7).value();
  EXPECT_GE(std::count(encoded.input_of_decoded.begin(), encoded.input_of_decoded.end(), 0U), 20);
}

TEST(EncodedGeometry, LeavesOutVerticesOfNoTriangle) {
  Input input{{{9, 9, 9}, {0, 0, 0}, {5, 0, 0}, {8, 8, 8}, {0, 5, 0}}, {{1, 2, 4}}};
  const auto encoded = encoded_geometry(input.positions, input.triangles, 0.25F, 7);
  ASSERT_TRUE(encoded.has_value());
  std::vector<std::uint32_t> map = encoded.value().input_of_decoded;
  std::sort(map.begin(), map.end());
  EXPECT_EQ(map, (std::vector<std::uint32_t>{1, 2, 4}));
}

TEST(EncodedGeometry, IsExactOnTheWholeLatticeForEveryMantissaOfAStep) {
  const std::int32_t last = (1 << 21) - 1;
  for (const int mantissa : {4, 5, 6, 7})
    for (const int exponent : {-40, -14, -3, 0, 20}) {
      const float step_m = std::ldexp(static_cast<float>(mantissa), exponent);
      Input input{{{last, 0, 1}, {last - 1, last / 3, last}, {0, last / 7, 12345}, {1, 1, 1}}, {{0, 1, 2}, {1, 3, 2}}};
      expect_faithful(input, step_m, 7);
      input.triangles.clear();
      expect_faithful(input, step_m, 7);
    }
}

TEST(EncodedGeometry, IsExactOnALargerLatticeWhereTheStepIsAPowerOfTwo) {
  const std::int32_t last = (1 << 23) - 1;
  Input input{{{last, 0, 1}, {last - 1, last / 3, last}, {0, last / 7, 12345}, {1, 1, 1}}, {{0, 1, 2}, {1, 3, 2}}};
  expect_faithful(input, 0x1p-9F, 7);
  input.triangles.clear();
  expect_faithful(input, 0x1p-9F, 7);
}

TEST(EncodedGeometry, GivesBackEveryPointOfACloud) {
  std::mt19937 random(7);
  std::uniform_int_distribution<std::int32_t> coordinate(0, 90);
  for (const std::size_t count : {1U, 2U, 3U, 65U, 5000U}) {
    Input input;
    for (std::size_t i = 0; i < count; ++i)
      input.positions.push_back({coordinate(random), coordinate(random), coordinate(random) / 30});
    for (int speed = 0; speed <= 10; ++speed) expect_faithful(input, 0.0048828125F, speed);
    const auto encoded = encoded_geometry(input.positions, {}, 1.0F, 7);
    ASSERT_TRUE(encoded.has_value());
    std::vector<std::uint32_t> map = encoded.value().input_of_decoded;
    std::sort(map.begin(), map.end());
    for (std::uint32_t i = 0; i < count; ++i) ASSERT_EQ(map.at(i), i);
  }
}

TEST(EncodedGeometry, RefusesWhatIsNoTile) {
  const std::vector<LatticePoint> positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<TileTriangle> triangles{{0, 1, 2}};
  const auto code = [](const auto& result) {
    return result.has_error() ? result.error().code : RpcErrorCode::ParseError;
  };
  EXPECT_EQ(code(encoded_geometry({}, {}, 1.0F, 7)), RpcErrorCode::InternalError);
  EXPECT_EQ(code(encoded_geometry(positions, triangles, 0.0F, 7)), RpcErrorCode::InternalError);
  EXPECT_EQ(code(encoded_geometry(positions, triangles, 1.0F, 11)), RpcErrorCode::InternalError);
  const std::vector<TileTriangle> beyond{{0, 1, 3}};
  EXPECT_EQ(code(encoded_geometry(positions, beyond, 1.0F, 7)), RpcErrorCode::InternalError);
  const std::vector<LatticePoint> outside{{0, 0, 0}, {1 << 23, 0, 0}, {0, 1, 0}};
  EXPECT_EQ(code(encoded_geometry(outside, triangles, 1.0F, 7)), RpcErrorCode::InternalError);
  const std::vector<LatticePoint> negative{{0, 0, 0}, {-1, 0, 0}, {0, 1, 0}};
  EXPECT_EQ(code(encoded_geometry(negative, triangles, 1.0F, 7)), RpcErrorCode::InternalError);
}

TEST(RoundedChannel, RoundsToTheNearestMultipleHalfUpAnd256Becomes255) {
  EXPECT_EQ(rounded_channel(130, 8), 130);
  EXPECT_EQ(rounded_channel(129, 6), 128);
  EXPECT_EQ(rounded_channel(130, 6), 132);
  EXPECT_EQ(rounded_channel(253, 6), 252);
  EXPECT_EQ(rounded_channel(254, 6), 255);
  EXPECT_EQ(rounded_channel(7, 4), 0);
  EXPECT_EQ(rounded_channel(8, 4), 16);
  EXPECT_EQ(rounded_channel(248, 4), 255);
  for (int bits = 4; bits <= 8; ++bits)
    for (int value = 0; value < 256; ++value) {
      const std::uint8_t once = rounded_channel(static_cast<std::uint8_t>(value), bits);
      EXPECT_LE(std::abs(once - value), (1 << (8 - bits)) / 2);
      EXPECT_EQ(rounded_channel(once, bits), once);
    }
}

TEST(EncodedColours, DecodeInOrderToTheRoundedColours) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> channel(0, 255);
  for (const std::size_t count : {1U, 2U, 17U, 4000U}) {
    std::vector<ColourBytes> colours(count);
    for (ColourBytes& colour : colours)
      for (std::uint8_t& value : colour) value = static_cast<std::uint8_t>(channel(random));
    for (int bits = 4; bits <= 8; ++bits)
      for (const int speed : {0, 5, 7, 10}) {
        for (const ColourTransform transform : {ColourTransform::None, ColourTransform::SubtractGreen}) {
          const auto encoded = encoded_colours(colours, bits, speed, transform);
          ASSERT_TRUE(encoded.has_value()) << encoded.error().message;
          const auto decoded = decoded_colours(encoded.value(), transform);
          ASSERT_TRUE(decoded.has_value()) << decoded.error().message;
          ASSERT_EQ(decoded.value().size(), count);
          for (std::size_t i = 0; i < count; ++i)
            for (std::size_t c = 0; c < 3; ++c) ASSERT_EQ(decoded.value()[i][c], rounded_channel(colours[i][c], bits));
        }
      }
  }
}

TEST(EncodedColours, SubtractGreenGivesBackTheExtremes) {
  std::vector<ColourBytes> colours;
  for (const int r : {0, 1, 127, 128, 255})
    for (const int g : {0, 1, 127, 128, 255})
      for (const int b : {0, 1, 127, 128, 255})
        colours.push_back({static_cast<std::uint8_t>(r), static_cast<std::uint8_t>(g), static_cast<std::uint8_t>(b)});
  const auto encoded = encoded_colours(colours, 8, 7, ColourTransform::SubtractGreen);
  ASSERT_TRUE(encoded.has_value());
  EXPECT_EQ(decoded_colours(encoded.value(), ColourTransform::SubtractGreen).value(), colours);
}

TEST(EncodedColours, CarryMarksBesideThemWhereThereAreAny) {
  std::vector<ColourBytes> colours;
  std::vector<std::uint8_t> marks;
  for (int i = 0; i < 3000; ++i) {
    colours.push_back(
        {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(i / 2), static_cast<std::uint8_t>(i / 7)});
    marks.push_back(i % 700 > 600 ? 1 : 0);
  }
  for (const ColourTransform transform : {ColourTransform::None, ColourTransform::SubtractGreen}) {
    for (const int bits : {8, 6}) {
      const auto without = encoded_colours(colours, bits, 7, transform).value();
      const auto with = encoded_colours(colours, bits, 7, transform, marks).value();
      EXPECT_TRUE(decoded_marks(without).value().empty());
      EXPECT_EQ(decoded_marks(with).value(), marks);
      EXPECT_EQ(decoded_colours(with, transform).value(), decoded_colours(without, transform).value());
      EXPECT_LT(with.size(), without.size() + 100) << "long runs cost next to nothing";
    }
  }
  EXPECT_TRUE(encoded_colours(colours, 8, 7, ColourTransform::None, std::span(marks).first(10)).has_error());
}

TEST(EncodedColours, AreNotReadTheOtherWay) {
  const std::vector<ColourBytes> colours{{1, 2, 3}, {200, 100, 50}};
  const auto plain = encoded_colours(colours, 8, 7);
  const auto transformed = encoded_colours(colours, 8, 7, ColourTransform::SubtractGreen);
  EXPECT_TRUE(decoded_colours(plain.value(), ColourTransform::SubtractGreen).has_error());
  EXPECT_TRUE(decoded_colours(transformed.value()).has_error());
}

TEST(EncodedColours, OfAPictureAreSmallerWithSubtractGreen) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> light(40, 200);
  std::uniform_int_distribution<int> tint(-3, 3);
  std::vector<ColourBytes> colours(20'000);
  for (ColourBytes& colour : colours) {
    const int shared = light(random);
    for (std::uint8_t& value : colour) value = static_cast<std::uint8_t>(shared + tint(random));
  }
  const auto plain = encoded_colours(colours, 8, 7);
  const auto transformed = encoded_colours(colours, 8, 7, ColourTransform::SubtractGreen);
  EXPECT_LT(transformed.value().size(), plain.value().size() * 3 / 4);
}

TEST(EncodedColours, RefusesNoColoursAndBitsThatDoNotExist) {
  const std::vector<ColourBytes> one{{1, 2, 3}};
  EXPECT_TRUE(encoded_colours({}, 8, 7).has_error());
  EXPECT_TRUE(encoded_colours(one, 9, 7).has_error());
  EXPECT_TRUE(encoded_colours(one, 0, 7).has_error());
}

}  // namespace
}  // namespace spectra::protocol::codec
