#include "server/map/living_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "fusion/mesh/surface.hpp"
#include "tests/unit/map/generated_scene.hpp"

namespace spectra::map {
namespace {

using base::Triangle;
using base::Vec3f;
using mesh::MultispectralMesh;
using protocol::TileId;
using testing::copy_of;

constexpr std::uint32_t kLeafSize = 1000;
constexpr std::size_t kRootSize = 625 * 11 / 10;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

std::shared_ptr<const SceneSnapshot> tree_of(const mesh::MultispectralMesh& mesh, unsigned thread_count = 2,
                                             std::uint32_t leaf_size = kLeafSize) {
  jobs::WorkerPool pool(thread_count);
  return SceneSnapshot::build(copy_of(mesh), 1, pool, leaf_size, LevelsOfDetail::All);
}

TileId child_of(const TileId& id, unsigned octant) {
  return {static_cast<std::uint8_t>(id.level + 1), 2 * id.x + (octant & 1), 2 * id.y + (octant >> 1 & 1),
          2 * id.z + (octant >> 2)};
}

std::map<TileId, const Tile*> by_id(const SceneSnapshot& scene) {
  std::map<TileId, const Tile*> result;
  for (const auto& tile : scene.tiles()) result[tile->id] = tile.get();
  return result;
}

void visit_leaves(const std::map<TileId, const Tile*>& tiles, const Tile& top,
                  const std::function<void(const Tile&)>& visit) {
  if (top.child_mask == 0) return visit(top);
  for (unsigned octant = 0; octant < 8; ++octant) {
    if ((top.child_mask >> octant & 1) != 0) visit_leaves(tiles, *tiles.at(child_of(top.id, octant)), visit);
  }
}

/// A random choice of tiles that covers the scene once, of all levels.
std::vector<const Tile*> random_cut(const std::map<TileId, const Tile*>& tiles, std::mt19937& random) {
  std::vector<const Tile*> cut;
  const std::function<void(const TileId&)> choose = [&](const TileId& id) {
    const Tile& tile = *tiles.at(id);
    if (tile.child_mask == 0 || (id.level > 0 && random() % 3 == 0)) {
      cut.push_back(&tile);
      return;
    }
    for (unsigned octant = 0; octant < 8; ++octant) {
      if ((tile.child_mask >> octant & 1) != 0) choose(child_of(id, octant));
    }
  };
  choose({});
  return cut;
}

using Place = std::tuple<float, float, float>;
Place place(const base::Vec3f& p) {
  return {p.x, p.y, p.z};
}

bool is_same_float(float a, float b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

/// Everything that holds of the tree above every scene.
void expect_tree(const mesh::MultispectralMesh& mesh, const SceneSnapshot& scene) {
  const auto tiles = by_id(scene);
  ASSERT_EQ(tiles.size(), scene.tiles().size());
  ASSERT_TRUE(tiles.contains(TileId{}));
  std::size_t reached_count = 0;
  int deepest = 0;
  std::uint64_t leaf_vertices = 0, leaf_triangles = 0;
  for (const auto& tile : scene.tiles()) {
    SCOPED_TRACE(::testing::Message() << "tile " << int{tile->id.level} << " " << tile->id.x << " " << tile->id.y << " "
                                      << tile->id.z);
    EXPECT_GE(int{tile->id.level}, deepest) << "coarse before fine";
    deepest = tile->id.level;
    const std::size_t count = tile->positions.size();
    ASSERT_EQ(tile->visible.size(), count);
    ASSERT_EQ(tile->temperature_celsius.size(), count);
    ASSERT_EQ(tile->source_vertex.size(), count);
    EXPECT_EQ(tile->triangles.empty(), mesh.is_point_cloud());
    if (tile->child_mask == 0) {
      EXPECT_EQ(tile->geometric_error_m, 0);
      EXPECT_EQ(tile->colour_error_levels, 0);
      EXPECT_EQ(tile->lost_detail_m, 0);
      EXPECT_TRUE(is_same_float(tile->temperature_error_celsius, std::isnan(tile->lowest_celsius) ? kNan : 0));
      leaf_vertices += tile->owned_count;
      leaf_triangles += tile->triangles.size();
      continue;
    }
    float children_error = 0, children_colour_error = 0, children_temperature_error = kNan, children_detail = 0;
    for (unsigned octant = 0; octant < 8; ++octant) {
      if ((tile->child_mask >> octant & 1) == 0) {
        EXPECT_FALSE(tiles.contains(child_of(tile->id, octant)));
        continue;
      }
      ++reached_count;
      ASSERT_TRUE(tiles.contains(child_of(tile->id, octant)));
      const Tile& child = *tiles.at(child_of(tile->id, octant));
      children_error = std::max(children_error, child.geometric_error_m);
      children_colour_error = std::max(children_colour_error, child.colour_error_levels);
      children_temperature_error = std::fmax(children_temperature_error, child.temperature_error_celsius);
      children_detail = std::max(children_detail, child.lost_detail_m);
    }
    EXPECT_GE(tile->colour_error_levels, children_colour_error);
    EXPECT_GE(tile->lost_detail_m, children_detail);
    EXPECT_TRUE(std::isfinite(tile->lost_detail_m));
    EXPECT_EQ(std::isnan(tile->temperature_error_celsius), std::isnan(tile->lowest_celsius));
    EXPECT_FALSE(tile->temperature_error_celsius < children_temperature_error);
    EXPECT_TRUE(std::isfinite(tile->geometric_error_m));
    EXPECT_GT(tile->geometric_error_m, children_error);
    EXPECT_EQ(tile->owned_count, count);
    EXPECT_TRUE(tile->source_triangle.empty());

    std::set<Place> under;
    float lowest = kNan, highest = kNan;
    visit_leaves(tiles, *tile, [&](const Tile& leaf) {
      std::vector<bool> is_drawn(leaf.positions.size(), mesh.is_point_cloud());
      for (const base::Triangle& t : leaf.triangles) is_drawn[t[0]] = is_drawn[t[1]] = is_drawn[t[2]] = true;
      for (std::size_t v = 0; v < leaf.positions.size(); ++v) {
        if (!is_drawn[v]) continue;
        under.insert(place(leaf.positions[v]));
        if (std::isnan(leaf.temperature_celsius[v])) continue;
        lowest = std::fmin(lowest, leaf.temperature_celsius[v]);
        highest = std::fmax(highest, leaf.temperature_celsius[v]);
      }
    });
    EXPECT_TRUE(is_same_float(tile->lowest_celsius, lowest));
    EXPECT_TRUE(is_same_float(tile->highest_celsius, highest));
    float shown_lowest = kNan, shown_highest = kNan;
    std::set<Place> own;
    for (std::size_t v = 0; v < count; ++v) {
      EXPECT_TRUE(under.contains(place(tile->positions[v])));
      EXPECT_TRUE(own.insert(place(tile->positions[v])).second) << "a place twice";
      EXPECT_EQ(tile->positions[v], mesh.positions()[tile->source_vertex[v]]);
      shown_lowest = std::fmin(shown_lowest, tile->temperature_celsius[v]);
      shown_highest = std::fmax(shown_highest, tile->temperature_celsius[v]);
      const base::Vec3f& p = tile->positions[v];
      EXPECT_TRUE(p.x >= tile->bounds.min.x && p.y >= tile->bounds.min.y && p.z >= tile->bounds.min.z);
      EXPECT_TRUE(p.x <= tile->bounds.max.x && p.y <= tile->bounds.max.y && p.z <= tile->bounds.max.z);
    }
    if (count > 1) {
      EXPECT_TRUE(is_same_float(shown_lowest, lowest));
      EXPECT_TRUE(is_same_float(shown_highest, highest));
    }
    for (const base::Triangle& t : tile->triangles) {
      for (const std::uint32_t v : t) ASSERT_LT(v, count);
    }
  }
  EXPECT_EQ(reached_count + 1, tiles.size()) << "every tile but the root is somebody's child";
  EXPECT_EQ(scene.level_count(), deepest + 1);
  EXPECT_EQ(leaf_vertices, mesh.vertex_count());
  EXPECT_EQ(leaf_triangles, mesh.triangle_count());
}

std::size_t largest_tile(const SceneSnapshot& scene) {
  std::size_t largest = 0;
  for (const auto& tile : scene.tiles()) largest = std::max(largest, tile->positions.size());
  return largest;
}

/// For every edge of the tiles, by place: how many triangles more run along it one way than the other. Not zero: open.
std::map<std::pair<Place, Place>, int> open_edges(const std::vector<const Tile*>& tiles) {
  std::map<std::pair<Place, Place>, int> balance;
  for (const Tile* tile : tiles) {
    for (const base::Triangle& t : tile->triangles) {
      for (unsigned corner = 0; corner < 3; ++corner) {
        const Place a = place(tile->positions[t[corner]]), b = place(tile->positions[t[(corner + 1) % 3]]);
        if (a < b) ++balance[{a, b}];
        if (b < a) --balance[{b, a}];
      }
    }
  }
  std::erase_if(balance, [](const auto& edge) { return edge.second == 0; });
  return balance;
}

TEST(TileTree, HoldsForEveryKindOfScene) {
  for (const mesh::MultispectralMesh& mesh :
       {testing::terrain({.columns = 150, .rows = 150, .has_lone_vertices = true}), testing::torus(200, 100, 3),
        testing::soup_of(testing::torus(80, 40, 3)), testing::point_cloud(30'000, 3)}) {
    SCOPED_TRACE(mesh.name);
    const auto scene = tree_of(mesh);
    expect_tree(mesh, *scene);
    EXPECT_LE(scene->tiles()[0]->positions.size(), kRootSize);
    EXPECT_LE(largest_tile(*scene), kLeafSize * 3 / 2);
    EXPECT_GE(scene->level_count(), 3);
  }
}

TEST(TileTree, LeavesOnlyUnlessAskedFor) {
  jobs::WorkerPool pool(1);
  const auto scene = SceneSnapshot::build(testing::terrain({}), 1, pool, kLeafSize);
  for (const auto& tile : scene->tiles()) EXPECT_EQ(tile->child_mask, 0);
}

TEST(TileTree, SmallSceneIsOneRoot) {
  const auto scene = tree_of(testing::terrain({.columns = 20, .rows = 20}));
  ASSERT_EQ(scene->tiles().size(), 1u);
  EXPECT_EQ(scene->tiles()[0]->geometric_error_m, 0);
}

TEST(TileTree, RootStaysSmallWhereTheSceneWouldFitALeaf) {
  const mesh::MultispectralMesh mesh = testing::terrain({.columns = 30, .rows = 30});
  const auto scene = tree_of(mesh);
  expect_tree(mesh, *scene);
  EXPECT_LE(scene->tiles()[0]->positions.size(), kRootSize);
}

TEST(TileTree, SameForAnyThreadCount) {
  const mesh::MultispectralMesh mesh = testing::terrain({.columns = 200, .rows = 200});
  const auto one = tree_of(mesh, 1);
  const auto four = tree_of(mesh, 4);
  ASSERT_EQ(one->tiles().size(), four->tiles().size());
  for (std::size_t i = 0; i < one->tiles().size(); ++i) {
    const Tile &a = *one->tiles()[i], &b = *four->tiles()[i];
    EXPECT_EQ(a.id, b.id);
    EXPECT_EQ(a.geometric_error_m, b.geometric_error_m);
    EXPECT_EQ(a.colour_error_levels, b.colour_error_levels);
    EXPECT_TRUE(is_same_float(a.temperature_error_celsius, b.temperature_error_celsius));
    EXPECT_EQ(a.lost_detail_m, b.lost_detail_m);
    EXPECT_EQ(a.source_vertex, b.source_vertex);
    EXPECT_EQ(a.triangles, b.triangles);
    EXPECT_EQ(a.visible, b.visible);
    EXPECT_TRUE(std::ranges::equal(a.temperature_celsius, b.temperature_celsius, is_same_float));
  }
}

TEST(TileTree, ClosedSurfaceStaysClosedAtAnyMixOfLevels) {
  for (const mesh::MultispectralMesh& mesh :
       {testing::torus(250, 120, 7), testing::soup_of(testing::torus(90, 50, 7))}) {
    const auto scene = tree_of(mesh);
    const auto tiles = by_id(*scene);
    std::mt19937 random(11);
    for (int round = 0; round < 20; ++round) {
      const auto cut = random_cut(tiles, random);
      std::set<int> levels;
      for (const Tile* tile : cut) levels.insert(tile->id.level);
      EXPECT_GE(levels.size(), 2u);
      EXPECT_TRUE(open_edges(cut).empty());
    }
    EXPECT_TRUE(open_edges({tiles.at(TileId{})}).empty());
  }
}

TEST(TileTree, BordersBetweenTilesOfAnyLevelsAreTheSameOnBothSides) {
  const mesh::MultispectralMesh mesh = testing::terrain({.columns = 220, .rows = 160});
  const auto scene = tree_of(mesh);
  const auto tiles = by_id(*scene);
  const base::Bounds& bounds = scene->bounds();
  const auto is_on_the_rim = [&](const Place& p) {
    const auto [x, y, z] = p;
    return x == bounds.min.x || x == bounds.max.x || y == bounds.min.y || y == bounds.max.y;
  };
  std::mt19937 random(12);
  std::size_t walked_count = 0;
  for (int round = 0; round < 20; ++round) {
    const auto cut = random_cut(tiles, random);
    for (const auto& [edge, balance] : open_edges(cut)) {
      EXPECT_TRUE(is_on_the_rim(edge.first) && is_on_the_rim(edge.second)) << "a crack inside the scene";
    }
    // Where tiles meet they show the same, so that no line of another colour runs along a border.
    std::map<Place, std::pair<const Tile*, std::size_t>> shown;
    for (const Tile* tile : cut) {
      for (std::size_t v = 0; v < tile->positions.size(); ++v) {
        const auto [found, is_new] = shown.try_emplace(place(tile->positions[v]), tile, v);
        if (is_new) continue;
        const auto& [other, w] = found->second;
        if (other->id.level == tile->id.level) continue;
        ++walked_count;
        EXPECT_TRUE(is_same_float(tile->temperature_celsius[v], other->temperature_celsius[w]));
        EXPECT_EQ(tile->visible[v], other->visible[w]);
        EXPECT_EQ(tile->source_vertex[v], other->source_vertex[w]);
      }
    }
  }
  EXPECT_GT(walked_count, 1000u);
}

TEST(TileTree, BordersInsideATileAreSimplified) {
  const auto scene = tree_of(testing::terrain({.columns = 220, .rows = 160}));
  EXPECT_LE(scene->tiles()[0]->positions.size(), kRootSize);
}

/// Points of the triangles, spread evenly enough.
std::vector<base::Vec3f> samples(std::span<const base::Vec3f> positions, std::span<const base::Triangle> triangles,
                                 std::size_t count, std::mt19937& random) {
  std::vector<base::Vec3f> result;
  for (std::size_t i = 0; i < count; ++i) {
    const base::Triangle& t = triangles[random() % triangles.size()];
    float u = static_cast<float>(random() % 1001) * 0.001f, v = static_cast<float>(random() % 1001) * 0.001f;
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    const float w = 1 - u - v;
    const base::Vec3f &a = positions[t[0]], &b = positions[t[1]], &c = positions[t[2]];
    result.push_back({w * a.x + u * b.x + v * c.x, w * a.y + u * b.y + v * c.y, w * a.z + u * b.z + v * c.z});
  }
  return result;
}

/// The full mesh beneath a tile.
std::pair<std::vector<base::Vec3f>, std::vector<base::Triangle>> leaves_beneath(
    const std::map<TileId, const Tile*>& tiles, const Tile& top) {
  std::pair<std::vector<base::Vec3f>, std::vector<base::Triangle>> mesh;
  auto& [positions, triangles] = mesh;
  visit_leaves(tiles, top, [&](const Tile& leaf) {
    const auto first = static_cast<std::uint32_t>(positions.size());
    positions.insert(positions.end(), leaf.positions.begin(), leaf.positions.end());
    for (const base::Triangle& t : leaf.triangles) triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  });
  return mesh;
}

TEST(TileTree, StatedErrorIsNeverBelowTheSampledDistance) {
  mesh::MultispectralMesh rough = testing::terrain({.columns = 110, .rows = 100});
  std::mt19937 random(3);
  for (base::Vec3f& p : rough.positions()) p.z *= 1 + 0.5f * static_cast<float>(random() % 100) * 0.01f;
  rough.positions()[777].z += 30;
  for (const mesh::MultispectralMesh& mesh : {std::move(rough), testing::torus(120, 70, 7)}) {
    const auto scene = tree_of(mesh);
    const auto tiles = by_id(*scene);
    for (const auto& tile : scene->tiles()) {
      if (tile->child_mask == 0) continue;
      const auto [positions, triangles] = leaves_beneath(tiles, *tile);
      const mesh::Surface full(positions, triangles), coarse(tile->positions, tile->triangles);
      const double enough = std::pow(double{tile->geometric_error_m}, 2);
      double largest = 0;
      const auto measure = [&](const mesh::Surface& surface, const std::vector<base::Vec3f>& points) {
        for (const base::Vec3f& p : points) {
          largest = std::max(largest, surface.squared_distance_anywhere(p, std::min(enough, largest),
                                                                        std::numeric_limits<double>::infinity()));
        }
      };
      measure(coarse, positions);
      measure(coarse, samples(positions, triangles, 3000, random));
      measure(full, samples(tile->positions, tile->triangles, 3000, random));
      EXPECT_LE(std::sqrt(largest), double{tile->geometric_error_m});
      EXPECT_GT(8 * std::sqrt(largest), double{tile->geometric_error_m}) << "so large that it says nothing";
    }
  }
}

TEST(TileTree, StatedErrorCoversWhatLiesBetweenTheMeasuredPoints) {
  // Peaks as narrow as the measured points are apart: the farthest point lies on a coarse flank, between them.
  constexpr int kSteps = 16;
  for (const unsigned seed : {1U, 2U}) {
    for (const bool is_flat : {true, false}) {
      mesh::MultispectralMesh mesh = testing::terrain({.columns = 24, .rows = 24, .seed = seed});
      std::mt19937 random(seed);
      for (base::Vec3f& p : mesh.positions()) p.z = is_flat ? 0 : p.z;
      for (int i = 0; i < 40; ++i) {
        base::Vec3f& peak = mesh.positions()[random() % mesh.vertex_count()];
        peak.z += static_cast<float>(random() % 100) * 0.06f;
      }
      const auto scene = tree_of(mesh, 2, 250);
      ASSERT_EQ(scene->level_count(), 2) << "with more levels the errors of all of them add up";
      const auto tiles = by_id(*scene);
      const Tile& root = *scene->tiles()[0];
      const auto [positions, triangles] = leaves_beneath(tiles, root);
      const mesh::Surface full(positions, triangles);
      double largest = 0;
      for (const base::Triangle& t : root.triangles) {
        const base::Vec3f &a = root.positions[t[0]], &b = root.positions[t[1]], &c = root.positions[t[2]];
        for (int i = 0; i <= kSteps; ++i) {
          for (int j = 0; i + j <= kSteps; ++j) {
            const float u = static_cast<float>(i) / kSteps, v = static_cast<float>(j) / kSteps, w = 1 - u - v;
            const base::Vec3f p{w * a.x + u * b.x + v * c.x, w * a.y + u * b.y + v * c.y, w * a.z + u * b.z + v * c.z};
            largest =
                std::max(largest, full.squared_distance_anywhere(p, largest, std::numeric_limits<double>::infinity()));
          }
        }
      }
      EXPECT_LE(std::sqrt(largest), double{root.geometric_error_m}) << "seed " << seed << ", flat: " << is_flat;
    }
  }
}

/// What is seen at the point of a surface nearest to a place: three channels and the temperature.
std::array<double, 4> seen_at(const Tile& tile, const base::Vec3f& p) {
  double best = std::numeric_limits<double>::infinity();
  std::array<double, 4> seen{};
  for (const base::Triangle& t : tile.triangles) {
    const base::Vec3f &a = tile.positions[t[0]], &b = tile.positions[t[1]], &c = tile.positions[t[2]];
    const double squared = mesh::squared_distance_to_triangle(p, a, b, c);
    if (squared >= best) continue;
    best = squared;
    seen = {};
    const auto weights = mesh::nearest_weights(p, a, b, c);
    for (unsigned i = 0; i < 3; ++i) {
      const base::Rgb8 colour = tile.visible[t[i]];
      seen[0] += weights[i] * colour.r;
      seen[1] += weights[i] * colour.g;
      seen[2] += weights[i] * colour.b;
      seen[3] += weights[i] * static_cast<double>(tile.temperature_celsius[t[i]]);
    }
  }
  return seen;
}

TEST(TileTree, RootIsRoundedNoFinerThanItIsOff) {
  mesh::MultispectralMesh mesh = testing::terrain({.columns = 90, .rows = 80});
  // Thin: nothing of its form would be left at the usual step.
  for (base::Vec3f& p : mesh.positions()) {
    if (p.x > 20) p.z *= 0.01f;
  }
  const auto scene = tree_of(mesh);
  const auto finest = [](const Tile& tile) {
    std::uint8_t most = 0;
    for (const StepHalvings& halvings : tile.step_halvings) most = std::max(most, std::ranges::max(halvings));
    return int{most};
  };
  const Tile& root = *scene->tiles().front();
  int finest_of_leaves = 0;
  for (const auto& tile : scene->tiles()) finest_of_leaves = std::max(finest_of_leaves, finest(*tile));
  EXPECT_LT(finest(root), finest_of_leaves);
  if (finest(root) > 0) {
    EXPECT_GT(std::ldexp(scene->suggested_position_step_m(), 1 - finest(root)), root.geometric_error_m / 8);
  }
}

/// Looks at all coarse tiles of a terrain of which one corner is harder to show than the rest; `corner_contrast` of 40: none is. Returns
/// by how much the colours of a part are worse than those of its tile, at most.
double expect_stated_errors(float corner_contrast) {
  mesh::MultispectralMesh mesh = testing::terrain({.columns = 90, .rows = 80, .has_missing_temperature = false});
  std::mt19937 random(17);
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    const base::Vec3f& p = mesh.positions()[v];
    mesh.temperature_celsius()[v] = 20 + 8 * std::sin(0.3f * p.x) * std::cos(0.2f * p.y);
    const float contrast = p.x > 50 && p.y < 35 ? corner_contrast : 40;
    mesh.visible()[v] = {static_cast<std::uint8_t>(128 + contrast * std::sin(0.8f * p.x)),
                         static_cast<std::uint8_t>(128 + 40 * std::sin(0.6f * p.y)),
                         static_cast<std::uint8_t>(random() % 30)};
  }
  const auto scene = tree_of(mesh);
  const auto tiles = by_id(*scene);
  double largest_surplus = 0;
  for (const auto& tile : scene->tiles()) {
    if (tile->child_mask == 0) continue;
    std::vector<double> colour, temperature;
    std::map<unsigned, std::vector<double>> colour_of_part, temperature_of_part;
    visit_leaves(tiles, *tile, [&](const Tile& leaf) {
      // Every triangle is about as large as every other.
      for (std::size_t i = 0; i < leaf.triangles.size(); i += 5) {
        const base::Triangle& t = leaf.triangles[i];
        const base::Vec3f p = samples(leaf.positions, std::span(&t, 1), 1, random)[0];
        const auto full = seen_at(leaf, p), shown = seen_at(*tile, p);
        double largest = 0;
        for (unsigned j = 0; j < 3; ++j) largest = std::max(largest, std::fabs(full[j] - shown[j]));
        colour.push_back(largest);
        temperature.push_back(std::fabs(full[3] - shown[3]));
        const auto& [low, high] = tile->bounds;
        const unsigned part = (p.x > (low.x + high.x) / 2 ? 1U : 0U) + (p.y > (low.y + high.y) / 2 ? 2U : 0U) +
                              (p.z > (low.z + high.z) / 2 ? 4U : 0U);
        colour_of_part[part].push_back(colour.back());
        temperature_of_part[part].push_back(temperature.back());
      }
    });
    const auto percentile = [](std::vector<double>& values) {
      const auto place = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 95 / 100);
      std::nth_element(values.begin(), place, values.end());
      return *place;
    };
    EXPECT_GE(double{tile->colour_error_levels}, percentile(colour));
    EXPECT_GE(double{tile->temperature_error_celsius}, percentile(temperature));
    for (auto& [part, errors] : colour_of_part) {
      // Of few the percentile is chance.
      if (errors.size() < 300) continue;
      EXPECT_GE(double{tile->colour_error_levels}, percentile(errors)) << "part " << part;
      EXPECT_GE(double{tile->temperature_error_celsius}, percentile(temperature_of_part[part])) << "part " << part;
      largest_surplus = std::max(largest_surplus, percentile(errors) - percentile(colour));
    }
    if (tile->id.level == 0 && corner_contrast == 40) {
      EXPECT_LE(double{tile->colour_error_levels}, 2 * percentile(colour) + 1) << "so large that it says nothing";
      EXPECT_LE(double{tile->temperature_error_celsius}, 2 * percentile(temperature) + 0.1);
    }
  }
  return largest_surplus;
}

TEST(TileTree, StatedErrorsOfColourAndTemperatureAreNotBelowThoseSampled) {
  expect_stated_errors(40);
  EXPECT_GT(expect_stated_errors(120), 5)
      << "no part of a tile is worse than the whole: the test says nothing of parts";
}

TEST(TileTree, ManySpotsAreSeenFromTheRootAndWarmNothingElse) {
  mesh::MultispectralMesh mesh = testing::terrain({.columns = 200, .rows = 200, .has_missing_temperature = false});
  std::mt19937 random(23);
  for (float& t : mesh.temperature_celsius()) t = 20 + 0.01f * static_cast<float>(random() % 20);
  std::set<Place> hot;
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    const auto x = static_cast<int>(mesh.positions()[v].x), y = static_cast<int>(mesh.positions()[v].y);
    if (x % 40 != 20 || y % 40 != 20) continue;
    mesh.temperature_celsius()[v] = 34;
    hot.insert(place(mesh.positions()[v]));
  }
  ASSERT_EQ(hot.size(), 25u);
  const auto scene = tree_of(mesh);
  const auto warm_area = [](const Tile& tile) {
    double area = 0;
    for (std::int64_t i = 0; i < 40'000; ++i) {
      const base::Triangle& t = tile.triangles[static_cast<std::size_t>(i) % tile.triangles.size()];
      const double u = static_cast<double>(i * 7919 % 1000) * 1e-3,
                   v = (1 - u) * static_cast<double>(i * 104729 % 1000) * 1e-3;
      const double celsius = (1 - u - v) * static_cast<double>(tile.temperature_celsius[t[0]]) +
                             u * static_cast<double>(tile.temperature_celsius[t[1]]) +
                             v * static_cast<double>(tile.temperature_celsius[t[2]]);
      if (celsius > 25) area += mesh::triangle_area(tile.positions[t[0]], tile.positions[t[1]], tile.positions[t[2]]);
    }
    return area * static_cast<double>(tile.triangles.size()) / 40'000;
  };
  const Tile& root = *scene->tiles()[0];
  std::set<Place> shown;
  for (std::size_t v = 0; v < root.positions.size(); ++v) {
    if (root.temperature_celsius[v] == 34) shown.insert(place(root.positions[v]));
  }
  EXPECT_EQ(shown, hot);
  // Each is as warm as its six triangles, about three square metres; the root has a vertex for every 64.
  EXPECT_LT(warm_area(root), 25 * 6);
}

TEST(TileTree, PointsOfACloudAreNeverFartherThanStated) {
  const mesh::MultispectralMesh mesh = testing::point_cloud(20'000, 21);
  const auto scene = tree_of(mesh);
  const auto tiles = by_id(*scene);
  for (const auto& tile : scene->tiles()) {
    if (tile->child_mask == 0) continue;
    double largest = 0;
    visit_leaves(tiles, *tile, [&](const Tile& leaf) {
      for (std::size_t v = 0; v < leaf.positions.size(); v += 7) {
        double nearest = std::numeric_limits<double>::infinity();
        for (const base::Vec3f& p : tile->positions)
          nearest = std::min(nearest, mesh::squared_distance(leaf.positions[v], p));
        largest = std::max(largest, nearest);
      }
    });
    EXPECT_LE(std::sqrt(largest), double{tile->geometric_error_m});
    EXPECT_GT(4 * std::sqrt(largest), double{tile->geometric_error_m});
  }
}

TEST(TileTree, HotAndColdSpotsAreSeenFromTheRoot) {
  mesh::MultispectralMesh mesh = testing::terrain({.columns = 250, .rows = 200});
  std::vector<std::uint32_t> at(mesh.vertex_count());
  for (std::uint32_t v = 0; v < at.size(); ++v) {
    const base::Vec3f& p = mesh.positions()[v];
    at[static_cast<std::size_t>(p.y) * 250 + static_cast<std::size_t>(p.x)] = v;
  }
  // A hot vertex far from others, and one beside a vertex that is colder by less than it is hotter.
  const std::uint32_t alone = at[50 * 250 + 60], hot = at[120 * 250 + 180], cold = at[120 * 250 + 181];
  mesh.temperature_celsius()[alone] = 36.5f;
  mesh.temperature_celsius()[hot] = 90;
  mesh.temperature_celsius()[cold] = -20;
  const auto scene = tree_of(mesh);
  expect_tree(mesh, *scene);
  const Tile& root = *scene->tiles()[0];
  const auto distance_to_shown = [&](float celsius, std::uint32_t source) {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t v = 0; v < root.positions.size(); ++v) {
      if (root.temperature_celsius[v] != celsius) continue;
      nearest = std::min(nearest, std::sqrt(mesh::squared_distance(root.positions[v], mesh.positions()[source])));
    }
    return nearest;
  };
  // The root has a vertex every nine metres.
  EXPECT_LT(distance_to_shown(36.5f, alone), 25);
  EXPECT_LT(distance_to_shown(90, hot), 25);
  EXPECT_LT(distance_to_shown(-20, cold), 25);
}

TEST(TileTree, MissingTemperatureGivesWayToAnyOther) {
  mesh::MultispectralMesh mesh = testing::terrain({.columns = 200, .rows = 200, .has_missing_temperature = false});
  std::mt19937 random(1);
  for (float& t : mesh.temperature_celsius()) {
    if (random() % 10 != 0) t = kNan;
  }
  const auto scene = tree_of(mesh);
  const Tile& root = *scene->tiles()[0];
  const auto missing = std::ranges::count_if(root.temperature_celsius, [](float t) { return std::isnan(t); });
  EXPECT_LT(static_cast<std::size_t>(missing), root.temperature_celsius.size() / 5);
  std::ranges::fill(mesh.temperature_celsius(), kNan);
  const auto without = tree_of(mesh);
  for (const auto& tile : without->tiles()) {
    EXPECT_TRUE(std::isnan(tile->lowest_celsius) && std::isnan(tile->highest_celsius));
    for (const float t : tile->temperature_celsius) EXPECT_TRUE(std::isnan(t));
  }
}

TEST(TileTree, WhatIsOverRangeStandsOutMost) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  mesh::MultispectralMesh mesh = testing::terrain({.columns = 150, .rows = 150, .has_missing_temperature = false});
  mesh.temperature_celsius()[150 * 75 + 75] = kInfinity;
  mesh.temperature_celsius()[150 * 20 + 20] = -kInfinity;
  mesh.temperature_celsius()[150 * 76 + 75] = 5000;
  const auto scene = tree_of(mesh);
  const Tile& root = *scene->tiles()[0];
  EXPECT_EQ(root.highest_celsius, kInfinity);
  EXPECT_EQ(root.lowest_celsius, -kInfinity);
  EXPECT_EQ(std::ranges::count(root.temperature_celsius, kInfinity), 1);
  EXPECT_EQ(std::ranges::count(root.temperature_celsius, -kInfinity), 1);
  expect_tree(mesh, *scene);
  std::ranges::fill(mesh.temperature_celsius(), kInfinity);
  const auto saturated = tree_of(mesh);
  for (const float t : saturated->tiles()[0]->temperature_celsius) EXPECT_EQ(t, kInfinity);
}

TEST(TileTree, ColoursOfCoarseTilesAreMeans) {
  mesh::MultispectralMesh mesh = testing::terrain({.columns = 150, .rows = 150});
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    mesh.visible()[v] = (static_cast<int>(mesh.positions()[v].x) + static_cast<int>(mesh.positions()[v].y)) % 2 == 0
                            ? base::Rgb8{255, 200, 0}
                            : base::Rgb8{0, 0, 100};
  }
  const auto scene = tree_of(mesh);
  double r = 0, g = 0, b = 0;
  for (const base::Rgb8& c : scene->tiles()[0]->visible) {
    r += c.r;
    g += c.g;
    b += c.b;
  }
  const auto count = static_cast<double>(scene->tiles()[0]->visible.size());
  EXPECT_NEAR(r / count, 127.5, 10);
  EXPECT_NEAR(g / count, 100, 10);
  EXPECT_NEAR(b / count, 50, 10);
}

TEST(TileTree, LoosePiecesDoNotKeepTheRootLarge) {
  // Every other triangle of a terrain: most touch another at a vertex only; then each one alone.
  mesh::MultispectralMesh sparse = testing::terrain({.columns = 120, .rows = 120, .is_shuffled = false});
  std::vector<base::Triangle> kept;
  for (std::size_t t = 0; t < sparse.triangle_count(); t += 2) kept.push_back(sparse.triangles()[t]);
  sparse.triangles() = kept;
  mesh::MultispectralMesh alone = testing::soup_of(sparse);
  for (std::size_t v = 0; v < alone.vertex_count(); ++v) alone.positions()[v].z += static_cast<float>(v / 3 % 17);
  for (const mesh::MultispectralMesh& mesh : {std::move(sparse), std::move(alone)}) {
    const auto scene = tree_of(mesh);
    expect_tree(mesh, *scene);
    EXPECT_LE(scene->tiles()[0]->positions.size(), kRootSize);
    EXPECT_FALSE(scene->tiles()[0]->triangles.empty());
  }
}

TEST(TileTree, DegenerateScenesHaveATreeToo) {
  for (const float scale : {1e-44f, 1e-30f, 3e36f}) {
    SCOPED_TRACE(scale);
    mesh::MultispectralMesh mesh = testing::terrain({.columns = 60, .rows = 60});
    for (base::Vec3f& p : mesh.positions()) p = {p.x * scale, p.y * scale, p.z * scale};
    const auto scene = tree_of(mesh);
    expect_tree(mesh, *scene);
    EXPECT_LE(scene->tiles()[0]->positions.size(), kRootSize);
  }
  {
    SCOPED_TRACE("a plane");
    mesh::MultispectralMesh mesh = testing::terrain({.columns = 60, .rows = 60});
    for (base::Vec3f& p : mesh.positions()) p.z = 0;
    expect_tree(mesh, *tree_of(mesh));
  }
  {
    SCOPED_TRACE("triangles without area");
    mesh::MultispectralMesh mesh = testing::point_cloud(5000, 4);
    for (std::uint32_t v = 0; v + 1 < 5000; ++v) mesh.triangles().push_back({v, v + 1, v + 1});
    const auto scene = tree_of(mesh);
    EXPECT_FALSE(scene->tiles()[0]->triangles.empty());
    EXPECT_LE(scene->tiles()[0]->positions.size(), kRootSize);
  }
  {
    SCOPED_TRACE("coincident points");
    mesh::MultispectralMesh mesh = testing::point_cloud(5000, 4);
    for (std::size_t v = 0; v < 4000; ++v) mesh.positions()[v] = {0.5f, 0.5f, 0.5f};
    expect_tree(mesh, *tree_of(mesh));
  }
  {
    SCOPED_TRACE("a hub");
    mesh::MultispectralMesh mesh;
    mesh.resize_vertices(8001);
    for (std::uint32_t v = 1; v <= 8000; ++v) {
      const float turn = 6.2831853f * static_cast<float>(v) / 8000;
      mesh.positions()[v] = {std::cos(turn), std::sin(turn), 0};
      mesh.triangles().push_back({0, v, v % 8000 + 1});
    }
    const auto scene = tree_of(mesh);
    expect_tree(mesh, *scene);
    EXPECT_LE(scene->tiles()[0]->positions.size(), kRootSize);
  }
}

TEST(TileTree, EmptySceneHasNoTiles) {
  EXPECT_TRUE(tree_of(mesh::MultispectralMesh())->tiles().empty());
}

}  // namespace
}  // namespace spectra::map
