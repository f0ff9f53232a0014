#include "fake_scene.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fusion/settings.hpp"
#include "fusion/statistics/temperature_statistics.hpp"

namespace spectra::stream::testing {

std::shared_ptr<map::Tile> patch_tile(protocol::TileId id, int side, int column, float celsius) {
  auto tile = std::make_shared<map::Tile>();
  tile->id = id;
  tile->lowest_celsius = celsius;
  tile->highest_celsius = celsius + 5;
  const auto spacing = 1.0F / static_cast<float>(side - 1);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const float u = static_cast<float>(x) * spacing;
      const float v = static_cast<float>(y) * spacing;
      tile->positions.push_back({static_cast<float>(column) + u, v, 0.1F * std::sin(9 * u) * std::cos(7 * v)});
      const auto i = static_cast<std::uint32_t>(tile->positions.size() - 1);
      tile->visible.push_back({static_cast<std::uint8_t>(i * 7), static_cast<std::uint8_t>(i * 13),
                               static_cast<std::uint8_t>(column * 40)});
      tile->temperature_celsius.push_back(celsius + 5 * u);
      tile->source_vertex.push_back(i);
    }
  }
  for (int y = 0; y + 1 < side; ++y) {
    for (int x = 0; x + 1 < side; ++x) {
      const auto corner = static_cast<std::uint32_t>(y * side + x);
      const auto above = corner + static_cast<std::uint32_t>(side);
      tile->triangles.push_back({corner, corner + 1, above + 1});
      tile->triangles.push_back({corner, above + 1, above});
    }
  }
  tile->owned_count = static_cast<std::uint32_t>(tile->positions.size());
  tile->bounds = {{static_cast<float>(column), 0, -0.1F}, {static_cast<float>(column + 1), 1, 0.1F}};
  return tile;
}

FakeScene::FakeScene(std::vector<std::shared_ptr<const map::Tile>> tiles, std::uint32_t revision)
    : revision_(revision), tiles_(std::move(tiles)) {
  fusion::TemperatureAccumulator accumulator;
  if (!tiles_.empty()) bounds_ = tiles_.front()->bounds;
  for (const auto& tile : tiles_) {
    accumulator.add(tile->temperature_celsius);
    for (const auto axis : {&base::Vec3f::x, &base::Vec3f::y, &base::Vec3f::z}) {
      bounds_.min.*axis = std::min(bounds_.min.*axis, tile->bounds.min.*axis);
      bounds_.max.*axis = std::max(bounds_.max.*axis, tile->bounds.max.*axis);
    }
  }
  auto temperature = std::make_shared<fusion::SceneTemperature>();
  temperature->summary = accumulator.summary();
  temperature->histogram = [](std::uint32_t bins) { return fusion::Histogram{0, 0, std::vector<std::uint64_t>(bins)}; };
  temperature_ = std::move(temperature);
  reference_ = temperature_;
}

FakeScene::FakeScene(std::vector<std::shared_ptr<const map::Tile>> tiles, std::uint32_t revision,
                     const map::SceneSnapshot& before)
    : FakeScene(std::move(tiles), revision) {
  reference_ = before.reference_temperature();
}

std::uint64_t FakeScene::vertex_count() const {
  std::uint64_t count = 0;
  for (const auto& tile : tiles_) count += tile->positions.size();
  return count;
}

std::uint64_t FakeScene::triangle_count() const {
  std::uint64_t count = 0;
  for (const auto& tile : tiles_) count += tile->triangles.size();
  return count;
}

std::vector<std::shared_ptr<const map::Tile>> tiles_of_tree(int leaf_count, int side) {
  std::vector<std::shared_ptr<const map::Tile>> tiles;
  auto root = patch_tile({0, 0, 0, 0}, side, 0, 20);
  root->child_mask = 1;
  root->geometric_error_m = 0.1F;
  root->bounds = {{0, 0, -0.1F}, {static_cast<float>(leaf_count), 1, 0.1F}};
  tiles.push_back(root);
  for (int i = 0; i < leaf_count; ++i) {
    tiles.push_back(patch_tile({6, static_cast<std::uint32_t>(i), 0, 0}, side, i, 20 + static_cast<float>(i)));
  }
  return tiles;
}

std::vector<std::shared_ptr<const map::Tile>> quadtree_tiles(int level_count, int side) {
  std::vector<std::shared_ptr<const map::Tile>> tiles;
  for (int level = 0; level < level_count; ++level) {
    const std::uint32_t count = 1U << level;
    const float width = 4.0F / static_cast<float>(count);
    for (std::uint32_t y = 0; y < count; ++y) {
      for (std::uint32_t x = 0; x < count; ++x) {
        auto tile = patch_tile({static_cast<std::uint8_t>(level), x, y, 0}, side, 0, 20);
        const float left = static_cast<float>(x) * width;
        const float bottom = static_cast<float>(y) * width;
        for (auto& position : tile->positions) {
          position = {left + position.x * width, bottom + position.y * width, position.z * width};
        }
        tile->bounds = {{left, bottom, -0.1F * width}, {left + width, bottom + width, 0.1F * width}};
        const bool is_leaf = level + 1 == level_count;
        tile->child_mask = is_leaf ? 0 : 0x0f;
        tile->geometric_error_m = is_leaf ? 0 : 0.4F / static_cast<float>(count);
        tiles.push_back(std::move(tile));
      }
    }
  }
  return tiles;
}

void lift_a_vertex(map::Tile& tile) {
  tile.positions[0].z += 0.01F;
}

protocol::TileId change_leaf_and_above(std::vector<std::shared_ptr<const map::Tile>>& tiles,
                                       const std::function<void(map::Tile&)>& change) {
  const std::size_t leaf = 1 + 4;
  for (const std::size_t place : {std::size_t{0}, std::size_t{1}, leaf}) {
    auto tile = std::make_shared<map::Tile>(*tiles[place]);
    change(*tile);
    tiles[place] = tile;
  }
  return tiles[leaf]->id;
}

std::shared_ptr<const map::SceneSnapshot> scene_of(std::vector<std::shared_ptr<const map::Tile>> tiles,
                                                   std::uint32_t revision) {
  return std::make_shared<FakeScene>(std::move(tiles), revision);
}

fusion::FusionPlan plan_with_alpha(const map::SceneSnapshot& scene, double alpha) {
  fusion::FusionChange change;
  change.params["alpha"] = alpha;
  return fusion::FusionPlan::prepare(fusion::with_change(fusion::default_settings(), change).value(),
                                     scene.temperature())
      .value();
}

}  // namespace spectra::stream::testing
