#include "server/tradeoff/measure.hpp"

#include <meshoptimizer.h>
#include <zstd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <utility>

#include "fusion/colour/colour_difference.hpp"
#include "fusion/colour/palette.hpp"
#include "fusion/fusion_plan.hpp"
#include "protocol/draco_codec.hpp"
#include "server/stream/lattice.hpp"
#include "server/stream/tile_encoder.hpp"
#include "server/stream/viewer_stream.hpp"
#include "server/tradeoff/surface_index.hpp"

namespace spectra::server {

namespace {

using Tiles = std::vector<std::shared_ptr<const Tile>>;
using fusion::failure;
using fusion::Rgb8;
using fusion::Vec3f;

constexpr int kZstdLevel = 3;

/// Adds the milliseconds of its own life to a sum.
class Stopwatch {
 public:
  explicit Stopwatch(double& sum_ms) : sum_ms_(sum_ms), start_(std::chrono::steady_clock::now()) {}
  ~Stopwatch() {
    sum_ms_ += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_).count();
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  double& sum_ms_;
  std::chrono::steady_clock::time_point start_;
};

/// Vertices of the full scene at which errors are taken: evenly through the owned vertices of the leaves.
struct Samples {
  std::vector<Vec3f> positions;
  std::vector<Rgb8> visible;
  std::vector<float> temperature_celsius;
};

Samples evenly_taken(const SceneSnapshot& scene, std::uint32_t wanted) {
  Samples samples;
  const std::uint64_t stride = std::max<std::uint64_t>(1, scene.vertex_count() / std::max(1u, wanted));
  std::uint64_t counter = 0;
  for (const auto& tile : scene.tiles()) {
    if (tile->child_mask != 0) continue;
    std::vector<bool> in_geometry(tile->positions.size(), tile->triangles.empty());
    for (const auto& triangle : tile->triangles) {
      for (const auto vertex : triangle) in_geometry[vertex] = true;
    }
    for (std::uint32_t i = 0; i < tile->owned_count; ++i) {
      if (!in_geometry[i] || counter++ % stride != 0) continue;
      samples.positions.push_back(tile->positions[i]);
      samples.visible.push_back(tile->visible[i]);
      samples.temperature_celsius.push_back(tile->temperature_celsius[i]);
    }
  }
  return samples;
}

/// A level of detail as one surface; vertex i belongs to tile vertex i in the order of the tiles.
struct LevelSurface {
  std::vector<Vec3f> positions;
  std::vector<fusion::Triangle> triangles;
};

LevelSurface merged(const Tiles& tiles) {
  LevelSurface surface;
  for (const auto& tile : tiles) {
    const auto base = static_cast<std::uint32_t>(surface.positions.size());
    surface.positions.insert(surface.positions.end(), tile->positions.begin(), tile->positions.end());
    for (const auto& t : tile->triangles) surface.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  }
  return surface;
}

/// The same surface as a client decodes it at a position step.
void snap_to_lattice(LevelSurface& surface, double step_m) {
  const auto snapped = [step_m](float value) {
    return static_cast<float>(std::floor(static_cast<double>(value) / step_m + 0.5) * step_m);
  };
  for (Vec3f& p : surface.positions) p = {snapped(p.x), snapped(p.y), snapped(p.z)};
}

std::span<const std::byte> bytes_of(const auto& values) {
  return std::as_bytes(std::span(values));
}

/// A tile as plain arrays: lattice positions in 16 bits where they fit, else 32, colours, and indices.
struct PlainTile {
  std::vector<std::uint32_t> positions;  ///< x, y, z, zero for each vertex.
  std::vector<std::uint32_t> indices;
  std::size_t vertex_count = 0;
};

fusion::Result<PlainTile> plain_tile(const Tile& tile, float step_m) {
  const auto lattice = tile_lattice(tile, step_m);
  if (!lattice) return failure(fusion::ErrorCode::BadValue, lattice.error().message, "position");
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

fusion::Result<GeometryPoint> with_draco(const Tiles& tiles, float step_m, int speed, GeometryPoint point) {
  point.codec = "draco";
  point.encoder_speed = speed;
  for (const auto& tile : tiles) {
    const auto encoded = [&] {
      const Stopwatch watch(point.encode_ms);
      return encoded_tile(*tile, step_m, speed);
    }();
    if (!encoded) return failure(fusion::ErrorCode::BadValue, encoded.error().message, "geometry");
    point.size_bytes += encoded.value().payload->size();
    const Stopwatch watch(point.decode_ms);
    if (!protocol::decoded_geometry(*encoded.value().payload)) {
      return failure(fusion::ErrorCode::BadValue, "an encoded tile cannot be decoded", "geometry");
    }
  }
  return point;
}

/// Position errors of the samples against a surface, into the point.
void take_position_error(const Samples& samples, const SurfaceIndex& surface, GeometryPoint& point) {
  double squares = 0;
  for (const Vec3f& place : samples.positions) {
    const double distance_mm = 1000 * surface.nearest(place).distance_m;
    squares += distance_mm * distance_mm;
    point.error_worst_mm = std::max(point.error_worst_mm, distance_mm);
  }
  point.error_rms_mm = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, samples.positions.size())));
}

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto rank = static_cast<std::size_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(rank), values.end());
  return values[rank];
}

/// The temperature whose palette colour is nearest to a colour, as somebody with the scale bar reads it.
class PaletteReader {
 public:
  PaletteReader(const fusion::PaletteTable& table, double low_celsius, double high_celsius)
      : low_(low_celsius), span_(high_celsius - low_celsius) {
    for (int i = 0; i <= kSteps; ++i)
      colours_.push_back(fusion::palette_colour(table, static_cast<double>(i) / kSteps));
  }
  double celsius(const std::array<double, 3>& colour) const {
    std::size_t best = 0;
    double best_distance = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < colours_.size(); ++i) {
      double distance = 0;
      for (std::size_t c = 0; c < 3; ++c) distance += (colours_[i][c] - colour[c]) * (colours_[i][c] - colour[c]);
      if (distance < best_distance) {
        best_distance = distance;
        best = i;
      }
    }
    return low_ + span_ * static_cast<double>(best) / kSteps;
  }

 private:
  static constexpr int kSteps = 1020;
  double low_, span_;
  std::vector<std::array<double, 3>> colours_;
};

/// What one set of settings shows at one level: fused colours of every vertex of the level's surface, rounded as sent.
std::vector<Rgb8> shown_colours(const Tiles& tiles, const fusion::FusionPlan& plan, int bits) {
  std::vector<Rgb8> shown;
  for (const auto& tile : tiles) {
    std::vector<Rgb8> fused(tile->positions.size());
    plan.fuse(tile->temperature_celsius, tile->visible, fused);
    for (const Rgb8 c : fused) {
      shown.push_back({protocol::rounded_channel(c.r, bits), protocol::rounded_channel(c.g, bits),
                       protocol::rounded_channel(c.b, bits)});
    }
  }
  return shown;
}

/// The colour on the screen at a surface point: corner colours, linearly interpolated.
std::array<double, 3> colour_at(const LevelSurface& surface, const std::vector<Rgb8>& colours,
                                const SurfacePoint& point) {
  fusion::Triangle corners{point.triangle, point.triangle, point.triangle};
  if (!surface.triangles.empty()) corners = surface.triangles[point.triangle];
  std::array<double, 3> colour{};
  for (std::size_t i = 0; i < 3; ++i) {
    const Rgb8 c = colours[corners[i]];
    const std::array<std::uint8_t, 3> channels{c.r, c.g, c.b};
    for (std::size_t axis = 0; axis < 3; ++axis) colour[axis] += point.barycentric[i] * channels[axis];
  }
  return colour;
}

/// Plans of the two questions asked of a picture: how it looks (the default fusion) and what temperature it shows.
struct Plans {
  fusion::FusionPlan look;
  fusion::FusionPlan thermal;
};

fusion::Result<Plans> prepared_plans(const SceneSnapshot& scene, const std::string& palette) {
  fusion::FusionChange change;
  change.palette = palette;
  BOOST_OUTCOME_TRY(auto look_settings, fusion::with_change(fusion::default_settings(), change));
  change.method = "thermal_only";
  BOOST_OUTCOME_TRY(auto thermal_settings, fusion::with_change(fusion::default_settings(), change));
  BOOST_OUTCOME_TRY(auto look, fusion::FusionPlan::prepare(look_settings, scene.temperature()));
  BOOST_OUTCOME_TRY(auto thermal, fusion::FusionPlan::prepare(thermal_settings, scene.temperature()));
  return Plans{std::move(look), std::move(thermal)};
}

struct Errors {
  double ciede2000_mean, ciede2000_p95, temperature_p95_celsius;
};

Errors colour_errors(const Samples& samples, const std::vector<SurfacePoint>& nearest, const LevelSurface& surface,
                     const Tiles& tiles, const Plans& plans, const PaletteReader& reader, int bits) {
  const std::vector<Rgb8> look = shown_colours(tiles, plans.look, bits);
  const std::vector<Rgb8> thermal = shown_colours(tiles, plans.thermal, bits);
  std::vector<Rgb8> truth(samples.positions.size());
  plans.look.fuse(samples.temperature_celsius, samples.visible, truth);
  std::vector<double> differences, celsius;
  double sum = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    differences.push_back(
        fusion::ciede2000(fusion::lab_of(truth[i]), fusion::lab_of(colour_at(surface, look, nearest[i]))));
    sum += differences.back();
    const double temperature = static_cast<double>(samples.temperature_celsius[i]);
    if (std::isfinite(temperature)) {
      celsius.push_back(std::abs(reader.celsius(colour_at(surface, thermal, nearest[i])) - temperature));
    }
  }
  const double mean = sum / static_cast<double>(std::max<std::size_t>(1, differences.size()));
  return {mean, percentile(std::move(differences), 0.95), percentile(std::move(celsius), 0.95)};
}

fusion::Result<ColourPoint> draco_colours(const Tiles& tiles, const std::vector<EncodedTile>& geometry,
                                          const fusion::FusionPlan& plan, protocol::ColourTransform transform,
                                          ColourPoint point) {
  point.codec = transform == protocol::ColourTransform::None ? "draco" : kSubtractGreen;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const auto payload = [&] {
      const Stopwatch watch(point.encode_ms);
      return encoded_tile_colours(*tiles[i], geometry[i], plan, point.colour_bits, 7, transform);
    }();
    if (!payload) return failure(fusion::ErrorCode::BadValue, payload.error().message, "colours");
    point.size_bytes += payload.value()->size();
    const Stopwatch watch(point.decode_ms);
    if (!protocol::decoded_colours(*payload.value(), transform)) {
      return failure(fusion::ErrorCode::BadValue, "encoded colours cannot be decoded", "colours");
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
    std::vector<Rgb8> fused(tile->positions.size());
    {
      const Stopwatch watch(point.encode_ms);
      plan.fuse(tile->temperature_celsius, tile->visible, fused);
      const auto bytes = bytes_of(fused);
      packed.resize(ZSTD_compressBound(bytes.size()));
      packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), kZstdLevel));
    }
    const Stopwatch watch(point.decode_ms);
    ZSTD_decompress(fused.data(), fused.size() * sizeof(Rgb8), packed.data(), packed.size());
    point.size_bytes += packed.size();
  }
  return point;
}

ColourPoint meshoptimizer_colours(const Tiles& tiles, const fusion::FusionPlan& plan, ColourPoint point) {
  point.codec = "meshoptimizer";
  for (const auto& tile : tiles) {
    const std::size_t count = tile->positions.size();
    std::vector<Rgb8> fused(count);
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

std::vector<std::shared_ptr<const Tile>> tiles_at_level(const SceneSnapshot& scene, int level) {
  Tiles chosen;
  for (const auto& tile : scene.tiles()) {
    const bool leaf = tile->child_mask == 0;
    if (tile->id.level == level || (leaf && tile->id.level < level)) chosen.push_back(tile);
  }
  return chosen;
}

fusion::Result<TradeoffMeasurement> measured_tradeoff(const SceneSnapshot& scene, const TradeoffOptions& options,
                                                      const std::function<void(const std::string&)>& progress) {
  BOOST_OUTCOME_TRY(auto plans, prepared_plans(scene, options.palette));
  const PaletteReader reader(fusion::find_palette(options.palette)->table, plans.thermal.range_minimum(),
                             plans.thermal.range_maximum());
  const Samples samples = evenly_taken(scene, options.sample_count);
  if (samples.positions.empty()) {
    return failure(fusion::ErrorCode::Unsupported, "the scene has no vertex that could be drawn", "scene");
  }
  TradeoffMeasurement result{scene.name(),
                             scene.vertex_count(),
                             scene.triangle_count(),
                             scene.level_count(),
                             1000 * static_cast<double>(scene.suggested_position_step_m()),
                             {},
                             {}};

  // A level above every leaf's parent would draw nothing new: levels without a tile of their own are left out.
  std::vector<int> levels;
  for (const auto& tile : scene.tiles()) levels.push_back(tile->id.level);
  std::sort(levels.begin(), levels.end());
  levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
  const bool leaves_only = scene.tiles().front()->child_mask == 0;
  if (leaves_only) levels.erase(levels.begin(), levels.end() - 1);

  for (const int level : levels) {
    const Tiles tiles = tiles_at_level(scene, level);
    LevelSurface surface = merged(tiles);
    for (const double factor : options.step_factors) {
      const float step_m =
          position_step_in_force(lattice_step(factor * static_cast<double>(scene.suggested_position_step_m())),
                                 scene.suggested_position_step_m(), scene.bounds());
      progress("level " + std::to_string(level) + ", position step " +
               std::to_string(1000 * static_cast<double>(step_m)) + " mm");
      LevelSurface decoded = surface;
      snap_to_lattice(decoded, static_cast<double>(step_m));
      GeometryPoint base;
      base.level = level;
      base.vertex_count = surface.positions.size();
      base.position_step_mm = 1000 * static_cast<double>(step_m);
      take_position_error(samples, SurfaceIndex(decoded.positions, decoded.triangles), base);
      std::vector<PlainTile> plain;
      for (const auto& tile : tiles) {
        BOOST_OUTCOME_TRY(auto one, plain_tile(*tile, step_m));
        plain.push_back(std::move(one));
      }
      result.geometry.push_back(with_raw(plain, base));
      result.geometry.push_back(with_zstd(plain, base));
      result.geometry.push_back(with_meshoptimizer(plain, base));
      for (const int speed : options.encoder_speeds) {
        BOOST_OUTCOME_TRY(auto point, with_draco(tiles, step_m, speed, base));
        result.geometry.push_back(std::move(point));
      }
    }

    const SurfaceIndex index(surface.positions, surface.triangles);
    std::vector<SurfacePoint> nearest;
    for (const Vec3f& place : samples.positions) nearest.push_back(index.nearest(place));
    std::vector<EncodedTile> geometry;
    for (const auto& tile : tiles) {
      auto encoded = encoded_tile(*tile, scene.suggested_position_step_m(), 7);
      if (!encoded) return failure(fusion::ErrorCode::BadValue, encoded.error().message, "geometry");
      geometry.push_back(std::move(encoded.value()));
    }
    for (const int bits : options.colour_bits) {
      progress("level " + std::to_string(level) + ", " + std::to_string(bits) + " bits a channel");
      const Errors errors = colour_errors(samples, nearest, surface, tiles, plans, reader, bits);
      const ColourPoint base{
          "", level, bits, 0, 0, 0, errors.ciede2000_mean, errors.ciede2000_p95, errors.temperature_p95_celsius};
      for (const auto transform : {protocol::ColourTransform::None, protocol::ColourTransform::SubtractGreen}) {
        BOOST_OUTCOME_TRY(auto point, draco_colours(tiles, geometry, plans.look, transform, base));
        result.colours.push_back(std::move(point));
      }
      if (bits != 8) continue;
      result.colours.push_back(raw_colours(tiles, base));
      result.colours.push_back(zstd_colours(tiles, plans.look, base));
      result.colours.push_back(meshoptimizer_colours(tiles, plans.look, base));
    }
  }
  return result;
}

std::vector<Recommendation> recommended_points(const TradeoffMeasurement& measurement,
                                               const std::vector<double>& rates_mbit_per_s, double change_target_s,
                                               double picture_target_s) {
  std::vector<Recommendation> recommendations;
  for (const double rate : rates_mbit_per_s) {
    const double bytes_per_s = rate * 1e6 / 8;
    Recommendation best, cheapest;
    double best_error = std::numeric_limits<double>::infinity(), cheapest_s = best_error;
    for (const GeometryPoint& geometry : measurement.geometry) {
      if (geometry.codec != "draco") continue;
      for (const ColourPoint& colours : measurement.colours) {
        if (colours.codec != kSubtractGreen || colours.level != geometry.level) continue;
        // Encoding, sending and decoding overlap tile by tile: the slowest of the three decides.
        const auto seconds = [bytes_per_s](double bytes, double encode_ms, double decode_ms) {
          return std::max({bytes / bytes_per_s, encode_ms / 1000, decode_ms / 1000});
        };
        const double change_s = seconds(static_cast<double>(colours.size_bytes), colours.encode_ms, colours.decode_ms);
        const double picture_s =
            change_s + seconds(static_cast<double>(geometry.size_bytes), geometry.encode_ms, geometry.decode_ms);
        const Recommendation candidate{rate, geometry, colours, picture_s, change_s};
        if (picture_s < cheapest_s) {
          cheapest_s = picture_s;
          cheapest = candidate;
        }
        // A just noticeable colour difference weighs as much as a position error of one suggested step.
        const double error = geometry.error_rms_mm / measurement.suggested_step_mm + colours.ciede2000_mean;
        if (change_s <= change_target_s && picture_s <= picture_target_s && error < best_error) {
          best_error = error;
          best = candidate;
        }
      }
    }
    recommendations.push_back(std::isfinite(best_error) ? best : cheapest);
  }
  return recommendations;
}

}  // namespace spectra::server
