#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "fake_scene.hpp"
#include "server/stream/view_selection.hpp"
#include "test_viewer.hpp"

namespace spectra::stream::testing {

/// A server with one scene, to which viewers come.
class StreamWithViewers : public ::testing::Test {
 protected:
  void show(TestViewer& viewer, double alpha) { viewer.stream().set_plan(plan_with_alpha(*scene_, alpha)); }

  /// Takes until nothing more comes.
  void settle(TestViewer& viewer) {
    std::size_t quiet = 0;
    while (quiet < 2) {
      wait_until_idle(pool_);
      const bool has_completed = viewer.stream().take_complete().has_value();
      quiet = viewer.take() == 0 && !has_completed ? quiet + 1 : 0;
    }
  }

  /// Expects that the viewer holds exactly the scene's tiles, in the colours of `alpha` at `colour_bits`.
  void expect_picture(const TestViewer& viewer, const map::SceneSnapshot& scene, double alpha, int colour_bits = 8) {
    const auto plan = plan_with_alpha(scene, alpha);
    ASSERT_EQ(viewer.tiles.size(), scene.tiles().size());
    for (const auto& tile : scene.tiles()) {
      const auto held = viewer.tiles.find(tile->id);
      ASSERT_NE(held, viewer.tiles.end());
      EXPECT_EQ(held->second.geometry.child_mask, tile->child_mask);
      EXPECT_EQ(held->second.geometry.geometric_error_m, tile->geometric_error_m);
      expect_tile(held->second, *tile, plan, colour_bits);
    }
  }

  static void expect_tile(const HeldTile& held, const map::Tile& tile, const fusion::FusionPlan& plan,
                          int colour_bits) {
    std::vector<base::Rgb8> fused(tile.positions.size());
    plan.fuse(tile.temperature_celsius, tile.visible, fused);
    const float half_step = held.geometry.position_step_m / 2 * 1.001F;
    ASSERT_EQ(held.positions_m.size(), tile.positions.size());
    ASSERT_EQ(held.colours.size(), held.positions_m.size());
    std::vector<std::size_t> by_x(tile.positions.size());
    std::iota(by_x.begin(), by_x.end(), 0);
    std::sort(by_x.begin(), by_x.end(),
              [&](std::size_t a, std::size_t b) { return tile.positions[a].x < tile.positions[b].x; });
    for (std::size_t i = 0; i < held.positions_m.size(); ++i) {
      const auto& p = held.positions_m[i];
      auto source = std::lower_bound(by_x.begin(), by_x.end(), p[0] - half_step,
                                     [&](std::size_t index, float x) { return tile.positions[index].x < x; });
      while (source != by_x.end() && (std::abs(p[1] - tile.positions[*source].y) > half_step ||
                                      std::abs(p[2] - tile.positions[*source].z) > half_step)) {
        ++source;
      }
      ASSERT_NE(source, by_x.end());
      ASSERT_LE(std::abs(p[0] - tile.positions[*source].x), half_step);
      const base::Rgb8 colour = fused[*source];
      const protocol::codec::ColourBytes expected{protocol::codec::rounded_channel(colour.r, colour_bits),
                                                  protocol::codec::rounded_channel(colour.g, colour_bits),
                                                  protocol::codec::rounded_channel(colour.b, colour_bits)};
      ASSERT_EQ(held.colours[i], expected);
    }
  }

  std::shared_ptr<const map::SceneSnapshot> scene_ = scene_of(tiles_of_tree(6));
  FrameCache cache_{64u << 20};  ///< Roomy.
  jobs::WorkerPool pool_{2};
};

/// Sixteen leaves under four quarters under a root, over the square (0,0)-(4,4).
class StreamOfATree : public StreamWithViewers {
 protected:
  StreamOfATree() { scene_ = scene_of(quadtree_tiles(3, 40)); }

  static Camera camera_over(float x, float y, float height) {
    return {.eye = {x, y, height}, .target = {x, y, 0}, .up = {0, 1, 0}, .fov_y_deg = 50, .viewport = {800, 800}};
  }

  /// What a client draws by the protocol's rule, whatever the colours are.
  static std::set<protocol::TileId> drawn(const TestViewer& viewer) {
    std::set<protocol::TileId> result;
    const std::function<bool(protocol::TileId, std::set<protocol::TileId>&)> draw =
        [&](protocol::TileId id, std::set<protocol::TileId>& into) {
          const auto held = viewer.tiles.find(id);
          if (held == viewer.tiles.end() || held->second.colours.empty()) return false;
          std::set<protocol::TileId> beneath;
          const auto mask = held->second.geometry.child_mask;
          bool is_replaced = mask != 0;
          for (std::uint32_t i = 0; i < 8 && is_replaced; ++i) {
            if ((mask >> i & 1) == 0) continue;
            is_replaced = draw({static_cast<std::uint8_t>(id.level + 1), 2 * id.x + (i & 1), 2 * id.y + (i >> 1 & 1),
                                2 * id.z + (i >> 2)},
                               beneath);
          }
          if (is_replaced) {
            into.merge(beneath);
          } else {
            into.insert(id);
          }
          return true;
        };
    draw({0, 0, 0, 0}, result);
    return result;
  }

  /// Everything that is drawn and within a tenth beyond the view shows the newest colours of `alpha`.
  void expect_view(const TestViewer& viewer, const Camera& camera, double alpha) {
    const auto plan = plan_with_alpha(*scene_, alpha);
    std::size_t visible_count = 0;
    for (const auto& tile : scene_->tiles()) {
      if (!drawn(viewer).contains(tile->id) || !may_be_in_view(camera, tile->bounds)) continue;
      ++visible_count;
      const HeldTile& held = viewer.tiles.at(tile->id);
      EXPECT_EQ(held.generation, viewer.last_generation());
      expect_tile(held, *tile, plan, 8);
    }
    EXPECT_GT(visible_count, 0U);
  }
};

/// The same, and a viewer who had everything.
class StreamAfterAViewer : public StreamOfATree {
 protected:
  StreamAfterAViewer() {
    before_.stream().subscribe({});
    show(before_, 0.3);
    before_.complete();
  }

  TestViewer before_{scene_, cache_, pool_};
};

}  // namespace spectra::stream::testing
