#include "server/tradeoff/codec_costs.hpp"

#include <meshoptimizer.h>
#include <zstd.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "protocol/codec/draco_codec.hpp"
#include "server/stream/lattice.hpp"
#include "server/stream/tile_encoder.hpp"
#include "server/tradeoff/stopwatch.hpp"

namespace spectra::tradeoff {
namespace {

using base::failure;
using base::Rgb8;

constexpr int kZstdLevel = 3;

std::span<const std::byte> bytes_of(const auto& values) {
  return std::as_bytes(std::span(values));
}

/// A tile as plain arrays: lattice positions in 16 bits where they fit, else 32, colours, and indices.
struct PlainTile {
  std::vector<std::uint32_t> positions;  ///< x, y, z, zero for each vertex.
  std::vector<std::uint32_t> indices;
  std::size_t vertex_count = 0;
};

base::Result<PlainTile> plain_tile(const map::Tile& tile, float step_m) {
  const auto lattice = stream::tile_lattice(tile, step_m);
  if (!lattice) return base::failure(base::ErrorCode::BadValue, lattice.error().message, "position");
  PlainTile plain;
  plain.vertex_count = tile.positions.size();
  plain.positions.reserve(4 * plain.vertex_count);
  for (const auto& point : lattice.value().points) {
    for (const auto coordinate : point) plain.positions.push_back(static_cast<std::uint32_t>(coordinate));
    plain.positions.push_back(0);
  }
  for (const auto& triangle : tile.triangles)
    plain.indices.insert(plain.indices.end(), triangle.begin(), triangle.end());
  return plain;
}

GeometryPoint with_raw(const std::vector<PlainTile>& tiles, GeometryPoint point) {
  point.codec = "raw";
  for (const auto& tile : tiles) point.size_bytes += 12 * tile.vertex_count + 4 * tile.indices.size();
  return point;
}

GeometryPoint with_zstd(const std::vector<PlainTile>& tiles, GeometryPoint point) {
  point.codec = "zstd";
  for (const auto& tile : tiles) {
    for (const auto bytes : {bytes_of(tile.positions), bytes_of(tile.indices)}) {
      std::vector<std::byte> packed(ZSTD_compressBound(bytes.size())), unpacked(bytes.size());
      {
        const Stopwatch watch(point.encode_ms);
        packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), kZstdLevel));
      }
      const Stopwatch watch(point.decode_ms);
      ZSTD_decompress(unpacked.data(), unpacked.size(), packed.data(), packed.size());
      point.size_bytes += packed.size();
    }
  }
  return point;
}

GeometryPoint with_meshoptimizer(const std::vector<PlainTile>& tiles, GeometryPoint point) {
  point.codec = "meshoptimizer";
  constexpr std::size_t kVertexSize = 16;
  for (const auto& tile : tiles) {
    const std::size_t vertices = tile.vertex_count, indices = tile.indices.size();
    std::vector<unsigned char> packed_vertices(meshopt_encodeVertexBufferBound(vertices, kVertexSize));
    std::vector<unsigned char> packed_indices(meshopt_encodeIndexBufferBound(indices, vertices));
    {
      const Stopwatch watch(point.encode_ms);
      std::vector<std::uint32_t> order(indices), ordered_indices(indices), ordered(tile.positions.size());
      if (indices > 0) {
        std::vector<std::uint32_t> remap(vertices);
        meshopt_optimizeVertexCacheStrip(order.data(), tile.indices.data(), indices, vertices);
        meshopt_optimizeVertexFetchRemap(remap.data(), order.data(), indices, vertices);
        meshopt_remapIndexBuffer(ordered_indices.data(), order.data(), indices, remap.data());
        meshopt_remapVertexBuffer(ordered.data(), tile.positions.data(), vertices, kVertexSize, remap.data());
      } else {
        ordered = tile.positions;
      }
      packed_vertices.resize(meshopt_encodeVertexBuffer(packed_vertices.data(), packed_vertices.size(), ordered.data(),
                                                        vertices, kVertexSize));
      packed_indices.resize(
          meshopt_encodeIndexBuffer(packed_indices.data(), packed_indices.size(), ordered_indices.data(), indices));
    }
    point.size_bytes += packed_vertices.size() + packed_indices.size();
    std::vector<std::uint32_t> positions(tile.positions.size()), unpacked(indices);
    const Stopwatch watch(point.decode_ms);
    meshopt_decodeVertexBuffer(positions.data(), vertices, kVertexSize, packed_vertices.data(), packed_vertices.size());
    meshopt_decodeIndexBuffer(unpacked.data(), indices, sizeof(std::uint32_t), packed_indices.data(),
                              packed_indices.size());
  }
  return point;
}

base::Result<GeometryPoint> with_draco(const Tiles& tiles, float step_m, int speed, GeometryPoint point) {
  point.codec = "draco";
  point.encoder_speed = speed;
  for (const auto& tile : tiles) {
    const auto encoded = [&] {
      const Stopwatch watch(point.encode_ms);
      return stream::encoded_tile(*tile, step_m, speed);
    }();
    if (!encoded) return base::failure(base::ErrorCode::BadValue, encoded.error().message, "geometry");
    point.size_bytes += encoded.value().payload->size();
    const Stopwatch watch(point.decode_ms);
    if (!protocol::codec::decoded_geometry(*encoded.value().payload)) {
      return base::failure(base::ErrorCode::BadValue, "an encoded tile cannot be decoded", "geometry");
    }
  }
  return point;
}

base::Result<ColourPoint> draco_colours(const Tiles& tiles, const std::vector<stream::EncodedTile>& geometry,
                                        const fusion::FusionPlan& plan, protocol::ColourTransform transform,
                                        ColourPoint point) {
  point.codec = transform == protocol::ColourTransform::None ? "draco" : kSubtractGreen;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const auto payload = [&] {
      const Stopwatch watch(point.encode_ms);
      return stream::encoded_tile_colours(*tiles[i], geometry[i], plan, {}, point.colour_bits, 7, transform);
    }();
    if (!payload) return base::failure(base::ErrorCode::BadValue, payload.error().message, "colours");
    point.size_bytes += payload.value()->size();
    const Stopwatch watch(point.decode_ms);
    if (!protocol::codec::decoded_colours(*payload.value(), transform)) {
      return base::failure(base::ErrorCode::BadValue, "encoded colours cannot be decoded", "colours");
    }
  }
  return point;
}

ColourPoint raw_colours(const Tiles& tiles, ColourPoint point) {
  point.codec = "raw";
  for (const auto& tile : tiles) point.size_bytes += 3 * tile->positions.size();
  return point;
}

ColourPoint zstd_colours(const Tiles& tiles, const fusion::FusionPlan& plan, ColourPoint point) {
  point.codec = "zstd";
  for (const auto& tile : tiles) {
    std::vector<std::byte> packed;
    std::vector<base::Rgb8> fused(tile->positions.size());
    {
      const Stopwatch watch(point.encode_ms);
      plan.fuse(tile->temperature_celsius, tile->visible, fused);
      const auto bytes = bytes_of(fused);
      packed.resize(ZSTD_compressBound(bytes.size()));
      packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), kZstdLevel));
    }
    const Stopwatch watch(point.decode_ms);
    ZSTD_decompress(fused.data(), fused.size() * sizeof(base::Rgb8), packed.data(), packed.size());
    point.size_bytes += packed.size();
  }
  return point;
}

ColourPoint meshoptimizer_colours(const Tiles& tiles, const fusion::FusionPlan& plan, ColourPoint point) {
  point.codec = "meshoptimizer";
  for (const auto& tile : tiles) {
    const std::size_t count = tile->positions.size();
    std::vector<base::Rgb8> fused(count);
    std::vector<std::array<std::uint8_t, 4>> padded(count);  // the codec takes vertices of a multiple of four bytes
    std::vector<unsigned char> packed(meshopt_encodeVertexBufferBound(count, 4));
    {
      const Stopwatch watch(point.encode_ms);
      plan.fuse(tile->temperature_celsius, tile->visible, fused);
      for (std::size_t i = 0; i < count; ++i) padded[i] = {fused[i].r, fused[i].g, fused[i].b, 0};
      packed.resize(meshopt_encodeVertexBuffer(packed.data(), packed.size(), padded.data(), count, 4));
    }
    const Stopwatch watch(point.decode_ms);
    meshopt_decodeVertexBuffer(padded.data(), count, 4, packed.data(), packed.size());
    point.size_bytes += packed.size();
  }
  return point;
}

}  // namespace

base::Result<std::vector<GeometryPoint>> geometry_costs(const Tiles& tiles, float step_m,
                                                        const std::vector<int>& encoder_speeds,
                                                        const GeometryPoint& point) {
  std::vector<PlainTile> plain;
  for (const auto& tile : tiles) {
    BOOST_OUTCOME_TRY(auto one, plain_tile(*tile, step_m));
    plain.push_back(std::move(one));
  }
  std::vector<GeometryPoint> points{with_raw(plain, point), with_zstd(plain, point), with_meshoptimizer(plain, point)};
  for (const int speed : encoder_speeds) {
    BOOST_OUTCOME_TRY(auto draco, with_draco(tiles, step_m, speed, point));
    points.push_back(std::move(draco));
  }
  return points;
}

base::Result<std::vector<ColourPoint>> colour_costs(const Tiles& tiles, float step_m, const fusion::FusionPlan& plan,
                                                    const std::vector<ColourPoint>& points) {
  std::vector<stream::EncodedTile> geometry;
  for (const auto& tile : tiles) {
    auto encoded = stream::encoded_tile(*tile, step_m, 7);
    if (!encoded) return base::failure(base::ErrorCode::BadValue, encoded.error().message, "geometry");
    geometry.push_back(std::move(encoded.value()));
  }
  std::vector<ColourPoint> costs;
  for (const ColourPoint& point : points) {
    for (const auto transform : {protocol::ColourTransform::None, protocol::ColourTransform::SubtractGreen}) {
      BOOST_OUTCOME_TRY(auto draco, draco_colours(tiles, geometry, plan, transform, point));
      costs.push_back(std::move(draco));
    }
    if (point.colour_bits != 8) continue;
    costs.push_back(raw_colours(tiles, point));
    costs.push_back(zstd_colours(tiles, plan, point));
    costs.push_back(meshoptimizer_colours(tiles, plan, point));
  }
  return costs;
}

}  // namespace spectra::tradeoff
