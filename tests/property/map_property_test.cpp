// Whatever is put into a map and taken out of it, in any order and batch: it is the map that is built at once of the blocks that are in
// it in the end.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "server/map/coarse_tile.hpp"
#include "server/map/living_map.hpp"
#include "server/map/tile_place.hpp"

namespace spectra::map {
namespace {

using base::Vec3f;
using protocol::TileId;

constexpr std::uint32_t kLeafSize = 200;

/// A patch of a raster of a metre: blocks beside each other share the vertices of their border.
struct Patch {
  int column = 0, row = 0;  ///< In patches of 16 x 16.
  int side = 17;
  float height = 0;
  float celsius = 20;
  int lone_count = 0;
};

files::LoadedScene scene_of(const Patch& patch) {
  files::LoadedScene scene;
  mesh::MultispectralMesh& mesh = scene.mesh;
  const auto side = static_cast<std::size_t>(patch.side);
  const auto lone = static_cast<std::size_t>(patch.lone_count);
  mesh.resize_vertices(side * side + lone);
  mesh.has_visible = mesh.has_temperature = true;
  for (std::size_t v = 0; v < side * side; ++v) {
    const float x = static_cast<float>(16 * patch.column) + static_cast<float>(v % side);
    const float y = static_cast<float>(16 * patch.row) + static_cast<float>(v / side);
    mesh.positions()[v] = {x, y, patch.height + std::sin(x / 5) * std::cos(y / 4)};
    mesh.visible()[v] = {static_cast<std::uint8_t>(v % 251), static_cast<std::uint8_t>(patch.column * 7), 90};
    mesh.temperature_celsius()[v] =
        v % 29 == 3 ? std::numeric_limits<float>::quiet_NaN() : patch.celsius + std::sin(static_cast<float>(v));
  }
  for (std::size_t v = 0; v < lone; ++v) {
    mesh.positions()[side * side + v] = {static_cast<float>(16 * patch.column) + 0.5f * static_cast<float>(v), 3, 1};
  }
  for (std::size_t row = 0; row + 1 < side; ++row) {
    for (std::size_t column = 0; column + 1 < side; ++column) {
      const auto a = static_cast<std::uint32_t>(row * side + column), b = a + static_cast<std::uint32_t>(side);
      mesh.triangles().push_back({a, a + 1, b});
      mesh.triangles().push_back({a + 1, b + 1, b});
    }
  }
  return scene;
}

rc::Gen<Patch> patches() {
  return rc::gen::map(
      rc::gen::tuple(rc::gen::inRange(-3, 6), rc::gen::inRange(-3, 6), rc::gen::inRange(2, 24), rc::gen::inRange(0, 3),
                     rc::gen::inRange(-20, 60), rc::gen::inRange(0, 30), rc::gen::inRange(0, 40)),
      [](const auto& t) {
        const auto& [column, row, side, height, celsius, lone, far] = t;
        Patch patch{column,
                    row,
                    side > 17 ? 17 : side,
                    static_cast<float>(height),
                    static_cast<float>(celsius),
                    lone > 20 ? lone - 20 : 0};
        // Far outside of where the map began.
        if (far == 0) patch.column += 5000;
        return patch;
      });
}

std::string name_of(int number) {
  return std::string(1, static_cast<char>('a' + number));
}

using Place = std::tuple<float, float, float>;
Place place(const base::Vec3f& p) {
  return {p.x, p.y, p.z};
}

bool same(std::span<const float> a, std::span<const float> b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](float x, float y) { return x == y || (std::isnan(x) && std::isnan(y)); });
}

void expect_same_full_accuracy(const SceneSnapshot& a, const SceneSnapshot& b) {
  RC_ASSERT(a.vertex_count() == b.vertex_count());
  RC_ASSERT(a.triangle_count() == b.triangle_count());
  const mesh::MultispectralMesh one = a.whole_mesh(), other = b.whole_mesh();
  RC_ASSERT(std::ranges::equal(one.positions(), other.positions()));
  RC_ASSERT(std::ranges::equal(one.visible(), other.visible()));
  RC_ASSERT(same(one.temperature_celsius(), other.temperature_celsius()));
  RC_ASSERT(one.triangles() == other.triangles());
  const auto &x = a.temperature().summary, &y = b.temperature().summary;
  RC_ASSERT(x.finite_count == y.finite_count);
  RC_ASSERT(x.missing_count == y.missing_count);
  RC_ASSERT(x.minimum == y.minimum);
  RC_ASSERT(x.maximum == y.maximum);
  RC_ASSERT(x.mean == y.mean);
  RC_ASSERT(x.sigma == y.sigma);
  RC_ASSERT(a.temperature().histogram(fusion::kPercentileBins).counts ==
            b.temperature().histogram(fusion::kPercentileBins).counts);
  RC_ASSERT(a.bounds() == b.bounds());
  RC_ASSERT(a.tiles().size() == b.tiles().size());
  for (std::size_t i = 0; i < a.tiles().size(); ++i) {
    const Tile &tile = *a.tiles()[i], &its = *b.tiles()[i];
    RC_ASSERT(tile.id == its.id);
    RC_ASSERT(tile.child_mask == its.child_mask);
    if (tile.child_mask != 0) continue;
    RC_ASSERT(tile.owned_count == its.owned_count);
    RC_ASSERT(tile.positions == its.positions);
    RC_ASSERT(tile.visible == its.visible);
    RC_ASSERT(same(tile.temperature_celsius, its.temperature_celsius));
    RC_ASSERT(tile.triangles == its.triangles);
    RC_ASSERT(tile.source_vertex == its.source_vertex);
    RC_ASSERT(tile.source_triangle == its.source_triangle);
  }
}

/// Errors rise, extremes are there, and what two tiles share both have as it is in the full mesh.
void expect_promises(const SceneSnapshot& scene) {
  std::map<TileId, const Tile*> tiles;
  for (const auto& tile : scene.tiles()) tiles[tile->id] = tile.get();
  std::map<TileId, std::set<Place>> places;
  std::map<Place, std::vector<TileId>> holders;
  for (const auto& [id, tile] : tiles) {
    for (const base::Vec3f& p : tile->positions) places[id].insert(place(p));
    if (tile->child_mask == 0) {
      for (const base::Vec3f& p : open_positions(*tile)) holders[place(p)].push_back(id);
      continue;
    }
    float lowest = std::numeric_limits<float>::quiet_NaN(), highest = lowest;
    for (unsigned octant = 0; octant < 8; ++octant) {
      const auto child = tiles.find(child_of(id, octant));
      RC_ASSERT((child != tiles.end()) == ((tile->child_mask >> octant & 1) != 0));
      if (child == tiles.end()) continue;
      RC_ASSERT(tile->geometric_error_m >= child->second->geometric_error_m);
      lowest = std::fmin(lowest, child->second->lowest_celsius);
      highest = std::fmax(highest, child->second->highest_celsius);
    }
    RC_ASSERT(same({&tile->lowest_celsius, 1}, {&lowest, 1}));
    RC_ASSERT(same({&tile->highest_celsius, 1}, {&highest, 1}));
    if (std::isnan(lowest)) continue;
    const auto& shown = tile->temperature_celsius;
    RC_ASSERT(std::find(shown.begin(), shown.end(), lowest) != shown.end());
    RC_ASSERT(std::find(shown.begin(), shown.end(), highest) != shown.end());
  }
  for (const auto& [position, leaves] : holders) {
    TileId common = leaves.front();
    for (const TileId& leaf : leaves) common = common_ancestor(common, leaf);
    for (TileId id : leaves) {
      while (id.level > common.level + 1) {
        id = parent_of(id);
        if (tiles.contains(id)) RC_ASSERT(places[id].contains(position));
      }
    }
  }
}

/// Every tile is in the mask of the one above it, and the other way round: a viewer replaces a tile by all of its children.
void expect_all_are_there(const SceneSnapshot& scene) {
  std::set<TileId> ids;
  for (const auto& tile : scene.tiles()) ids.insert(tile->id);
  for (const auto& tile : scene.tiles()) {
    for (unsigned octant = 0; octant < 8; ++octant) {
      RC_ASSERT(ids.contains(child_of(tile->id, octant)) == ((tile->child_mask >> octant & 1) != 0));
    }
    RC_ASSERT((tile->child_mask == 0) == (tile->geometric_error_m == 0));
  }
}

RC_GTEST_PROP(LivingMap, IsTheMapThatIsBuiltAtOnce, ()) {
  jobs::WorkerPool pool(2);
  // Of one block leaves may be larger than elsewhere.
  const LivingMap::Options options{.leaf_vertex_count = kLeafSize,
                                   .settled_block = *rc::gen::element(std::string(), name_of(0), name_of(1)),
                                   .first_level = *rc::gen::element(6, 9, 12)};
  LivingMap map(options);
  std::map<std::string, Patch> in_it;
  const int steps = *rc::gen::inRange(1, 9);
  std::shared_ptr<const SceneSnapshot> scene;
  std::uint32_t revision = 0;
  for (int step = 0; step < steps; ++step) {
    MapChange change;
    std::set<std::string> named;
    const int count = *rc::gen::inRange(1, 5);
    for (int i = 0; i < count; ++i) {
      const std::string id = name_of(*rc::gen::inRange(0, 12));
      if (!named.insert(id).second) continue;
      if (!in_it.empty() && *rc::gen::inRange(0, 3) == 0) {
        change.removed.push_back(id);
        in_it.erase(id);
      } else {
        const Patch patch = *patches();
        change.put.push_back({.id = id, .scene = scene_of(patch), .observed_at = {}});
        in_it[id] = patch;
      }
    }
    const std::uint64_t expected = [&] {
      std::uint64_t sum = 0;
      for (const auto& [id, patch] : in_it)
        sum += static_cast<std::uint64_t>(patch.side * patch.side + patch.lone_count);
      return sum;
    }();
    scene = map.apply(std::move(change), ++revision, pool);
    RC_ASSERT(scene->vertex_count() == expected);
    expect_all_are_there(*scene);
    // Coarse tiles follow, while the map may change again.
    const int followed = *rc::gen::inRange(0, 12);
    for (int i = 0; i < followed; ++i) {
      auto work = map.next_coarse();
      if (!work) break;
      work->run();
      if (auto next = map.take_coarse(*work, ++revision)) scene = std::move(next);
      expect_all_are_there(*scene);
    }
    if (!map.is_behind()) expect_promises(*scene);
  }
  while (auto work = map.next_coarse()) {
    work->run();
    if (auto next = map.take_coarse(*work, ++revision)) scene = std::move(next);
  }
  expect_promises(*scene);
  if (!map.constants()) return;
  LivingMap at_once(options, map.constants());
  MapChange all;
  for (const auto& [id, patch] : in_it) all.put.push_back({.id = id, .scene = scene_of(patch), .observed_at = {}});
  const auto whole = at_once.apply(std::move(all), 1, pool);
  expect_same_full_accuracy(*scene, *whole);
}

/// A block as the plain rule has it: what each of its vertices is compared with, and since when.
struct ModelBlock {
  files::LoadedScene scene;
  double observed_at = 0;
  std::vector<float> baseline;
  std::vector<double> baseline_at;
};
using Model = std::map<std::string, ModelBlock>;

/// Puts a block: by place it takes over the baseline of the one of its name.
void put(Model& model, const std::string& id, const Patch& patch, double observed_at, double reach_m) {
  ModelBlock block{scene_of(patch), observed_at, {}, {}};
  const auto& mesh = block.scene.mesh;
  const auto before = model.find(id);
  for (std::size_t v = 0; v < mesh.vertex_count(); ++v) {
    float baseline = mesh.temperature_celsius()[v];
    double at = observed_at;
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t from = 0;
    for (std::size_t w = 0; before != model.end() && w < before->second.baseline.size(); ++w) {
      const base::Vec3f &a = mesh.positions()[v], &b = before->second.scene.mesh.positions()[w];
      const double dx = double{a.x} - double{b.x}, dy = double{a.y} - double{b.y}, dz = double{a.z} - double{b.z};
      const double squared = dx * dx + dy * dy + dz * dz;
      if (squared < nearest) from = w;
      nearest = std::min(nearest, squared);
    }
    if (nearest <= reach_m * reach_m && !std::isnan(before->second.baseline[from])) {
      baseline = before->second.baseline[from];
      at = before->second.baseline_at[from];
    }
    block.baseline.push_back(baseline);
    block.baseline_at.push_back(at);
  }
  model.insert_or_assign(id, std::move(block));
}

/// The same place or nearly, measured anew; or another one.
Patch again(const Patch& patch) {
  if (*rc::gen::inRange(0, 4) == 0) return *patches();
  Patch next = patch;
  next.celsius += static_cast<float>(*rc::gen::inRange(-3, 4));
  next.height += 0.25F * static_cast<float>(*rc::gen::inRange(0, 12));
  if (*rc::gen::inRange(0, 3) == 0) next.side = *rc::gen::inRange(2, 18);
  return next;
}

void expect_remembered(const SceneSnapshot& scene, const Model& model) {
  const std::vector<float> baseline = scene.whole_baseline();
  std::vector<float> expected;
  std::vector<double> expected_at, seen_at;
  for (const auto& [id, block] : model) {
    expected.insert(expected.end(), block.baseline.begin(), block.baseline.end());
    expected_at.insert(expected_at.end(), block.baseline_at.begin(), block.baseline_at.end());
    seen_at.insert(seen_at.end(), block.baseline.size(), block.observed_at);
  }
  RC_ASSERT(same(baseline, expected));
  std::size_t known = 0;
  for (const auto& tile : scene.tiles()) {
    if (tile->child_mask != 0) continue;
    for (std::size_t v = 0; v < tile->owned_count; ++v) {
      RC_ASSERT(tile->seen_at.at(v) == seen_at[scene.vertex_index(*tile, v)]);
    }
    // Some vertices are looked at as a viewer would.
    const auto probe = scene.probe(tile->positions[++known % tile->positions.size()]);
    RC_ASSERT(probe.has_value() && probe->observed_at == seen_at[probe->vertex_index]);
    const float its = expected[probe->vertex_index];
    RC_ASSERT(probe->baseline_celsius.has_value() == !std::isnan(its));
    if (std::isnan(its)) continue;
    RC_ASSERT(*probe->baseline_celsius == its);
    RC_ASSERT(probe->baseline_at == expected_at[probe->vertex_index]);
  }
}

RC_GTEST_PROP(LivingMap, RemembersAsThePlainRuleSays, ()) {
  jobs::WorkerPool pool(2);
  LivingMap map({.leaf_vertex_count = kLeafSize, .first_level = 6, .remembers = true});
  Model model;
  std::map<std::string, Patch> in_it;
  double now = 1000;
  std::uint32_t revision = 0;
  std::shared_ptr<const SceneSnapshot> scene;
  const int steps = *rc::gen::inRange(1, 10);
  for (int step = 0; step < steps; ++step) {
    now += 1;
    if (scene && *rc::gen::inRange(0, 5) == 0) {
      scene = map.mark_baseline(now, ++revision);
      for (auto& [id, block] : model) {
        const auto celsius = block.scene.mesh.temperature_celsius();
        block.baseline.assign(celsius.begin(), celsius.end());
        block.baseline_at.assign(celsius.size(), now);
      }
      RC_ASSERT(scene->baseline_marked_at() == now);
    } else {
      const double reach_m = map.constants() ? kHandedOnSteps * double{map.constants()->position_step_m} : 0;
      MapChange change;
      std::set<std::string> named;
      const int count = *rc::gen::inRange(1, 4);
      for (int i = 0; i < count; ++i) {
        const std::string id = name_of(*rc::gen::inRange(0, 4));
        if (!named.insert(id).second) continue;
        if (in_it.contains(id) && *rc::gen::inRange(0, 5) == 0) {
          change.removed.push_back(id);
          in_it.erase(id);
          model.erase(id);
          continue;
        }
        const Patch patch = in_it.contains(id) ? again(in_it[id]) : *patches();
        const double observed_at = now - *rc::gen::inRange(0, 3);
        change.put.push_back({.id = id, .scene = scene_of(patch), .observed_at = observed_at});
        put(model, id, patch, observed_at, reach_m);
        in_it[id] = patch;
      }
      scene = map.apply(std::move(change), ++revision, pool);
    }
    expect_remembered(*scene, model);
    const int followed = *rc::gen::inRange(0, 6);
    for (int i = 0; i < followed; ++i) {
      auto work = map.next_coarse();
      if (!work) break;
      work->run();
      if (auto next = map.take_coarse(*work, ++revision)) scene = std::move(next);
    }
    expect_remembered(*scene, model);
  }
}

TEST(LivingMap, ACoarseTileShowsTheMeanChangeAndTheNewestTime) {
  jobs::WorkerPool pool(2);
  LivingMap map({.leaf_vertex_count = kLeafSize, .first_level = 6, .remembers = true});
  MapChange change;
  for (int i = 0; i < 4; ++i) {
    change.put.push_back({.id = name_of(i), .scene = scene_of({.column = i, .celsius = 20}), .observed_at = 100});
  }
  static_cast<void>(map.apply(std::move(change), 1, pool));
  MapChange warmer;
  warmer.put.push_back({.id = name_of(1), .scene = scene_of({.column = 1, .celsius = 25}), .observed_at = 200});
  auto scene = map.apply(std::move(warmer), 2, pool);
  std::uint32_t revision = 2;
  while (auto work = map.next_coarse()) {
    work->run();
    if (auto next = map.take_coarse(*work, ++revision)) scene = std::move(next);
  }
  const Tile& top = *scene->tiles().front();
  ASSERT_NE(top.child_mask, 0);
  const auto baseline = baseline_of(top, scene->baseline_mark());
  int old_count = 0, new_count = 0;
  for (std::size_t v = 0; v < top.positions.size(); ++v) {
    if (std::isnan(top.temperature_celsius[v])) continue;
    const float x = top.positions[v].x;
    // Away from where the regions of vertices may hold some of both.
    if (x > 20 && x < 28) {
      EXPECT_NEAR(top.temperature_celsius[v] - baseline[v], 5, 0.01) << x;
      EXPECT_EQ(top.seen_at.at(v), 200) << x;
    }
    if (x < 10 || x > 38) {
      EXPECT_NEAR(top.temperature_celsius[v] - baseline[v], 0, 0.01) << x;
      // Of what a vertex stands for the newest counts, however little it is.
      (top.seen_at.at(v) == 100 ? old_count : new_count) += 1;
    }
  }
  EXPECT_GT(old_count, 0);
  EXPECT_GE(old_count, new_count);
  EXPECT_EQ(scene->tiles().front(), map.mark_baseline(300, ++revision)->tiles().front()) << "a mark makes no tile anew";
  const auto marked = baseline_of(top, map.baseline_mark().number);
  EXPECT_TRUE(same(marked, top.temperature_celsius));
}

}  // namespace
}  // namespace spectra::map
