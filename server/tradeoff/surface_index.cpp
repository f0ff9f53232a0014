#include "server/tradeoff/surface_index.hpp"

#include <algorithm>
#include <boost/geometry.hpp>
#include <boost/geometry/geometries/box.hpp>
#include <boost/geometry/geometries/point.hpp>
#include <boost/geometry/index/rtree.hpp>
#include <cmath>
#include <limits>
#include <utility>

namespace spectra::tradeoff {

namespace {

namespace bg = boost::geometry;
using Point = bg::model::point<float, 3, bg::cs::cartesian>;
using Box = bg::model::box<Point>;
using Entry = std::pair<Box, std::uint32_t>;
using Tree = bg::index::rtree<Entry, bg::index::rstar<16>>;
using Vec = std::array<double, 3>;

Vec to_vec(base::Vec3f p) {
  return {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
}

double squared_distance(const Vec& p, const std::array<Vec, 3>& corners, const std::array<double, 3>& weights) {
  double sum = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double at = weights[0] * corners[0][axis] + weights[1] * corners[1][axis] + weights[2] * corners[2][axis];
    sum += (p[axis] - at) * (p[axis] - at);
  }
  return sum;
}

}  // namespace

struct SurfaceIndex::State {
  std::vector<base::Vec3f> positions;
  std::vector<base::Triangle> triangles;
  Tree tree;

  std::array<base::Vec3f, 3> corners(std::uint32_t index) const {
    if (triangles.empty()) return {positions[index], positions[index], positions[index]};
    const base::Triangle& t = triangles[index];
    return {positions[t[0]], positions[t[1]], positions[t[2]]};
  }
};

SurfaceIndex::SurfaceIndex(std::vector<base::Vec3f> positions, std::vector<base::Triangle> triangles)
    : state_(std::make_unique<State>()) {
  state_->positions = std::move(positions);
  state_->triangles = std::move(triangles);
  const std::size_t count = state_->triangles.empty() ? state_->positions.size() : state_->triangles.size();
  std::vector<Entry> entries;
  entries.reserve(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto [a, b, c] = state_->corners(i);
    const Point low(std::min({a.x, b.x, c.x}), std::min({a.y, b.y, c.y}), std::min({a.z, b.z, c.z}));
    const Point high(std::max({a.x, b.x, c.x}), std::max({a.y, b.y, c.y}), std::max({a.z, b.z, c.z}));
    entries.emplace_back(Box(low, high), i);
  }
  state_->tree = Tree(entries);
}

SurfaceIndex::~SurfaceIndex() = default;

bool SurfaceIndex::empty() const {
  return state_->tree.empty();
}

SurfacePoint SurfaceIndex::nearest(base::Vec3f place) const {
  const Point point(place.x, place.y, place.z);
  SurfacePoint best;
  double best_distance = std::numeric_limits<double>::infinity();
  // Boxes come in the order of their distance: once a box is farther than the best triangle, none can be nearer.
  const auto all = static_cast<unsigned>(state_->tree.size());
  for (auto entry = state_->tree.qbegin(bg::index::nearest(point, all)); entry != state_->tree.qend(); ++entry) {
    const double box_distance = static_cast<double>(bg::comparable_distance(point, entry->first));
    if (box_distance > best_distance) break;
    const auto corners = state_->corners(entry->second);
    const auto weights = mesh::nearest_on_triangle(place, corners[0], corners[1], corners[2]);
    const double distance =
        squared_distance(to_vec(place), {to_vec(corners[0]), to_vec(corners[1]), to_vec(corners[2])}, weights);
    if (distance < best_distance) {
      best_distance = distance;
      best = {entry->second, weights, std::sqrt(distance)};
    }
  }
  return best;
}

}  // namespace spectra::tradeoff
