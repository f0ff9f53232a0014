#include "server/map/position_step.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "form.hpp"
#include "fusion/demo/demo_scene.hpp"
#include "fusion/mesh/stray_points.hpp"
#include "server/map/scene_store.hpp"
#include "server/stream/lattice.hpp"
#include "tests/unit/map/generated_scene.hpp"

namespace spectra::stream {
namespace {

using base::Triangle;
using base::Vec3f;
using mesh::MultispectralMesh;
using testing::form_of;
using testing::FormReport;

/// Parts of a scene; what is added keeps its place.
struct Parts {
  std::vector<base::Vec3f> positions;
  std::vector<base::Triangle> triangles;

  std::uint32_t add(double x, double y, double z) {
    positions.push_back({static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
    return static_cast<std::uint32_t>(positions.size() - 1);
  }

  /// A grid of vertices over a parallelogram, with a height for each.
  template <class Height>
  void grid(int columns, int rows, base::Vec3f corner, base::Vec3f along, base::Vec3f across, Height height) {
    const auto first = static_cast<std::uint32_t>(positions.size());
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        add(double{corner.x} + column * double{along.x} + row * double{across.x},
            double{corner.y} + column * double{along.y} + row * double{across.y},
            double{corner.z} + column * double{along.z} + row * double{across.z} + height(column, row));
      }
    }
    for (int row = 0; row + 1 < rows; ++row) {
      for (int column = 0; column + 1 < columns; ++column) {
        const std::uint32_t v = first + static_cast<std::uint32_t>(row * columns + column);
        const auto next = static_cast<std::uint32_t>(columns);
        triangles.push_back({v, v + 1, v + next});
        triangles.push_back({v + 1, v + next + 1, v + next});
      }
    }
  }

  /// Level ground, `spacing` metres between vertices.
  void ground(int side, float spacing) {
    grid(side, side, {0, 0, 0}, {spacing, 0, 0}, {0, spacing, 0}, [](int, int) { return 0.0; });
  }

  void box(base::Vec3f low, base::Vec3f high) {
    std::array<std::uint32_t, 8> v{};
    for (unsigned i = 0; i < 8; ++i)
      v[i] = add(double{(i & 1) != 0 ? high.x : low.x}, double{(i & 2) != 0 ? high.y : low.y},
                 double{(i & 4) != 0 ? high.z : low.z});
    for (const std::array<unsigned, 4> side :
         {std::array<unsigned, 4>{0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}}) {
      triangles.push_back({v[side[0]], v[side[1]], v[side[2]]});
      triangles.push_back({v[side[0]], v[side[2]], v[side[3]]});
    }
  }

  /// A tube of rings of six along a direction.
  void tube(base::Vec3f start, base::Vec3f along, int ring_count, double radius) {
    const auto first = static_cast<std::uint32_t>(positions.size());
    // Two directions across: good enough for a tube.
    const std::array<double, 3> a{double{along.x}, double{along.y}, double{along.z}};
    const bool is_steep = std::abs(a[2]) > std::abs(a[0]);
    const std::array<double, 3> u = is_steep ? std::array{1.0, 0.0, -a[0] / a[2]} : std::array{-a[2] / a[0], 0.0, 1.0};
    const std::array<double, 3> w{a[1] * u[2] - a[2] * u[1], a[2] * u[0] - a[0] * u[2], a[0] * u[1] - a[1] * u[0]};
    const auto scaled = [radius](const std::array<double, 3>& v) {
      const double length = std::hypot(v[0], v[1], v[2]);
      return std::array{radius * v[0] / length, radius * v[1] / length, radius * v[2] / length};
    };
    const auto across = scaled(u), up = scaled(w);
    for (int ring = 0; ring < ring_count; ++ring) {
      for (int i = 0; i < 6; ++i) {
        const double c = std::cos(i * 1.0471975511965976), s = std::sin(i * 1.0471975511965976);
        add(double{start.x} + ring * a[0] + c * across[0] + s * up[0],
            double{start.y} + ring * a[1] + c * across[1] + s * up[1],
            double{start.z} + ring * a[2] + c * across[2] + s * up[2]);
      }
    }
    for (int ring = 0; ring + 1 < ring_count; ++ring) {
      for (std::uint32_t i = 0; i < 6; ++i) {
        const std::uint32_t v = first + static_cast<std::uint32_t>(6 * ring) + i,
                            w6 = first + static_cast<std::uint32_t>(6 * ring) + (i + 1) % 6;
        triangles.push_back({v, w6, v + 6});
        triangles.push_back({w6, w6 + 6, v + 6});
      }
    }
  }

  mesh::MultispectralMesh mesh() const {
    mesh::MultispectralMesh result;
    result.name = "parts";
    result.has_visible = true;
    result.resize_vertices(positions.size());
    std::copy(positions.begin(), positions.end(), result.positions().begin());
    result.triangles() = triangles;
    return result;
  }
};

std::shared_ptr<const map::SceneSnapshot> scene_of(mesh::MultispectralMesh mesh) {
  jobs::WorkerPool pool(2);
  return map::SceneSnapshot::build(std::move(mesh), 1, pool, 4'000, map::LevelsOfDetail::All);
}

std::string described(const FormReport& form) {
  return "pieces " + std::to_string(form.piece_count) + ": flattened " + std::to_string(form.flattened_piece_count) +
         ", merged " + std::to_string(form.merged_piece_count) + "; patches " + std::to_string(form.patch_count) +
         ": flattened " + std::to_string(form.flattened_patch_count) + ", merged " +
         std::to_string(form.merged_patch_count) + ", worst side " + std::to_string(form.worst_side_change) +
         "; torn " + std::to_string(form.torn_count);
}

void expect_kept(mesh::MultispectralMesh mesh) {
  const auto scene = scene_of(std::move(mesh));
  const FormReport form = form_of(*scene, 600);
  EXPECT_TRUE(form.is_kept()) << described(form);
}

TEST(PositionSteps, KeepARoomOfAFewVertices) {
  Parts room;
  room.box({0, 0, 0}, {8, 6, 3});
  room.box({4, 0, 0}, {4.1F, 4, 3});
  room.box({1, 1, 0}, {1.3F, 1.3F, 0.3F});
  expect_kept(room.mesh());
}

TEST(PositionSteps, KeepALongPipe) {
  Parts pipe;
  pipe.tube({0, 0, 0}, {60, 0, 0}, 2, 0.1);
  expect_kept(pipe.mesh());
  pipe.ground(120, 5);
  expect_kept(pipe.mesh());
}

TEST(PositionSteps, KeepAWarmHandOnACoarseFloor) {
  Parts scene;
  scene.ground(120, 0.8F);
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 100; ++i) {
    const double x = normal(random), y = normal(random), z = normal(random), length = std::hypot(x, y, z);
    scene.add(40.3 + 0.09 * x / length, 41.2 + 0.05 * y / length, 0.8 + 0.03 * z / length);
  }
  scene.triangles.clear();  // a cloud
  expect_kept(scene.mesh());
}

TEST(PositionSteps, KeepALabelInAMap) {
  Parts scene;
  scene.ground(130, 31);
  // Strokes of two millimetres, raised by one.
  scene.grid(60, 30, {1234.5F, 2345.25F, 12}, {0.0008F, 0, 0}, {0, 0.0003F, 0.0007F},
             [](int column, int row) { return column % 6 < 3 && row % 9 > 2 ? 0.001 : 0.0; });
  expect_kept(scene.mesh());
}

TEST(PositionSteps, KeepWiresAndCombs) {
  Parts scene;
  scene.ground(100, 0.5F);
  scene.tube({3, 3, 2}, {0.05F, 0, 0}, 60, 0.0005);
  scene.tube({3, 9, 2}, {0.03F, 0.02F, 0.04F}, 60, 0.0005);
  scene.tube({9, 9, 2}, {0, 0.001F, 0.06F}, 40, 0.002);
  const auto first = static_cast<std::uint32_t>(scene.positions.size());
  for (int tooth = 0; tooth < 60; ++tooth) {
    const float x = 20 + 0.004F * static_cast<float>(tooth);
    scene.box({x, 20, 1}, {x + 0.001F, 20.5F, 1.002F});
    if (tooth == 0) continue;
    const std::uint32_t v = first + 8 * static_cast<std::uint32_t>(tooth);
    scene.triangles.push_back({v, v - 8, v - 7});
  }
  expect_kept(scene.mesh());
}

TEST(PositionSteps, KeepHeapsOfSmallPieces) {
  Parts scene;
  scene.ground(80, 1);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> place(20, 22), size(0.001F, 0.3F);
  for (int i = 0; i < 400; ++i) {
    const base::Vec3f low{place(random), place(random), place(random) - 20};
    scene.box(low, {low.x + size(random), low.y + size(random), low.z + size(random)});
  }
  expect_kept(scene.mesh());
}

TEST(PositionSteps, KeepTheThicknessOfRoughWallsAlongAnAxis) {
  // A wall of a scan is as thick as its roughness, which is a few steps.
  Parts scene;
  std::mt19937 random(11);
  std::normal_distribution<double> roughness(0, 0.004);
  scene.grid(180, 180, {3, 1, 2}, {0.01F, 0, 0}, {0, 0.01F, 0}, [&](int, int) { return roughness(random); });
  const auto snapshot = scene_of(scene.mesh());
  const FormReport form = form_of(*snapshot, 3'000);
  ASSERT_GT(form.patch_count, 5'000u);
  EXPECT_TRUE(form.is_kept()) << described(form);
}

TEST(PositionSteps, KeepEveryPatchOfFlatTerrainWithALabelOnIt) {
  // On a regular grid many vertices are about equally far: which of them a ball holds is decided by their heights.
  Parts scene;
  std::mt19937 random(3);
  std::normal_distribution<double> roughness(0, 1.2);
  scene.grid(100, 100, {-2'000, -2'000, 0}, {40, 0, 0}, {0, 40, 0},
             [&](int i, int j) { return 3 * std::sin(i / 17.5) * std::cos(j / 12.5) + roughness(random); });
  scene.grid(51, 21, {3, -1, 1.5}, {0.001F, 0, 0}, {0, 0.001F, 0},
             [](int i, int) { return 0.0005 * std::sin(0.9 * i); });
  const auto snapshot = scene_of(scene.mesh());
  const FormReport form = form_of(*snapshot, 11'071);
  ASSERT_GT(form.patch_count, 50'000u);
  EXPECT_TRUE(form.is_kept()) << described(form);
}

TEST(PositionSteps, LeaveAnExactWallFlatWhereFinerStepsBegin) {
  // Off every lattice, along an axis, with something small hanging on it: half a step of the coarser side stood out.
  Parts scene;
  scene.grid(90, 60, {0, 0.3701F, 0}, {0.05F, 0, 0}, {0, 0, 0.05F}, [](int, int) { return 0.0; });
  scene.grid(30, 30, {2, 0.3701F, 1}, {0.002F, 0, 0}, {0, 0.0001F, 0.002F},
             [](int column, int row) { return 0.0004 * ((column * 7 + row * 3) % 5); });
  expect_kept(scene.mesh());
}

TEST(PositionSteps, KeepTheThicknessOfAFloorBesideSomethingDense) {
  // Cells of the floor are wider than what stands on it, and have all its vertices within their reach. A wall ends the floor: the piece
  // as a whole is thick.
  Parts scene;
  std::mt19937 random(5);
  std::normal_distribution<double> roughness(0, 0.0002);
  scene.grid(40, 40, {-4, -4, 0}, {0.2F, 0, 0}, {0, 0.2F, 0},
             [&](int column, int) { return column == 39 ? 1.0 : roughness(random); });
  scene.grid(135, 135, {-0.07F, -0.07F, 0.1F}, {0.001F, 0, 0}, {0, 0.001F, 0},
             [](int i, int j) { return 0.003 * std::sin(0.4 * i) * std::cos(0.3 * j); });
  const auto snapshot = scene_of(scene.mesh());
  const FormReport form = form_of(*snapshot, 3'000);
  ASSERT_GT(form.patch_count, 10'000u);
  EXPECT_TRUE(form.is_kept()) << described(form);
}

TEST(PositionSteps, KeepEveryPieceOfTheDemoScene) {
  // One of its small pieces is apart at the step that it asks for, and fell together at the finer ones of its neighbours.
  const FormReport form = form_of(*scene_of(demo::demo_scene({})), 20);
  ASSERT_GT(form.piece_count, 400u);
  EXPECT_TRUE(form.is_kept()) << described(form);
}

TEST(PositionSteps, AreTheSameForATriangleSoup) {
  const mesh::MultispectralMesh terrain = spectra::testing::terrain({.columns = 110, .rows = 110});
  const auto shared = scene_of(spectra::testing::copy_of(terrain)), soup = scene_of(spectra::testing::soup_of(terrain));
  EXPECT_EQ(shared->suggested_position_step_m(), soup->suggested_position_step_m());
  EXPECT_EQ(form_of(*soup, 100).torn_count, 0u);
  EXPECT_EQ(form_of(*shared, 100).torn_count, 0u);
}

/// The sides of what triangles make of each run of `count` vertices of the file, from `first` on, as they are drawn at full detail; one
/// for each run.
std::vector<std::array<double, 3>> drawn_sides(const map::SceneSnapshot& scene, std::uint32_t first,
                                               std::uint32_t count) {
  struct Ends {
    std::array<double, 3> low{1e30, 1e30, 1e30}, high{-1e30, -1e30, -1e30};
  };
  std::vector<Ends> ends((scene.vertex_count() - first) / count);
  for (const auto& tile : scene.tiles()) {
    if (tile->child_mask != 0) continue;
    const TileLattice lattice = tile_lattice(*tile, scene.suggested_position_step_m()).value();
    for (std::size_t v = 0; v < tile->positions.size(); ++v) {
      if (tile->source_vertex[v] < first) continue;
      Ends& of_run = ends[(tile->source_vertex[v] - first) / count];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double at = double{lattice.origin_m[axis] + static_cast<float>(lattice.points[v][axis]) * lattice.step_m};
        of_run.low[axis] = std::min(of_run.low[axis], at);
        of_run.high[axis] = std::max(of_run.high[axis], at);
      }
    }
  }
  std::vector<std::array<double, 3>> sides;
  for (const auto& [low, high] : ends) sides.push_back({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  return sides;
}

TEST(PositionSteps, KeepBoxesThatStandOnEachOther) {
  Parts parts;
  parts.grid(80, 80, {0, 0, 0}, {6.25F, 0, 0}, {0, 6.25F, 0}, [](int x, int y) { return 0.3 * std::sin(x + 0.7 * y); });
  const auto first = static_cast<std::uint32_t>(parts.positions.size());
  const auto at = [](double start, double step, int k) { return static_cast<float>(start + step * k); };
  for (int k = 0; k < 40; ++k) {
    parts.box({at(100, 0.3, k), 100, at(5, 0.17, k)}, {at(100, 0.3, k + 1), 102, at(5, 0.17, k + 1)});
  }
  const auto scene = scene_of(parts.mesh());
  const auto sides = drawn_sides(*scene, first, 8);
  ASSERT_EQ(sides.size(), 40U);
  for (const auto& side : sides) {
    EXPECT_NEAR(side[0], 0.3, 0.03);
    EXPECT_NEAR(side[1], 2, 0.2);
    EXPECT_NEAR(side[2], 0.17, 0.017);
  }
}

TEST(PositionSteps, KeepTheThicknessOfThinPlates) {
  Parts parts;
  parts.grid(80, 80, {0, 0, 0}, {6.25F, 0, 0}, {0, 6.25F, 0}, [](int x, int y) { return 0.3 * std::sin(x + 0.7 * y); });
  const auto first = static_cast<std::uint32_t>(parts.positions.size());
  parts.box({100, 100, 2}, {110, 107, 2.001F});
  parts.box({100, 100, 1}, {200, 170, 1.01F});
  const auto sides = drawn_sides(*scene_of(parts.mesh()), first, 8);
  ASSERT_EQ(sides.size(), 2U);
  EXPECT_NEAR(sides[0][2], 0.001, 0.0001);
  EXPECT_NEAR(sides[1][2], 0.01, 0.001);
}

TEST(PositionSteps, OfASmallMeshAreNotCoarsenedByWhatIsFarAway) {
  enum class Far { Piece, Spike, Mesh };
  for (const Far what : {Far::Piece, Far::Spike, Far::Mesh}) {
    Parts parts;
    parts.grid(30, 20, {0, 0, 0}, {4.0F / 29, 0, 0}, {0, 4.0F / 19, 0},
               [](int x, int y) { return 0.2 * std::sin(x * y); });
    if (what == Far::Mesh) {
      parts.grid(10, 10, {1e7F, 0, 0}, {5000, 0, 0}, {0, 5000, 0}, [](int, int) { return 0; });
    } else {
      const std::uint32_t far = parts.add(1e7, 0, 0);
      if (what == Far::Spike) {
        parts.triangles.push_back({0, 1, far});
      } else {
        parts.triangles.push_back({far, parts.add(1e7, 1, 0), parts.add(1e7, 0, 1)});
      }
    }
    files::LoadedScene loaded;
    loaded.mesh = parts.mesh();
    loaded.core_bounds = mesh::stray_points(loaded.mesh.positions(), loaded.mesh.triangles()).core;
    jobs::WorkerPool pool(2);
    map::SceneStore scenes;
    const auto scene = scenes.replace(std::move(loaded), pool, map::LevelsOfDetail::All);
    double coarsest_m = 0;
    for (const auto& tile : scene->tiles()) {
      if (tile->child_mask != 0 || tile->bounds.max.x > 100) continue;
      coarsest_m = double{tile_lattice(*tile, scene->suggested_position_step_m()).value().coarsest_step_m};
    }
    EXPECT_GT(coarsest_m, 0) << "the small mesh has a tile of its own";
    EXPECT_LT(coarsest_m, 0.02);
  }
}

TEST(PositionSteps, KeepTheReliefOfAFlatCountry) {
  Parts parts;
  parts.grid(40, 40, {0, 0, 0}, {846, 0, 0}, {0, 846, 0},
             [](int x, int y) { return 0.25 * std::sin(x * 0.5 + y * 0.7); });
  expect_kept(parts.mesh());
  parts.triangles.clear();
  expect_kept(parts.mesh());
  // Noise of floats that were turned is none.
  Parts floor;
  std::mt19937 random(3);
  std::uniform_real_distribution<float> noise(-1e-6F, 1e-6F);
  floor.grid(120, 120, {10, 10, 0}, {0.1F, 0, 0}, {0, 0.1F, 0}, [&](int, int) { return double{noise(random)}; });
  const auto scene = scene_of(floor.mesh());
  for (const auto& tile : scene->tiles()) EXPECT_TRUE(tile->step_halvings.empty());
}

TEST(PositionSteps, KeepAPieceApartAmongOthers) {
  // A winding ribbon of a millimetre, of as many vertices as are left to cells of neighbours where a floor is around them.
  for (const int pair_count : {30, 40, 100}) {
    Parts parts;
    parts.grid(60, 60, {0, 0, 0}, {0.05F, 0, 0}, {0, 0.05F, 0},
               [](int x, int y) { return 0.02 * std::sin(x * 1.3 + y * 0.7); });
    const auto first = static_cast<std::uint32_t>(parts.positions.size());
    for (int i = 0; i < pair_count; ++i) {
      const double y = 1.5 + 0.6 * std::sin(i * 0.2);
      parts.add(0.1 + 0.028 * i, y, 0.05);
      parts.add(0.1 + 0.028 * i, y + 0.001, 0.05);
    }
    for (std::uint32_t v = first; v + 2 < parts.positions.size(); ++v) parts.triangles.push_back({v, v + 1, v + 2});
    expect_kept(parts.mesh());
  }
}

/// As a server has it.
std::shared_ptr<const map::SceneSnapshot> served(const Parts& parts) {
  files::LoadedScene loaded;
  loaded.mesh = parts.mesh();
  loaded.core_bounds = mesh::stray_points(loaded.mesh.positions(), loaded.mesh.triangles()).core;
  jobs::WorkerPool pool(2);
  map::SceneStore scenes;
  return scenes.replace(std::move(loaded), pool, map::LevelsOfDetail::All);
}

TEST(PositionSteps, OfARoomAmongManyFarTrianglesKeepItsWall) {
  Parts parts;
  parts.box({0, 0, 0}, {8, 6, 3});
  parts.box({4, 0, 0}, {4.1F, 6, 3});
  parts.grid(60, 50, {0, 0, 1}, {0.136F, 0, 0}, {0, 0.122F, 0}, [](int, int) { return 0.0; });
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(-2e6, 2e6);
  for (int i = 0; i < 600; ++i) {
    const auto first = static_cast<std::uint32_t>(parts.positions.size());
    const double x = place(random), y = place(random);
    parts.add(x, y, 5);
    parts.add(x + 2, y, 5);
    parts.add(x, y + 2, 5);
    parts.triangles.push_back({first, first + 1, first + 2});
  }
  const FormReport form = form_of(*served(parts), 60);
  EXPECT_EQ(form.flattened_piece_count, 0U) << described(form);
  EXPECT_EQ(form.merged_piece_count, 0U) << described(form);
}

TEST(PositionSteps, KeepTheFormOfHousesFarFromEachOther) {
  for (const float distance_m : {5e5F, 2e6F}) {
    Parts parts;
    for (const float x : {0.0F, distance_m}) {
      parts.box({x, 0, 0}, {x + 8, 6, 3});
      parts.box({x + 4, 0, 0}, {x + 4.08F, 4, 2.5F});
      parts.box({x + 1, 1, 0}, {x + 1.4F, 1.3F, 0.3F});
    }
    const auto scene = served(parts);
    const FormReport form = form_of(*scene, 48);
    EXPECT_EQ(form.piece_count, 6U);
    EXPECT_TRUE(form.is_kept()) << distance_m << ": " << described(form);
    // What stands for both of them from afar says that it is coarser.
    const double reach_m = double{distance_m} / map::kStepsOfTile;
    EXPECT_GT(double{scene->tiles().front()->geometric_error_m}, reach_m);
  }
}

TEST(PositionSteps, KeepARoomAmongHundredsOfFarTriangles) {
  Parts parts;
  parts.box({0, 0, 0}, {8, 6, 3});
  parts.box({4, 0, 0}, {4.08F, 4, 2.5F});
  std::mt19937 random(6);
  std::uniform_real_distribution<float> anywhere(-2e6F, 2e6F);
  for (int i = 0; i < 600; ++i) {
    const float x = anywhere(random), y = anywhere(random);
    parts.triangles.push_back({parts.add(x, y, 0), parts.add(x + 1, y, 0), parts.add(x, y + 1, 0)});
  }
  const auto sides = drawn_sides(*served(parts), 8, 8);  // The wall, and then triangles.
  ASSERT_FALSE(sides.empty());
  EXPECT_NEAR(sides[0][0], 0.08, 0.008);
  EXPECT_NEAR(sides[0][1], 4, 0.4);
}

TEST(PositionSteps, KnowTheLastVerticesWhereOthersLieInTheSamePlace) {
  // Patches, and behind all of them fans of as many vertices in the first place of each.
  constexpr int kPatches = 200, kSide = 17, kFan = 100;
  Parts parts;
  for (int i = 0; i < kPatches; ++i) {
    parts.grid(kSide, kSide, {static_cast<float>(i), 0, 0}, {0.01F, 0, 0}, {0, 0.01F, 0},
               [](int column, int row) { return 0.001 * (column * row % 7); });
  }
  const auto without = scene_of(parts.mesh());
  for (int i = 0; i < kPatches; ++i) {
    const auto first = static_cast<std::uint32_t>(kSide * kSide * i);
    for (int k = 0; k < kFan; ++k) {
      const std::uint32_t v = parts.add(i, 0, 0);
      parts.triangles.push_back({v, first + 1, first + kSide});
    }
  }
  const auto with = scene_of(parts.mesh());
  EXPECT_EQ(with->vertex_count(), without->vertex_count() + kPatches * kFan);
  EXPECT_EQ(form_of(*with, 100).torn_count, 0U);
}

TEST(PositionSteps, AreNotCoarsenedByAStrayPoint) {
  mesh::MultispectralMesh cloud = spectra::testing::point_cloud(20'000, 3);
  const auto without = scene_of(spectra::testing::copy_of(cloud));
  cloud.resize_vertices(20'001);
  cloud.positions()[20'000] = {31'000, -25'000, 900};
  const auto with = scene_of(std::move(cloud));
  EXPECT_EQ(with->suggested_position_step_m(), without->suggested_position_step_m());
  const FormReport form = form_of(*with, 300);
  EXPECT_EQ(form.flattened_patch_count + form.merged_patch_count, 0u) << described(form);
}

TEST(PositionSteps, AreTheSameForAnyNumberOfThreads) {
  const mesh::MultispectralMesh cloud = spectra::testing::point_cloud(200'000, 9);
  const auto halvings = [&](unsigned thread_count) {
    jobs::WorkerPool pool(thread_count);
    const auto scene = map::SceneSnapshot::build(spectra::testing::copy_of(cloud), 1, pool);
    std::vector<map::StepHalvings> all;
    for (const auto& tile : scene->tiles())
      all.insert(all.end(), tile->step_halvings.begin(), tile->step_halvings.end());
    return all;
  };
  EXPECT_EQ(halvings(1), halvings(4));
}

}  // namespace
}  // namespace spectra::stream
