#include "server/tradeoff/measure.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "server/stream/lattice.hpp"
#include "server/stream/viewer_stream.hpp"
#include "server/tradeoff/codec_costs.hpp"
#include "server/tradeoff/raw_costs.hpp"
#include "server/tradeoff/shown_error.hpp"

namespace spectra::tradeoff {
namespace {

// A level above every leaf's parent would draw nothing new: levels without a tile of their own are left out.
std::vector<int> drawn_levels(const map::SceneSnapshot& scene) {
  std::vector<int> levels;
  for (const auto& tile : scene.tiles()) levels.push_back(tile->id.level);
  std::sort(levels.begin(), levels.end());
  levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
  const bool leaves_only = scene.tiles().front()->child_mask == 0;
  if (leaves_only) levels.erase(levels.begin(), levels.end() - 1);
  return levels;
}

// Drawn when the tree is refined to `level`: the tiles of that level, and leaves above it.
Tiles tiles_at_level(const map::SceneSnapshot& scene, int level) {
  Tiles chosen;
  for (const auto& tile : scene.tiles()) {
    const bool leaf = tile->child_mask == 0;
    if (tile->id.level == level || (leaf && tile->id.level < level)) chosen.push_back(tile);
  }
  return chosen;
}

std::uint64_t vertex_count_of(const Tiles& tiles) {
  std::uint64_t count = 0;
  for (const auto& tile : tiles) count += tile->positions.size();
  return count;
}

}  // namespace

base::Result<TradeoffMeasurement> measured_tradeoff(const map::SceneSnapshot& scene, const TradeoffOptions& options,
                                                    const base::Progress& progress) {
  BOOST_OUTCOME_TRY(const auto samples, ErrorSamples::take(scene, options.sample_count, options.palette));
  const float suggested_m = scene.suggested_position_step_m();
  TradeoffMeasurement result{scene.name(),
                             scene.vertex_count(),
                             scene.triangle_count(),
                             scene.level_count(),
                             1000 * static_cast<double>(suggested_m),
                             {},
                             {},
                             {}};
  const auto append = [](auto& all, auto more) {
    all.insert(all.end(), std::move_iterator(more.begin()), std::move_iterator(more.end()));
  };
  const std::vector<int> levels = drawn_levels(scene);
  double whole = 0;
  for (const int level : levels) whole += static_cast<double>(vertex_count_of(tiles_at_level(scene, level)));
  double done = 0;
  for (const int level : levels) {
    const Tiles tiles = tiles_at_level(scene, level);
    GeometryPoint base;
    base.level = level;
    base.vertex_count = vertex_count_of(tiles);
    // The colours take about as long as a position step.
    const double step_share =
        static_cast<double>(base.vertex_count) / whole / static_cast<double>(options.step_factors.size() + 1);
    for (const double factor : options.step_factors) {
      const float step_m =
          stream::position_step_in_force(stream::lattice_step(factor * static_cast<double>(suggested_m)), suggested_m);
      base.position_step_mm = 1000 * static_cast<double>(step_m);
      base::report(progress, kMeasuringPhase, done);
      done += step_share;
      BOOST_OUTCOME_TRY(const PositionError error, samples.position_error(tiles, step_m));
      base.error_rms_mm = error.rms_mm;
      base.error_worst_mm = error.worst_mm;
      BOOST_OUTCOME_TRY(auto points, geometry_costs(tiles, step_m, options.encoder_speeds, base));
      append(result.geometry, std::move(points));
    }

    base::report(progress, kMeasuringPhase, done);
    done += step_share;
    std::vector<ColourPoint> bases;
    const auto errors = samples.colour_errors(tiles, options.colour_bits);
    for (std::size_t i = 0; i < errors.size(); ++i) {
      ColourPoint& point = bases.emplace_back();
      point.level = level;
      point.colour_bits = options.colour_bits[i];
      point.ciede2000_mean = errors[i].ciede2000_mean;
      point.ciede2000_p95 = errors[i].ciede2000_p95;
      point.temperature_p95_celsius = errors[i].temperature_p95_celsius;
    }
    BOOST_OUTCOME_TRY(auto points, colour_costs(tiles, suggested_m, samples.look(), bases));
    append(result.colours, std::move(points));
    if (level != levels.back() || scene.temperature().summary.finite_count == 0) continue;
    BOOST_OUTCOME_TRY(result.raw, raw_costs(tiles, suggested_m, samples.look(), options.temperature_steps_celsius));
  }
  base::report(progress, kMeasuringPhase, 1);
  return result;
}

const ColourPoint& full_change(const TradeoffMeasurement& measurement) {
  const ColourPoint* full = nullptr;
  for (const ColourPoint& point : measurement.colours) {
    const bool is_asked_for = point.codec == kSubtractGreen && point.colour_bits == 8;
    if (is_asked_for && (full == nullptr || point.level > full->level)) full = &point;
  }
  return *full;
}

std::uint64_t break_even(const RawPoint& raw, const ColourPoint& change) {
  return raw.size_bytes() / std::max<std::uint64_t>(1, change.size_bytes) + 1;
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

}  // namespace spectra::tradeoff
