#include "server/tradeoff/shown_error.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "fusion/colour/colour_difference.hpp"
#include "fusion/colour/palette.hpp"
#include "protocol/codec/draco_codec.hpp"
#include "server/stream/lattice.hpp"
#include "server/tradeoff/surface_index.hpp"

namespace spectra::tradeoff {
namespace {

using base::failure;
using base::Rgb8;
using base::Vec3f;

/// A level of detail as one surface; vertex i belongs to tile vertex i in the order of the tiles.
struct LevelSurface {
  std::vector<base::Vec3f> positions;
  std::vector<base::Triangle> triangles;
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
base::Result<LevelSurface> decoded(const Tiles& tiles, float step_m) {
  LevelSurface surface = merged(tiles);
  std::size_t next = 0;
  for (const auto& tile : tiles) {
    const auto lattice = stream::tile_lattice(*tile, step_m);
    if (!lattice) return base::failure(base::ErrorCode::BadValue, lattice.error().message, "position");
    const auto& [x, y, z] = lattice.value().origin_m;
    const float finest_m = lattice.value().step_m;
    for (const protocol::codec::LatticePoint& point : lattice.value().points) {
      const auto metres = [&](std::size_t axis) { return static_cast<float>(point[axis]) * finest_m; };
      surface.positions[next++] = {x + metres(0), y + metres(1), z + metres(2)};
    }
  }
  return surface;
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
std::vector<base::Rgb8> shown_colours(const Tiles& tiles, const fusion::FusionPlan& plan, int bits) {
  std::vector<base::Rgb8> shown;
  for (const auto& tile : tiles) {
    std::vector<base::Rgb8> fused(tile->positions.size());
    plan.fuse(tile->temperature_celsius, tile->visible, fused);
    for (const base::Rgb8 c : fused) {
      shown.push_back({protocol::codec::rounded_channel(c.r, bits), protocol::codec::rounded_channel(c.g, bits),
                       protocol::codec::rounded_channel(c.b, bits)});
    }
  }
  return shown;
}

/// The colour on the screen at a surface point: corner colours, linearly interpolated.
std::array<double, 3> colour_at(const LevelSurface& surface, const std::vector<base::Rgb8>& colours,
                                const SurfacePoint& point) {
  base::Triangle corners{point.triangle, point.triangle, point.triangle};
  if (!surface.triangles.empty()) corners = surface.triangles[point.triangle];
  std::array<double, 3> colour{};
  for (std::size_t i = 0; i < 3; ++i) {
    const base::Rgb8 c = colours[corners[i]];
    const std::array<std::uint8_t, 3> channels{c.r, c.g, c.b};
    for (std::size_t axis = 0; axis < 3; ++axis) colour[axis] += point.barycentric[i] * channels[axis];
  }
  return colour;
}

}  // namespace

base::Result<ErrorSamples> ErrorSamples::take(const map::SceneSnapshot& scene, std::uint32_t sample_count,
                                              const std::string& palette) {
  fusion::FusionChange change;
  change.palette = palette;
  BOOST_OUTCOME_TRY(auto look_settings, fusion::with_change(fusion::default_settings(), change));
  change.method = "thermal_only";
  BOOST_OUTCOME_TRY(auto thermal_settings, fusion::with_change(fusion::default_settings(), change));
  BOOST_OUTCOME_TRY(auto look, fusion::FusionPlan::prepare(look_settings, scene.temperature()));
  BOOST_OUTCOME_TRY(auto thermal, fusion::FusionPlan::prepare(thermal_settings, scene.temperature()));
  ErrorSamples samples(std::move(look), std::move(thermal), fusion::find_palette(palette)->table);
  samples.take_evenly(scene, sample_count);
  if (samples.positions_.empty()) {
    return base::failure(base::ErrorCode::Unsupported, "the scene has no vertex that could be drawn", "scene");
  }
  return samples;
}

void ErrorSamples::take_evenly(const map::SceneSnapshot& scene, std::uint32_t wanted) {
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
      positions_.push_back(tile->positions[i]);
      visible_.push_back(tile->visible[i]);
      temperature_celsius_.push_back(tile->temperature_celsius[i]);
    }
  }
}

base::Result<PositionError> ErrorSamples::position_error(const Tiles& tiles, float step_m) const {
  BOOST_OUTCOME_TRY(const auto surface, decoded(tiles, step_m));
  const SurfaceIndex index(surface.positions, surface.triangles);
  PositionError error;
  double squares = 0;
  for (const base::Vec3f& place : positions_) {
    const double distance_mm = 1000 * index.nearest(place).distance_m;
    squares += distance_mm * distance_mm;
    error.worst_mm = std::max(error.worst_mm, distance_mm);
  }
  error.rms_mm = std::sqrt(squares / static_cast<double>(positions_.size()));
  return error;
}

std::vector<ColourError> ErrorSamples::colour_errors(const Tiles& tiles, const std::vector<int>& colour_bits) const {
  const PaletteReader reader(palette_, thermal_.range_minimum(), thermal_.range_maximum());
  const LevelSurface surface = merged(tiles);
  const SurfaceIndex index(surface.positions, surface.triangles);
  std::vector<SurfacePoint> nearest;
  for (const base::Vec3f& place : positions_) nearest.push_back(index.nearest(place));
  std::vector<base::Rgb8> truth(positions_.size());
  look_.fuse(temperature_celsius_, visible_, truth);

  std::vector<ColourError> errors;
  for (const int bits : colour_bits) {
    const std::vector<base::Rgb8> look = shown_colours(tiles, look_, bits);
    const std::vector<base::Rgb8> thermal = shown_colours(tiles, thermal_, bits);
    std::vector<double> differences, celsius;
    double sum = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      differences.push_back(
          fusion::ciede2000(fusion::lab_of(truth[i]), fusion::lab_of(colour_at(surface, look, nearest[i]))));
      sum += differences.back();
      const auto temperature = static_cast<double>(temperature_celsius_[i]);
      if (std::isfinite(temperature)) {
        celsius.push_back(std::abs(reader.celsius(colour_at(surface, thermal, nearest[i])) - temperature));
      }
    }
    const double mean = sum / static_cast<double>(differences.size());
    errors.push_back({mean, percentile(std::move(differences), 0.95), percentile(std::move(celsius), 0.95)});
  }
  return errors;
}

}  // namespace spectra::tradeoff
