#include "server/stream/raw_layers.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "server/stream/tile_encoder.hpp"

namespace spectra::stream {
namespace {

/// The geometry that the viewer holds. The encoder is deterministic, so that one which the cache has let go comes back as it was.
protocol::Result<std::shared_ptr<const EncodedTile>> geometry_of(const RawEncoding& encoding,
                                                                 FrameCache::State& cache) {
  const Demand& demand = encoding.demand;
  if (auto known = cache.find_geometry(demand.geometry_key(encoding.tile))) return known;
  BOOST_OUTCOME_TRY(auto made, encoded_tile(*encoding.tile, demand.position_step_m, demand.encoder_speed));
  return std::make_shared<const EncodedTile>(std::move(made));
}

protocol::Result<Payload> encoded_layer(const RawEncoding& encoding, FrameCache::State& cache) {
  const Demand& demand = encoding.demand;
  BOOST_OUTCOME_TRY(const auto geometry, geometry_of(encoding, cache));
  const TimedWork watch(cache.times.raw_layer);
  if (RawDemand::kLayers[encoding.layer] == Layer::Visible) {
    return encoded_visible_layer(*encoding.tile, *geometry, demand.encoder_speed, demand.colour_transform);
  }
  if (RawDemand::kLayers[encoding.layer] == Layer::TemperatureSigma) {
    return encoded_sigma_layer(*encoding.tile, *geometry, demand.encoder_speed);
  }
  return encoded_temperature_layer(*encoding.tile, *geometry, demand.encoder_speed,
                                   demand.raw.temperature_step_celsius);
}

double squared_distance(const Camera& camera, const base::Bounds& bounds) {
  const auto outside = [](float at, float low, float high) {
    return static_cast<double>(std::max({low - at, at - high, 0.0F}));
  };
  return std::pow(outside(camera.eye.x, bounds.min.x, bounds.max.x), 2) +
         std::pow(outside(camera.eye.y, bounds.min.y, bounds.max.y), 2) +
         std::pow(outside(camera.eye.z, bounds.min.z, bounds.max.z), 2);
}

/// Adds to each its place when all are sorted by `key`, smallest first; equal keys share one.
template <class Key>
void add_places(const std::vector<std::shared_ptr<TileSlot>>& slots, std::vector<std::size_t>& places, const Key& key) {
  std::vector<std::size_t> order(slots.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return key(*slots[a]) < key(*slots[b]); });
  std::size_t place = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && key(*slots[order[i - 1]]) < key(*slots[order[i]])) place = i;
    places[order[i]] += place;
  }
}

}  // namespace

void encode(RawEncoding& encoding, FrameCache::State& cache) {
  const ColourKey key = encoding.demand.raw_key(encoding.revision, RawDemand::kLayers[encoding.layer]);
  std::string reason;
  try {
    auto result = encoded_layer(encoding, cache);
    if (result) {
      encoding.made = std::move(result).value();
      cache.store_colours(key, encoding.made);
      return;
    }
    reason = result.error().message;
  } catch (const std::exception& exception) {
    reason = exception.what();
  }
  cache.abandon_colours(key);
  if (cache.is_first_failure(Identity(encoding.tile))) {
    const protocol::TileId id = encoding.tile->id;
    spdlog::error("tile {}/{}/{}/{} has a raw layer that cannot be encoded: {}", id.level, id.x, id.y, id.z, reason);
  }
}

std::vector<std::shared_ptr<TileSlot>> raw_order(const std::vector<std::shared_ptr<TileSlot>>& wanted,
                                                 const ViewTree& tree, const std::optional<Camera>& camera) {
  std::vector<std::shared_ptr<TileSlot>> slots;
  std::vector<std::shared_ptr<TileSlot>> drawn;
  for (const auto& slot : wanted) {
    const bool is_top = !tree.nodes()[slot->node].parent;
    if (is_top) {
      slots.push_back(slot);
    } else if (slot->wish.is_target) {
      drawn.push_back(slot);
    }
  }
  std::vector<std::size_t> places(drawn.size(), 0);
  add_places(drawn, places, [](const TileSlot& slot) {
    const float highest = slot.tile->highest_celsius;
    return std::isnan(highest) ? std::numeric_limits<float>::infinity() : -highest;
  });
  if (camera) {
    add_places(drawn, places, [&](const TileSlot& slot) { return squared_distance(*camera, slot.tile->bounds); });
  }
  std::vector<std::size_t> order(drawn.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return places[a] < places[b]; });
  for (const std::size_t index : order) slots.push_back(drawn[index]);
  return slots;
}

}  // namespace spectra::stream
