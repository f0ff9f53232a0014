#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "fusion/fusion_plan.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::stream::testing {

/// A patch of bumpy surface of `side` x `side` vertices, one metre wide, `column` metres along x; all vertices distinct.
std::shared_ptr<map::Tile> patch_tile(protocol::TileId id, int side, int column, float celsius);

/// A snapshot made of tiles that the test supplies.
class FakeScene : public map::SceneSnapshot {
 public:
  FakeScene(std::vector<std::shared_ptr<const map::Tile>> tiles, std::uint32_t revision);
  /// With the reference temperature of another one, as a map that has changed a little.
  FakeScene(std::vector<std::shared_ptr<const map::Tile>> tiles, std::uint32_t revision,
            const map::SceneSnapshot& before);

  const std::string& name() const override { return name_; }
  std::uint32_t revision() const override { return revision_; }
  std::uint64_t vertex_count() const override;
  std::uint64_t triangle_count() const override;
  bool is_point_cloud() const override { return false; }
  base::Vec3d origin() const override { return {}; }
  const base::Bounds& bounds() const override { return bounds_; }
  const base::Bounds& core_bounds() const override { return bounds_; }
  base::UpAxis up() const override { return base::UpAxis::Z; }
  bool is_metric() const override { return true; }
  std::span<const files::Note> notes() const override { return {}; }
  int level_count() const override { return 3; }
  std::span<const std::shared_ptr<const map::Tile>> tiles() const override { return tiles_; }
  const fusion::SceneTemperature& temperature() const override { return *temperature_; }
  std::shared_ptr<const fusion::SceneTemperature> reference_temperature() const override { return reference_; }
  std::uint32_t vertex_index(const map::Tile& leaf, std::size_t vertex) const override {
    return leaf.source_vertex[vertex];
  }
  std::optional<map::Probe> probe(base::Vec3f) const override { return std::nullopt; }
  std::optional<map::Extreme> hottest() const override { return std::nullopt; }
  std::optional<map::Extreme> over_range() const override { return std::nullopt; }
  std::optional<map::Extreme> under_range() const override { return std::nullopt; }
  double highlighted_share(const fusion::FusionPlan&) const override { return 0; }
  std::optional<map::Extreme> coldest() const override { return std::nullopt; }
  float suggested_position_step_m() const override { return 0.001F; }
  std::optional<mesh::MultispectralMesh> block_mesh(std::string_view) const override { return std::nullopt; }
  mesh::MultispectralMesh whole_mesh() const override { return {}; }

 private:
  std::string name_ = "fake";
  std::uint32_t revision_;
  std::vector<std::shared_ptr<const map::Tile>> tiles_;
  base::Bounds bounds_;
  std::shared_ptr<const fusion::SceneTemperature> temperature_;
  std::shared_ptr<const fusion::SceneTemperature> reference_;
};

/// A root and `leaf_count` leaves beneath it (at most 64), every tile of `side` x `side` vertices.
std::vector<std::shared_ptr<const map::Tile>> tiles_of_tree(int leaf_count, int side = 12);

/// A quadtree of `level_count` levels over the square (0,0)-(4,4): tiles of `side` x `side` vertices in their place, with a
/// geometric error of 0.4 m at the root that halves with each level and is 0 at the leaves.
std::vector<std::shared_ptr<const map::Tile>> quadtree_tiles(int level_count, int side);

/// One vertex lies a centimetre higher.
void lift_a_vertex(map::Tile& tile);

/// Of quadtree_tiles(3, side): the first leaf and the two tiles above it are others, as where a map has changed. Returns the leaf.
protocol::TileId change_leaf_and_above(std::vector<std::shared_ptr<const map::Tile>>& tiles,
                                       const std::function<void(map::Tile&)>& change = lift_a_vertex);

std::shared_ptr<const map::SceneSnapshot> scene_of(std::vector<std::shared_ptr<const map::Tile>> tiles,
                                                   std::uint32_t revision = 1);

/// The default blend with that alpha, made ready for the scene.
fusion::FusionPlan plan_with_alpha(const map::SceneSnapshot& scene, double alpha);

}  // namespace spectra::stream::testing
