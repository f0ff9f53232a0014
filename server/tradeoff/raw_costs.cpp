#include "server/tradeoff/raw_costs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <utility>

#include "fusion/temperature_codes.hpp"
#include "protocol/codec/draco_codec.hpp"
#include "server/stream/tile_encoder.hpp"
#include "server/tradeoff/stopwatch.hpp"

namespace spectra::tradeoff {
namespace {

constexpr int kEncoderSpeed = 7;

base::Error unencodable(const std::string& why) {
  return {base::ErrorCode::BadValue, why, "raw layers"};
}

/// How often each difference of 0 to 255 levels was seen.
class Levels {
 public:
  void add(base::Rgb8 a, base::Rgb8 b) {
    const int level = std::max({std::abs(a.r - b.r), std::abs(a.g - b.g), std::abs(a.b - b.b)});
    ++counts_[static_cast<std::size_t>(level)];
  }
  double mean() const {
    double sum = 0;
    for (std::size_t level = 0; level < counts_.size(); ++level) sum += static_cast<double>(level * counts_[level]);
    return count() == 0 ? 0 : sum / static_cast<double>(count());
  }
  double quantile(double share) const {
    std::uint64_t seen = 0;
    for (std::size_t level = 0; level < counts_.size(); ++level) {
      seen += counts_[level];
      if (static_cast<double>(seen) >= share * static_cast<double>(count())) return static_cast<double>(level);
    }
    return 0;
  }

 private:
  std::uint64_t count() const { return std::accumulate(counts_.begin(), counts_.end(), std::uint64_t{0}); }
  std::array<std::uint64_t, 256> counts_{};
};

/// The smaller of both forms, as the stream sends it.
base::Result<std::size_t> visible_size(const map::Tile& tile, const stream::EncodedTile& geometry, RawPoint& point) {
  std::size_t least = SIZE_MAX;
  protocol::ColourTransform chosen = protocol::ColourTransform::None;
  stream::Payload payload;
  {
    const Stopwatch watch(point.encode_ms);
    for (const auto transform : {protocol::ColourTransform::None, protocol::ColourTransform::SubtractGreen}) {
      auto encoded = stream::encoded_visible_layer(tile, geometry, kEncoderSpeed, transform);
      if (!encoded) return unencodable(encoded.error().message);
      if (encoded.value()->size() >= least) continue;
      least = encoded.value()->size();
      chosen = transform;
      payload = std::move(encoded).value();
    }
  }
  const Stopwatch watch(point.decode_ms);
  if (!protocol::codec::decoded_colours(*payload, chosen)) return unencodable("a layer cannot be decoded");
  return least;
}

}  // namespace

base::Result<std::vector<RawPoint>> raw_costs(const Tiles& tiles, float step_m, const fusion::FusionPlan& plan,
                                              const std::vector<double>& temperature_steps_celsius) {
  std::vector<stream::EncodedTile> geometry;
  RawPoint visible;
  for (const auto& tile : tiles) {
    auto encoded = stream::encoded_tile(*tile, step_m, kEncoderSpeed);
    if (!encoded) return unencodable(encoded.error().message);
    geometry.push_back(std::move(encoded).value());
    BOOST_OUTCOME_TRY(const std::size_t size, visible_size(*tile, geometry.back(), visible));
    visible.visible_bytes += size;
  }
  std::vector<RawPoint> points;
  for (const double step : temperature_steps_celsius) {
    RawPoint point = visible;
    point.temperature_step_celsius = step;
    Levels levels;
    for (std::size_t t = 0; t < tiles.size(); ++t) {
      const map::Tile& tile = *tiles[t];
      const auto payload = [&] {
        const Stopwatch watch(point.encode_ms);
        return stream::encoded_temperature_layer(tile, geometry[t], kEncoderSpeed, step);
      }();
      if (!payload) return unencodable(payload.error().message);
      point.temperature_bytes += payload.value()->size();
      const auto decoded = [&] {
        const Stopwatch watch(point.decode_ms);
        return protocol::codec::decoded_temperature_codes(*payload.value());
      }();
      if (!decoded) return unencodable("a layer cannot be decoded");
      const std::size_t count = tile.positions.size();
      const auto& [table, codes] = decoded.value();
      // A vertex may be there several times.
      std::vector<float> seen(count), in_decoded_order(codes.size());
      fusion::TemperatureCodes{table.scale, table.offset}.decode(codes, in_decoded_order);
      for (std::size_t i = 0; i < codes.size(); ++i) seen[geometry[t].input_of_decoded[i]] = in_decoded_order[i];
      std::vector<base::Rgb8> exact(count), rounded(count);
      plan.fuse(tile.temperature_celsius, tile.visible, exact);
      plan.fuse(seen, tile.visible, rounded);
      for (std::size_t i = 0; i < count; ++i) {
        levels.add(exact[i], rounded[i]);
        const double off = std::abs(static_cast<double>(seen[i]) - static_cast<double>(tile.temperature_celsius[i]));
        if (std::isfinite(off)) point.temperature_worst_celsius = std::max(point.temperature_worst_celsius, off);
      }
    }
    point.levels_mean = levels.mean();
    point.levels_p95 = levels.quantile(0.95);
    points.push_back(point);
  }
  return points;
}

}  // namespace spectra::tradeoff
