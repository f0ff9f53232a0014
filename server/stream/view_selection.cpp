#include "server/stream/view_selection.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>
#include <tuple>
#include <utility>

#include "fusion/base/vector.hpp"

namespace spectra::stream {
namespace {

using protocol::TileId;

constexpr double kViewMargin = 1.1;

// A patch of a wrong colour that is so many pixels wide is seen as much as a surface that is one pixel away.
constexpr double kDetailPixels = 2;

using Vector = base::Vec3d;

double half_height_tangent(const Camera& camera) {
  return std::tan(camera.fov_y_deg * std::numbers::pi / 360);
}

// How far the box reaches along a direction, from the eye; negative when all of it lies behind.
double reach(const Vector& direction, const Vector& eye, const base::Bounds& bounds) {
  const Vector low = point_of(bounds.min) - eye;
  const Vector high = point_of(bounds.max) - eye;
  return std::max(direction.x * low.x, direction.x * high.x) + std::max(direction.y * low.y, direction.y * high.y) +
         std::max(direction.z * low.z, direction.z * high.z);
}

bool is_finite(const base::Vec3f& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

void extend(base::Bounds& bounds, const base::Bounds& by) {
  for (const auto axis : {&base::Vec3f::x, &base::Vec3f::y, &base::Vec3f::z}) {
    bounds.min.*axis = std::min(bounds.min.*axis, by.min.*axis);
    bounds.max.*axis = std::max(bounds.max.*axis, by.max.*axis);
  }
}

// Of what a tile shows, within `bounds`: in pixels, or in metres without a camera.
double error_of(const ViewTree::Node& node, const base::Bounds& bounds, const std::optional<Camera>& camera) {
  const double error_m = seen_error_m(*node.tile);
  return camera ? screen_error(*camera, bounds, error_m) : error_m;
}

// In no order. Refines from the top, always the tile with the largest error of those reached so far.
std::vector<SelectedTile> needed_tiles(const ViewTree& tree, const std::optional<Camera>& camera, double pixel_error,
                                       std::uint64_t most_bytes) {
  const auto& nodes = tree.nodes();
  std::vector<SelectedTile> needed;
  std::uint64_t bytes = 0;
  // Places in `needed`; of equal errors the one reached first.
  std::set<std::pair<double, std::size_t>> to_refine;
  const auto add = [&](std::size_t index) {
    const ViewTree::Node& node = nodes[index];
    const bool is_in_view = !camera || may_be_in_view(*camera, node.bounds);
    const double error = error_of(node, node.bounds, camera);
    if (!node.children.empty() && is_in_view && (!camera || error > pixel_error)) {
      to_refine.emplace(-error, needed.size());
    }
    needed.push_back({.node = index, .is_target = true, .is_in_view = is_in_view});
    bytes += decoded_bytes(*node.tile);
  };
  for (std::size_t index = 0; index < nodes.size(); ++index) {
    if (!nodes[index].parent) add(index);
  }
  while (!to_refine.empty()) {
    const std::size_t place = to_refine.extract(to_refine.begin()).value().second;
    const auto& children = nodes[needed[place].node].children;
    std::uint64_t more_bytes = 0;
    for (const std::size_t child : children) more_bytes += decoded_bytes(*nodes[child].tile);
    if (more_bytes > most_bytes - std::min(bytes, most_bytes)) continue;
    needed[place].is_target = false;
    for (const std::size_t child : children) add(child);
  }
  return needed;
}

}  // namespace

ViewTree::ViewTree(const map::SceneSnapshot& scene) {
  std::map<TileId, std::size_t> node_of;
  for (const auto& tile : scene.tiles()) {
    if (tile->positions.empty()) continue;
    node_of.emplace(tile->id, nodes_.size());
    nodes_.push_back({.tile = tile, .bounds = tile->bounds, .parent = std::nullopt, .children = {}});
  }
  for (std::size_t index = 0; index < nodes_.size(); ++index) {
    TileId id = nodes_[index].tile->id;
    while (id.level > 0) {
      id = {static_cast<std::uint8_t>(id.level - 1), id.x / 2, id.y / 2, id.z / 2};
      const auto found = node_of.find(id);
      if (found == node_of.end()) continue;
      nodes_[index].parent = found->second;
      nodes_[found->second].children.push_back(index);
      break;
    }
  }
  for (std::size_t index = nodes_.size(); index-- > 0;) {
    if (nodes_[index].parent) extend(nodes_[*nodes_[index].parent].bounds, nodes_[index].bounds);
  }
}

bool is_usable(const Camera& camera) {
  return is_finite(camera.eye) && is_finite(camera.target) && is_finite(camera.up) &&
         length(point_of(camera.target) - point_of(camera.eye)) > 0 && camera.fov_y_deg > 0 && camera.fov_y_deg < 180 &&
         camera.viewport[0] > 0 && camera.viewport[1] > 0;
}

double seen_error_m(const map::Tile& tile) {
  return std::max(static_cast<double>(tile.geometric_error_m), static_cast<double>(tile.lost_detail_m) / kDetailPixels);
}

double screen_error(const Camera& camera, const base::Bounds& bounds, double size_m) {
  if (!(size_m > 0)) return 0;
  double squared = 0;
  for (const auto axis : {&base::Vec3f::x, &base::Vec3f::y, &base::Vec3f::z}) {
    const auto eye = static_cast<double>(camera.eye.*axis);
    const double outside =
        std::max({0.0, static_cast<double>(bounds.min.*axis) - eye, eye - static_cast<double>(bounds.max.*axis)});
    squared += outside * outside;
  }
  if (squared == 0) return std::numeric_limits<double>::infinity();
  return size_m * camera.viewport[1] / (2 * half_height_tangent(camera) * std::sqrt(squared));
}

bool may_be_in_view(const Camera& camera, const base::Bounds& bounds) {
  const Vector eye = point_of(camera.eye);
  Vector forward = point_of(camera.target) - eye;
  forward = forward * (1 / length(forward));
  Vector right = cross(forward, point_of(camera.up));
  if (length(right) < 1e-6) right = cross(forward, std::abs(forward.x) < 0.9 ? Vector{1, 0, 0} : Vector{0, 1, 0});
  right = right * (1 / length(right));
  const Vector up = cross(right, forward);
  const double tangent_y = kViewMargin * half_height_tangent(camera);
  const double tangent_x = tangent_y * camera.viewport[0] / camera.viewport[1];
  return reach(forward, eye, bounds) >= 0 && reach(forward * tangent_x + right, eye, bounds) >= 0 &&
         reach(forward * tangent_x - right, eye, bounds) >= 0 && reach(forward * tangent_y + up, eye, bounds) >= 0 &&
         reach(forward * tangent_y - up, eye, bounds) >= 0;
}

std::uint64_t decoded_bytes(const map::Tile& tile) {
  return std::uint64_t{16} * tile.positions.size() + std::uint64_t{12} * tile.triangles.size();
}

std::vector<SelectedTile> selected_tiles(const ViewTree& tree, const std::optional<Camera>& camera, double pixel_error,
                                         std::uint64_t most_bytes) {
  struct Candidate {
    SelectedTile tile;
    int level;
    int error_octave;
    double highest_celsius;
    auto key() const { return std::tuple(level, !tile.is_in_view, -error_octave, -highest_celsius, tile.node); }
  };
  std::vector<Candidate> candidates;
  for (const SelectedTile& tile : needed_tiles(tree, camera, pixel_error, most_bytes)) {
    const ViewTree::Node& node = tree.nodes()[tile.node];
    // What is seen while this tile is missing is its parent, with the parent's error.
    const double missing_error = node.parent ? error_of(tree.nodes()[*node.parent], node.bounds, camera)
                                             : std::numeric_limits<double>::infinity();
    const int octave = missing_error > 0 && std::isfinite(missing_error) ? std::ilogb(missing_error)
                       : missing_error > 0                               ? std::numeric_limits<int>::max()
                                                                         : -std::numeric_limits<int>::max();
    const auto celsius = static_cast<double>(node.tile->highest_celsius);
    candidates.push_back({.tile = tile,
                          .level = node.tile->id.level,
                          .error_octave = octave,
                          .highest_celsius = std::isnan(celsius) ? -std::numeric_limits<double>::infinity() : celsius});
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return a.key() < b.key(); });
  std::vector<SelectedTile> selected;
  selected.reserve(candidates.size());
  for (const Candidate& candidate : candidates) selected.push_back(candidate.tile);
  return selected;
}

}  // namespace spectra::stream
