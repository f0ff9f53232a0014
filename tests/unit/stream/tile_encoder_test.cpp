#include "server/stream/tile_encoder.hpp"

#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <tuple>
#include <vector>

#include "fake_scene.hpp"
#include "protocol/codec/draco_codec.hpp"
#include "tests/unit/map/generated_scene.hpp"

namespace spectra::stream {
namespace {

using Place = std::array<float, 3>;
/// What a viewer decodes for a vertex: its colour, and its code of temperature.
using Shown = std::tuple<protocol::codec::ColourBytes, std::uint16_t>;

struct Wire {
  std::size_t bytes = 0;
  std::size_t vertex_count = 0, triangle_count = 0;
  std::map<Place, std::set<Shown>> shown;
};

/// All leaves of a scene as they are sent.
Wire wire_of(const map::SceneSnapshot& scene) {
  Wire wire;
  const fusion::FusionPlan plan = testing::plan_with_alpha(scene, 0.5);
  for (const auto& tile : scene.tiles()) {
    if (tile->child_mask != 0) continue;
    // One step for both: scenes of fewer vertices have finer ones.
    map::Tile even = *tile;
    even.step_halvings.clear();
    const EncodedTile geometry = encoded_tile(even, 0x1p-5F, 7).value();
    const Payload colours = encoded_tile_colours(*tile, geometry, plan, {}, 8, 7).value();
    const Payload temperatures = encoded_temperature_layer(*tile, geometry, 7, 0).value();
    wire.bytes += geometry.payload->size() + colours->size() + temperatures->size();
    const auto seen = protocol::codec::decoded_geometry(*geometry.payload).value();
    const auto colour = protocol::codec::decoded_colours(*colours).value();
    const auto celsius = protocol::codec::decoded_temperature_codes(*temperatures).value();
    EXPECT_EQ(seen.positions_m.size(), geometry.input_of_decoded.size());
    EXPECT_EQ(colour.size(), seen.positions_m.size());
    wire.vertex_count += seen.positions_m.size();
    wire.triangle_count += seen.triangles.size();
    for (std::size_t i = 0; i < seen.positions_m.size(); ++i) {
      Place place = seen.positions_m[i];
      for (std::size_t axis = 0; axis < 3; ++axis) place[axis] += geometry.origin_m[axis];
      wire.shown[place].insert({colour[i], celsius.codes[i]});
    }
  }
  return wire;
}

std::shared_ptr<const map::SceneSnapshot> scene_of(mesh::MultispectralMesh mesh) {
  jobs::WorkerPool pool(2);
  return map::SceneSnapshot::build(std::move(mesh), 1, pool);
}

TEST(EncodedTile, OfTrianglesThatShareNoVerticesIsAsLightAsTheSharedMesh) {
  const auto mesh = spectra::testing::terrain({.columns = 60, .rows = 60});
  const Wire shared = wire_of(*scene_of(spectra::testing::copy_of(mesh)));
  const Wire soup = wire_of(*scene_of(spectra::testing::soup_of(mesh)));
  EXPECT_LT(static_cast<double>(soup.bytes), 1.1 * static_cast<double>(shared.bytes));
  EXPECT_EQ(soup.vertex_count, shared.vertex_count);
  EXPECT_EQ(soup.triangle_count, shared.triangle_count);
  EXPECT_EQ(soup.shown, shared.shown);
}

TEST(EncodedTile, KeepsApartWhatAnythingTellsApart) {
  // Two triangles that touch in the places of two vertices.
  const auto tile = std::make_shared<map::Tile>();
  tile->positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  tile->triangles = {{0, 1, 2}, {3, 4, 5}};
  tile->visible.assign(6, {9, 9, 9});
  tile->temperature_celsius.assign(6, 20);
  const auto vertices_of = [](const map::Tile& of) {
    const auto geometry = encoded_tile(of, 0x1p-6F, 7).value();
    return std::set(geometry.input_of_decoded.begin(), geometry.input_of_decoded.end()).size();
  };
  EXPECT_EQ(vertices_of(*tile), 4U);
  const auto vertices_with = [&](const std::function<void(map::Tile&)>& change) {
    map::Tile changed = *tile;
    change(changed);
    return vertices_of(changed);
  };
  EXPECT_EQ(vertices_with([](map::Tile& t) { t.visible[3].b = 10; }), 5U);
  EXPECT_EQ(vertices_with([](map::Tile& t) { t.temperature_celsius[3] = 21; }), 5U);
  EXPECT_EQ(vertices_with([](map::Tile& t) { t.baseline_celsius = {20, 20, 20, 19, 20, 20}; }), 5U);
  EXPECT_EQ(vertices_with([](map::Tile& t) { t.sigma_kelvin = {1, 1, 1, 2, 1, 1}; }), 5U);
  EXPECT_EQ(vertices_with([](map::Tile& t) {
              t.seen_at = map::VertexTimes::of(std::vector<double>{5, 5, 5, 6, 5, 5});
            }),
            5U);
  EXPECT_EQ(vertices_with([](map::Tile& t) { t.positions[3].x = 1.25F; }), 5U);
}

}  // namespace
}  // namespace spectra::stream
