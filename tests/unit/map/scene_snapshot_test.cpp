#include "server/map/scene_snapshot.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <random>
#include <set>
#include <thread>
#include <vector>

#include "server/map/map_grid.hpp"
#include "server/map/tile_place.hpp"
#include "tests/unit/map/generated_scene.hpp"

namespace spectra::map {
namespace {

using base::Vec3f;
using mesh::MultispectralMesh;
using testing::copy_of;

constexpr std::uint32_t kLeafSize = 1000;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

std::shared_ptr<const SceneSnapshot> snapshot_of(const mesh::MultispectralMesh& mesh,
                                                 std::uint32_t leaf_size = kLeafSize, unsigned thread_count = 2) {
  jobs::WorkerPool pool(thread_count);
  return SceneSnapshot::build(copy_of(mesh), 1, pool, leaf_size);
}

bool is_same_float(float a, float b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

/// Everything that holds of the leaves of every scene.
void expect_exact_leaves(const mesh::MultispectralMesh& mesh, const SceneSnapshot& scene) {
  ASSERT_EQ(scene.vertex_count(), mesh.vertex_count());
  ASSERT_EQ(scene.triangle_count(), mesh.triangle_count());
  EXPECT_EQ(scene.is_point_cloud(), mesh.is_point_cloud());
  std::vector<int> owners(mesh.vertex_count());
  std::vector<int> holders(mesh.triangle_count());
  std::set<protocol::TileId> ids, ancestors;
  int deepest = -1;
  for (const auto& tile : scene.tiles()) {
    SCOPED_TRACE(::testing::Message() << "tile " << int{tile->id.level} << " " << tile->id.x << " " << tile->id.y << " "
                                      << tile->id.z);
    EXPECT_EQ(tile->child_mask, 0);
    EXPECT_EQ(tile->geometric_error_m, 0);
    EXPECT_GE(int{tile->id.level}, deepest) << "coarse before fine";
    deepest = tile->id.level;
    EXPECT_TRUE(ids.insert(tile->id).second);
    EXPECT_LE(int{tile->id.level}, kDeepestLevel);
    for (const std::uint32_t c : {tile->id.x, tile->id.y, tile->id.z}) EXPECT_LT(c, 1u << tile->id.level);
    for (auto id = tile->id; id.level > 0;) ancestors.insert(id = parent_of(id));

    const std::size_t count = tile->positions.size();
    ASSERT_EQ(tile->visible.size(), count);
    ASSERT_EQ(tile->temperature_celsius.size(), count);
    ASSERT_EQ(tile->source_vertex.size(), count);
    ASSERT_LE(tile->owned_count, count);
    EXPECT_EQ(tile->triangles.empty(), mesh.is_point_cloud());
    std::set<std::uint32_t> sources(tile->source_vertex.begin(), tile->source_vertex.end());
    EXPECT_EQ(sources.size(), count) << "a vertex stands once in a tile";
    std::vector<bool> is_drawn(count, mesh.is_point_cloud());
    ASSERT_EQ(tile->triangles.size(), tile->source_triangle.size());
    for (std::size_t t = 0; t < tile->triangles.size(); ++t) {
      ++holders.at(tile->source_triangle[t]);
      for (unsigned corner = 0; corner < 3; ++corner) {
        const std::uint32_t v = tile->triangles[t][corner];
        ASSERT_LT(v, count);
        is_drawn[v] = true;
        EXPECT_EQ(tile->source_vertex[v], mesh.triangles()[tile->source_triangle[t]][corner]);
      }
    }
    float lowest = kNan, highest = kNan;
    for (std::size_t v = 0; v < count; ++v) {
      const std::uint32_t source = tile->source_vertex[v];
      ASSERT_LT(source, mesh.vertex_count());
      if (v < tile->owned_count) {
        ++owners[source];
      } else {
        EXPECT_TRUE(is_drawn[v]) << "a copy without a triangle";
      }
      const base::Vec3f& p = tile->positions[v];
      EXPECT_EQ(p, mesh.positions()[source]);
      EXPECT_EQ(tile->visible[v], mesh.visible()[source]);
      EXPECT_TRUE(is_same_float(tile->temperature_celsius[v], mesh.temperature_celsius()[source]));
      EXPECT_TRUE(p.x >= tile->bounds.min.x && p.y >= tile->bounds.min.y && p.z >= tile->bounds.min.z);
      EXPECT_TRUE(p.x <= tile->bounds.max.x && p.y <= tile->bounds.max.y && p.z <= tile->bounds.max.z);
      if (is_drawn[v] && !std::isnan(tile->temperature_celsius[v])) {
        lowest = std::fmin(lowest, tile->temperature_celsius[v]);
        highest = std::fmax(highest, tile->temperature_celsius[v]);
      }
    }
    EXPECT_TRUE(is_same_float(tile->lowest_celsius, lowest));
    EXPECT_TRUE(is_same_float(tile->highest_celsius, highest));
  }
  for (const auto& id : ids) EXPECT_FALSE(ancestors.contains(id)) << "a leaf above another";
  EXPECT_TRUE(std::ranges::all_of(owners, [](int n) { return n == 1; }));
  EXPECT_TRUE(std::ranges::all_of(holders, [](int n) { return n == 1; }));
  protocol::TileId top = ids.empty() ? protocol::TileId{} : *ids.begin();
  for (const auto& id : ids) top = common_ancestor(top, id);
  EXPECT_EQ(scene.level_count(), ids.empty() ? 0 : deepest - top.level + 1);
}

void expect_same_mesh(const mesh::MultispectralMesh& a, const mesh::MultispectralMesh& b) {
  EXPECT_TRUE(std::ranges::equal(a.positions(), b.positions()));
  EXPECT_TRUE(std::ranges::equal(a.visible(), b.visible()));
  EXPECT_TRUE(std::ranges::equal(a.temperature_celsius(), b.temperature_celsius(), is_same_float));
  EXPECT_EQ(a.triangles(), b.triangles());
  EXPECT_EQ(a.origin, b.origin);
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.has_visible, b.has_visible);
  EXPECT_EQ(a.has_temperature, b.has_temperature);
  EXPECT_EQ(a.double_positions, b.double_positions);
}

void expect_all(const mesh::MultispectralMesh& mesh) {
  const auto scene = snapshot_of(mesh);
  expect_exact_leaves(mesh, *scene);
  expect_same_mesh(scene->whole_mesh(), mesh);
  EXPECT_GT(scene->suggested_position_step_m(), 0);
  EXPECT_TRUE(std::isfinite(scene->suggested_position_step_m()));
}

mesh::MultispectralMesh points(const std::vector<base::Vec3f>& positions) {
  mesh::MultispectralMesh mesh;
  mesh.resize_vertices(positions.size());
  std::ranges::copy(positions, mesh.positions().begin());
  return mesh;
}

TEST(SceneSnapshot, LeavesOfATerrainAreExact) {
  expect_all(testing::terrain({}));
  expect_all(testing::terrain({.columns = 1000, .rows = 7, .seed = 2}));
}

TEST(SceneSnapshot, TellsHowFarItsMakingIs) {
  for (const auto levels : {LevelsOfDetail::LeavesOnly, LevelsOfDetail::All}) {
    std::vector<double> shares;
    std::mutex mutex;
    const auto progress = [&](std::string_view phase, double share) {
      EXPECT_EQ(phase, kTilingPhase);
      const std::lock_guard lock(mutex);
      shares.push_back(share);
    };
    jobs::WorkerPool pool(2);
    files::LoadedScene scene;
    scene.mesh = testing::terrain({});
    SceneSnapshot::build(std::move(scene), 1, pool, kLeafSize, levels, progress);
    ASSERT_GT(shares.size(), 5U);
    EXPECT_EQ(shares.front(), 0);
    EXPECT_DOUBLE_EQ(*std::max_element(shares.begin(), shares.end()), 1);
  }
}

TEST(SceneSnapshot, OwnsVerticesOfNoTriangle) {
  expect_all(testing::terrain({.has_lone_vertices = true}));
}

TEST(SceneSnapshot, LeavesOfAPointCloudAreExact) {
  expect_all(testing::point_cloud(20'000, 3));
}

TEST(SceneSnapshot, LeavesHaveTheSizeAskedFor) {
  for (const mesh::MultispectralMesh& mesh :
       {testing::terrain({.columns = 300, .rows = 200}), testing::point_cloud(60'000, 5)}) {
    const auto scene = snapshot_of(mesh);
    std::size_t small_count = 0;
    for (const auto& tile : scene->tiles()) {
      EXPECT_LE(tile->owned_count, kLeafSize * 5 / 4);
      if (tile->owned_count < kLeafSize / 4) ++small_count;
    }
    EXPECT_EQ(small_count, 0u);
    EXPECT_LE(scene->tiles().size(), 2.5 * 60'000 / kLeafSize);
  }
}

TEST(SceneSnapshot, BordersOfATerrainAreShort) {
  const auto scene = snapshot_of(testing::terrain({.columns = 400, .rows = 400}), 4000);
  std::size_t total = 0;
  for (const auto& tile : scene->tiles()) total += tile->positions.size();
  EXPECT_LT(static_cast<double>(total), 1.06 * 160'000);
}

TEST(SceneSnapshot, SmallSceneIsOneRoot) {
  const auto scene = snapshot_of(testing::terrain({.columns = 20, .rows = 20}));
  ASSERT_EQ(scene->tiles().size(), 1u);
  EXPECT_EQ(scene->tiles()[0]->id, protocol::TileId{});
  EXPECT_EQ(scene->level_count(), 1);
}

TEST(SceneSnapshot, SameForAnyThreadCount) {
  const mesh::MultispectralMesh mesh = testing::terrain({.columns = 300, .rows = 300, .has_lone_vertices = true});
  const auto one = snapshot_of(mesh, kLeafSize, 1);
  for (const unsigned thread_count : {2u, 5u}) {
    const auto other = snapshot_of(mesh, kLeafSize, thread_count);
    ASSERT_EQ(one->tiles().size(), other->tiles().size());
    EXPECT_EQ(one->suggested_position_step_m(), other->suggested_position_step_m());
    for (std::size_t i = 0; i < one->tiles().size(); ++i) {
      const Tile &a = *one->tiles()[i], &b = *other->tiles()[i];
      EXPECT_EQ(a.id, b.id);
      EXPECT_EQ(a.owned_count, b.owned_count);
      EXPECT_EQ(a.source_vertex, b.source_vertex);
      EXPECT_EQ(a.triangles, b.triangles);
      EXPECT_EQ(a.source_triangle, b.source_triangle);
    }
  }
}

TEST(SceneSnapshot, StatisticsAreThoseOfAllVertices) {
  const mesh::MultispectralMesh mesh = testing::terrain({.columns = 150, .rows = 130, .has_lone_vertices = true});
  const auto scene = snapshot_of(mesh);
  fusion::TemperatureAccumulator direct;
  direct.add(mesh.temperature_celsius());
  const auto expected = direct.summary();
  const auto& summary = scene->temperature().summary;
  EXPECT_EQ(summary.finite_count, expected.finite_count);
  EXPECT_EQ(summary.missing_count, expected.missing_count);
  EXPECT_GT(summary.missing_count, 0u);
  EXPECT_EQ(summary.minimum, expected.minimum);
  EXPECT_EQ(summary.maximum, expected.maximum);
  EXPECT_EQ(summary.mean, expected.mean);
  EXPECT_EQ(summary.sigma, expected.sigma);
}

TEST(SceneSnapshot, HistogramIsThatOfAllVerticesForEveryThread) {
  const mesh::MultispectralMesh mesh = testing::terrain({.columns = 150, .rows = 130, .has_lone_vertices = true});
  auto scene = snapshot_of(mesh);
  const fusion::SceneTemperature temperature = scene->temperature();
  scene.reset();
  std::atomic<int> wrong_count{0};
  std::vector<std::thread> threads;
  for (int thread = 0; thread < 4; ++thread) {
    threads.emplace_back([&] {
      for (std::uint32_t bins = 1; bins < 40; ++bins) {
        fusion::Histogram expected{temperature.summary.minimum, temperature.summary.maximum,
                                   std::vector<std::uint64_t>(bins)};
        fusion::add_to_histogram(mesh.temperature_celsius(), expected);
        const fusion::Histogram got = temperature.histogram(bins);
        if (got.counts != expected.counts || got.minimum != expected.minimum || got.maximum != expected.maximum) {
          ++wrong_count;
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong_count, 0);
}

TEST(SceneSnapshot, ExtremesAreTheFirstOfTheirKind) {
  mesh::MultispectralMesh mesh = testing::terrain({});
  const std::span<float> t = mesh.temperature_celsius();
  t[4000] = t[123] = t[9000] = 80;
  t[777] = t[600] = -40;
  t[5] = std::numeric_limits<float>::infinity();
  const auto scene = snapshot_of(mesh);
  ASSERT_TRUE(scene->hottest() && scene->coldest());
  EXPECT_EQ(scene->hottest()->temperature_celsius, 80);
  EXPECT_EQ(scene->hottest()->position, mesh.positions()[123]);
  EXPECT_EQ(scene->coldest()->temperature_celsius, -40);
  EXPECT_EQ(scene->coldest()->position, mesh.positions()[600]);
  ASSERT_TRUE(scene->over_range());
  EXPECT_EQ(scene->over_range()->position, mesh.positions()[5]) << "hotter than the sensor could tell is told apart";
  EXPECT_FALSE(scene->under_range());
  const auto probe = scene->probe(mesh.positions()[5]);
  ASSERT_TRUE(probe && probe->temperature_celsius);
  EXPECT_EQ(*probe->temperature_celsius, std::numeric_limits<float>::infinity());
}

TEST(SceneSnapshot, NoTemperatureMeansNoExtremes) {
  mesh::MultispectralMesh mesh = testing::terrain({.columns = 60, .rows = 60});
  std::ranges::fill(mesh.temperature_celsius(), kNan);
  const auto scene = snapshot_of(mesh);
  EXPECT_FALSE(scene->hottest() || scene->coldest());
  EXPECT_FALSE(scene->temperature().summary.has_temperature());
  EXPECT_TRUE(std::isnan(scene->tiles()[0]->lowest_celsius));
}

TEST(SceneSnapshot, ProbeEqualsBruteForce) {
  for (const mesh::MultispectralMesh& mesh :
       {testing::terrain({.has_lone_vertices = true}), testing::point_cloud(10'000, 9)}) {
    const auto scene = snapshot_of(mesh);
    std::mt19937 random(4);
    for (int i = 0; i < 200; ++i) {
      const base::Bounds& b = scene->bounds();
      const auto between = [&](float low, float high) {
        return low + (high - low) * (static_cast<float>(random() % 1400) * 0.001f - 0.2f);
      };
      const base::Vec3f p{between(b.min.x, b.max.x), between(b.min.y, b.max.y), between(b.min.z, b.max.z)};
      std::size_t best = 0;
      double best_squared = std::numeric_limits<double>::infinity();
      for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
        const double dx = double{mesh.positions()[v].x} - double{p.x};
        const double dy = double{mesh.positions()[v].y} - double{p.y};
        const double dz = double{mesh.positions()[v].z} - double{p.z};
        const double squared = dx * dx + dy * dy + dz * dz;
        if (squared < best_squared) {
          best_squared = squared;
          best = v;
        }
      }
      const auto probe = scene->probe(p);
      ASSERT_TRUE(probe);
      EXPECT_EQ(probe->vertex_index, best);
      EXPECT_EQ(probe->position, mesh.positions()[best]);
      EXPECT_EQ(probe->visible, mesh.visible()[best]);
      EXPECT_EQ(probe->temperature_celsius.has_value(), !std::isnan(mesh.temperature_celsius()[best]));
      EXPECT_DOUBLE_EQ(probe->distance_m, std::sqrt(best_squared));
    }
    EXPECT_FALSE(scene->probe({kNan, 0, 0}));
  }
}

fusion::FusionPlan threshold_plan(const SceneSnapshot& scene, double threshold, double alpha = 1) {
  fusion::FusionChange change;
  change.method = "colour_mapped_threshold";
  change.params = {{"threshold", threshold}, {"alpha", alpha}};
  const auto settings = fusion::with_change(fusion::default_settings(), change).value();
  return fusion::FusionPlan::prepare(settings, scene.temperature()).value();
}

TEST(SceneSnapshot, HighlightedShareIsOfTheSurface) {
  mesh::MultispectralMesh mesh = testing::terrain({.columns = 50, .rows = 50, .has_missing_temperature = false});
  const auto area_of = [&](const base::Triangle& t) {
    const auto p = mesh.positions();
    const auto d = [&](std::uint32_t a, std::uint32_t b) {
      return std::array{double{p[b].x} - double{p[a].x}, double{p[b].y} - double{p[a].y},
                        double{p[b].z} - double{p[a].z}};
    };
    const auto u = d(t[0], t[1]), v = d(t[0], t[2]);
    return std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
  };
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) mesh.temperature_celsius()[v] = v < 400 ? 60 : 20;
  mesh.temperature_celsius()[401] = std::numeric_limits<float>::infinity();
  double hot = 0, all = 0;
  for (const base::Triangle& t : mesh.triangles()) {
    all += area_of(t);
    for (const std::uint32_t v : t) hot += mesh.temperature_celsius()[v] > 40 ? area_of(t) / 3 : 0;
  }
  const auto scene = snapshot_of(mesh);
  EXPECT_NEAR(scene->highlighted_share(threshold_plan(*scene, 40)), hot / all, 1e-5);
  EXPECT_EQ(scene->highlighted_share(threshold_plan(*scene, 40, 0)), 0) << "nothing can be seen of it";
  EXPECT_EQ(scene->highlighted_share(threshold_plan(*scene, -40)), 1);
  const double saturated = scene->highlighted_share(threshold_plan(*scene, 4000));
  EXPECT_GT(saturated, 0) << "over range is above every threshold";
  EXPECT_LT(saturated, 0.01);
}

TEST(SceneSnapshot, HighlightedShareOfPointsCountsThem) {
  mesh::MultispectralMesh mesh = testing::point_cloud(5'000, 9);
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) mesh.temperature_celsius()[v] = v % 5 == 0 ? 60 : 20;
  const auto scene = snapshot_of(mesh);
  EXPECT_DOUBLE_EQ(scene->highlighted_share(threshold_plan(*scene, 40)), 0.2);
  mesh::MultispectralMesh one_place = testing::terrain({.columns = 20, .rows = 20, .has_missing_temperature = false});
  std::ranges::fill(one_place.positions(), base::Vec3f{1, 2, 3});
  std::ranges::fill(one_place.temperature_celsius(), 50.0F);
  const auto flat = snapshot_of(one_place);
  EXPECT_DOUBLE_EQ(flat->highlighted_share(threshold_plan(*flat, 40)), 1);
}

TEST(SceneSnapshot, PositionStepFollowsTheEdgeLength) {
  const auto terrain = snapshot_of(testing::terrain({.columns = 200, .rows = 200}));
  EXPECT_EQ(terrain->suggested_position_step_m(), 0.25f);
  const auto cloud = snapshot_of(testing::point_cloud(20'000, 3));
  const double spacing = 0.554 / std::cbrt(20'000.0);
  EXPECT_NEAR(std::log2(static_cast<double>(cloud->suggested_position_step_m()) / (spacing / 4)), 0, 0.8);
}

TEST(SceneSnapshot, EmptySceneHasNoTiles) {
  const auto scene = snapshot_of(mesh::MultispectralMesh());
  EXPECT_TRUE(scene->tiles().empty());
  EXPECT_EQ(scene->level_count(), 0);
  EXPECT_FALSE(scene->probe({0, 0, 0}));
  EXPECT_EQ(scene->whole_mesh().vertex_count(), 0u);
}

TEST(SceneSnapshot, DegenerateScenesAreCutToo) {
  expect_all(points({{1, 2, 3}}));
  expect_all(points(std::vector<base::Vec3f>(5000, {1, 2, 3})));
  {
    mesh::MultispectralMesh triangle = points({{0, 0, 0}, {0, 0, 0}, {0, 0, 0}});
    triangle.triangles() = {{0, 1, 2}, {0, 0, 0}, {2, 1, 1}};
    expect_all(triangle);
  }
  {
    SCOPED_TRACE("a plane");
    mesh::MultispectralMesh plane = testing::terrain({});
    for (base::Vec3f& p : plane.positions()) p.z = 7;
    expect_all(plane);
  }
  for (const float scale : {1e-44f, 1e-30f, 3e36f}) {
    SCOPED_TRACE(scale);
    mesh::MultispectralMesh scaled = testing::terrain({});
    for (base::Vec3f& p : scaled.positions()) p = {p.x * scale, p.y * scale, p.z * scale};
    expect_all(scaled);
  }
  {
    SCOPED_TRACE("the whole range of float");
    mesh::MultispectralMesh wide = testing::point_cloud(5000, 2);
    const float largest = std::numeric_limits<float>::max();
    wide.positions()[0] = {largest, largest, largest};
    wide.positions()[1] = {-largest, -largest, -largest};
    expect_all(wide);
  }
}

TEST(SceneSnapshot, OutliersAndCoincidentPointsDoNotStopTheCutting) {
  {
    mesh::MultispectralMesh mesh = testing::point_cloud(20'000, 8);
    mesh.positions()[17] = {1e9f, -1e9f, 3e8f};
    const auto scene = snapshot_of(mesh);
    expect_exact_leaves(mesh, *scene);
    for (const auto& tile : scene->tiles()) EXPECT_LE(tile->owned_count, kLeafSize * 5 / 4);
  }
  {
    mesh::MultispectralMesh mesh = testing::point_cloud(20'000, 8);
    for (std::size_t v = 0; v < 12'000; ++v) mesh.positions()[v] = {0, 0, 0};
    const auto scene = snapshot_of(mesh);
    expect_exact_leaves(mesh, *scene);
    std::size_t large_count = 0;
    for (const auto& tile : scene->tiles()) {
      if (tile->owned_count > kLeafSize * 5 / 4) ++large_count;
    }
    EXPECT_EQ(large_count, 1u) << "only the points that nothing separates";
  }
  {
    SCOPED_TRACE("every point at half the distance of the one before");
    std::vector<base::Vec3f> line(120);
    for (std::size_t i = 0; i < line.size(); ++i) line[i] = {std::ldexp(1.0f, -static_cast<int>(i)), 0, 0};
    const mesh::MultispectralMesh mesh = points(line);
    expect_exact_leaves(mesh, *snapshot_of(mesh, 1));
  }
}

TEST(SceneSnapshot, FewTrianglesAmongManyLoneVertices) {
  mesh::MultispectralMesh mesh = testing::point_cloud(10'000, 6);
  mesh.triangles() = {{0, 1, 2}, {5, 1, 2}};
  expect_all(mesh);
}

TEST(SceneSnapshot, TriangleSoupHasLeavesOfTheRightSize) {
  const mesh::MultispectralMesh soup = testing::soup_of(testing::terrain({.is_shuffled = false}));
  expect_all(soup);
  const auto scene = snapshot_of(soup);
  for (const auto& tile : scene->tiles()) EXPECT_LE(tile->owned_count, kLeafSize * 5 / 4);
}

TEST(SceneSnapshot, TellsHowFarItIsAllAlong) {
  std::mutex mutex;
  std::vector<double> shares;
  const auto progress = [&](std::string_view phase, double share) {
    const std::lock_guard lock(mutex);
    if (phase == kTilingPhase) shares.push_back(share);
  };
  jobs::WorkerPool pool(2);
  SceneSnapshot::build(files::LoadedScene{testing::point_cloud(30'000, 3), {}, {}}, 1, pool, kLeafVertexCount,
                       LevelsOfDetail::LeavesOnly, progress);
  std::sort(shares.begin(), shares.end());
  ASSERT_GT(shares.size(), 20U);
  EXPECT_EQ(shares.back(), 1);
  double longest = 0;
  for (std::size_t i = 1; i < shares.size(); ++i) longest = std::max(longest, shares[i] - shares[i - 1]);
  EXPECT_LT(longest, 0.4);
}

}  // namespace
}  // namespace spectra::map
