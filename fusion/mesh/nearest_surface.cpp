#include "fusion/mesh/nearest_surface.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fusion/base/box.hpp"
#include "fusion/base/vector.hpp"

namespace spectra::mesh {

namespace {

using base::difference;
using base::dot;
using base::Vector;
using base::vector_of;

constexpr std::size_t kLeafSize = 4;
constexpr std::size_t kSpacingSamples = 1024;
/// Halving a range of 2^32 elements is at most this deep.
constexpr std::size_t kMostWaiting = 64;

double squared_distance_to_box(const Vector& p, const base::Bounds& box) {
  const Vector low = vector_of(box.min);
  const Vector high = vector_of(box.max);
  double sum = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double outside = std::max({0.0, low[axis] - p[axis], p[axis] - high[axis]});
    sum += outside * outside;
  }
  return sum;
}

/// Whether all that is in the box is at the position.
bool is_at(const Vector& p, const base::Bounds& box) {
  return vector_of(box.min) == p && vector_of(box.max) == p;
}

float coordinate(const base::Vec3f& p, std::size_t axis) {
  return axis == 0 ? p.x : axis == 1 ? p.y : p.z;
}

double median(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Weights of the point nearest to the origin of a triangle whose corners are given relative to it.
Vector weights_nearest_to_origin(const std::array<Vector, 3>& corner) {
  // Above the inside the foot of the perpendicular is the answer, elsewhere the nearest point of the three edges.
  const Vector u = difference(corner[1], corner[0]);
  const Vector v = difference(corner[2], corner[0]);
  const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), uw = -dot(u, corner[0]), vw = -dot(v, corner[0]);
  const double area = uu * vv - uv * uv;
  if (area > 0) {
    const double s = (vv * uw - uv * vw) / area;
    const double t = (uu * vw - uv * uw) / area;
    if (s >= 0 && t >= 0 && s + t <= 1) return {1 - s - t, s, t};
  }
  Vector best{};
  double best_squared = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const Vector edge = difference(corner[j], corner[i]);
    const double length = dot(edge, edge);
    const double t = length > 0 ? std::clamp(-dot(corner[i], edge) / length, 0.0, 1.0) : 0.0;
    const Vector foot{corner[i][0] + t * edge[0], corner[i][1] + t * edge[1], corner[i][2] + t * edge[2]};
    const double squared = dot(foot, foot);
    if (squared >= best_squared) continue;
    best_squared = squared;
    best = {};
    best[i] = 1 - t;
    best[j] = t;
  }
  return best;
}

}  // namespace

std::array<double, 3> nearest_on_triangle(const base::Vec3f& p, const base::Vec3f& a, const base::Vec3f& b,
                                          const base::Vec3f& c) {
  const Vector place = vector_of(p);
  return weights_nearest_to_origin(
      {difference(vector_of(a), place), difference(vector_of(b), place), difference(vector_of(c), place)});
}

NearestSurface::NearestSurface(std::span<const base::Vec3f> positions, std::span<const base::Triangle> triangles)
    : positions_(positions), triangles_(triangles) {
  std::vector<bool> is_used(positions.size());
  std::vector<base::Vec3f> centres;
  centres.reserve(triangles.size());
  for (const base::Triangle& triangle : triangles) {
    Vector sum{};
    for (const std::uint32_t corner : triangle) {
      is_used[corner] = true;
      const Vector p = vector_of(positions[corner]);
      for (std::size_t axis = 0; axis < 3; ++axis) sum[axis] += p[axis] / 3;
    }
    centres.push_back({static_cast<float>(sum[0]), static_cast<float>(sum[1]), static_cast<float>(sum[2])});
  }
  for (std::uint32_t t = 0; t < triangles.size(); ++t) elements_.push_back(t);
  // Centres are found by element, and those of vertices of no triangle are the vertices.
  for (std::size_t v = 0; v < positions.size(); ++v) {
    if (!is_used[v]) elements_.push_back(static_cast<std::uint32_t>(triangles.size() + v));
  }
  if (elements_.empty()) return;
  nodes_.reserve(elements_.size());
  build(centres, 0, elements_.size());
}

base::Triangle NearestSurface::corners(std::uint32_t element) const {
  if (element < triangles_.size()) return triangles_[element];
  const auto vertex = static_cast<std::uint32_t>(element - triangles_.size());
  return {vertex, vertex, vertex};
}

std::uint32_t NearestSurface::build(std::span<const base::Vec3f> centres, std::size_t begin, std::size_t end) {
  const auto centre = [&](std::uint32_t element) -> const base::Vec3f& {
    return element < centres.size() ? centres[element] : positions_[element - centres.size()];
  };
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  if (end - begin <= kLeafSize) {
    base::Bounds box{positions_[corners(elements_[begin])[0]], positions_[corners(elements_[begin])[0]]};
    for (std::size_t i = begin; i < end; ++i) {
      for (const std::uint32_t corner : corners(elements_[i])) include(box, positions_[corner]);
    }
    nodes_[index] = {box, static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end - begin)};
    return index;
  }
  base::Bounds spread{centre(elements_[begin]), centre(elements_[begin])};
  for (std::size_t i = begin; i < end; ++i) include(spread, centre(elements_[i]));
  const std::array<double, 3> extents = {static_cast<double>(spread.max.x) - static_cast<double>(spread.min.x),
                                         static_cast<double>(spread.max.y) - static_cast<double>(spread.min.y),
                                         static_cast<double>(spread.max.z) - static_cast<double>(spread.min.z)};
  const auto axis = static_cast<std::size_t>(std::max_element(extents.begin(), extents.end()) - extents.begin());
  const std::size_t middle = begin + (end - begin) / 2;
  const auto at = [this](std::size_t i) { return elements_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end), [&](std::uint32_t a, std::uint32_t b) {
    return coordinate(centre(a), axis) < coordinate(centre(b), axis);
  });
  build(centres, begin, middle);
  const std::uint32_t second = build(centres, middle, end);
  base::Bounds box = nodes_[index + 1].box;
  include(box, nodes_[second].box.min);
  include(box, nodes_[second].box.max);
  nodes_[index] = {box, second, 0};
  return index;
}

void NearestSurface::offer(std::uint32_t element, Search& search) const {
  const base::Triangle indices = corners(element);
  std::array<Vector, 3> corner{};
  for (std::size_t k = 0; k < 3; ++k) corner[k] = difference(vector_of(positions_[indices[k]]), search.position);
  const bool is_point = indices[0] == indices[1];
  const Vector weights = is_point ? Vector{1, 0, 0} : weights_nearest_to_origin(corner);
  Vector foot{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    foot[axis] = weights[0] * corner[0][axis] + weights[1] * corner[1][axis] + weights[2] * corner[2][axis];
  }
  const double squared = dot(foot, foot);
  if (search.elsewhere_only && squared == 0) return;
  if (search.has_hit ? squared >= search.best_squared : squared > search.best_squared) return;
  search.best_squared = squared;
  search.has_hit = true;
  search.element = element;
  search.weights = weights;
}

bool NearestSurface::search(Search& search) const {
  if (nodes_.empty()) return true;
  const auto squared_distance_to = [&](std::uint32_t node) {
    const base::Bounds& box = nodes_[node].box;
    if (search.elsewhere_only && is_at(search.position, box)) return std::numeric_limits<double>::infinity();
    return squared_distance_to_box(search.position, box);
  };
  std::uint32_t leaf_count = 0;
  std::array<std::pair<double, std::uint32_t>, kMostWaiting> waiting;
  std::size_t waiting_count = 0;
  waiting[waiting_count++] = {squared_distance_to(0), 0};
  while (waiting_count > 0) {
    auto [box_squared, index] = waiting[--waiting_count];
    // Strict once there is a hit: many elements at one place must not all be visited.
    if (search.has_hit ? box_squared >= search.best_squared : box_squared > search.best_squared) continue;
    while (nodes_[index].count == 0) {
      std::uint32_t near = index + 1;
      std::uint32_t far = nodes_[index].first;
      double near_squared = squared_distance_to(near);
      double far_squared = squared_distance_to(far);
      if (far_squared < near_squared) {
        std::swap(near, far);
        std::swap(near_squared, far_squared);
      }
      waiting[waiting_count++] = {far_squared, far};
      index = near;
      box_squared = near_squared;
    }
    if (search.has_hit ? box_squared >= search.best_squared : box_squared > search.best_squared) continue;
    if (search.most_leaves > 0 && leaf_count++ == search.most_leaves) return false;
    const Node& leaf = nodes_[index];
    for (std::uint32_t i = leaf.first; i < leaf.first + leaf.count; ++i) offer(elements_[i], search);
  }
  return true;
}

NearestSurface::Hit NearestSurface::hit_of(const Search& search) const {
  return {corners(search.element), search.weights, std::sqrt(search.best_squared)};
}

std::optional<NearestSurface::Hit> NearestSurface::find(const base::Vec3f& position, double max_distance) const {
  Search state;
  state.position = vector_of(position);
  state.best_squared = max_distance * max_distance;
  search(state);
  return state.has_hit ? std::optional(hit_of(state)) : std::nullopt;
}

double median_edge(std::span<const base::Vec3f> positions, std::span<const base::Triangle> triangles) {
  std::vector<double> edges;
  const std::size_t step = std::max<std::size_t>(1, triangles.size() / kSpacingSamples);
  for (std::size_t t = 0; t < triangles.size(); t += step) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector edge =
          difference(vector_of(positions[triangles[t][i]]), vector_of(positions[triangles[t][(i + 1) % 3]]));
      if (dot(edge, edge) > 0) edges.push_back(std::sqrt(dot(edge, edge)));
    }
  }
  return median(edges);
}

double NearestSurface::median_spacing() const {
  if (!triangles_.empty()) return median_edge(positions_, triangles_);
  std::vector<double> spacings;
  const std::size_t step = std::max<std::size_t>(1, positions_.size() / kSpacingSamples);
  for (std::size_t v = 0; v < positions_.size(); v += step) {
    Search state;
    state.position = vector_of(positions_[v]);
    state.best_squared = std::numeric_limits<double>::max();  // nearer than what is left out
    state.elsewhere_only = true;
    search(state);
    if (state.has_hit) spacings.push_back(std::sqrt(state.best_squared));
  }
  return median(spacings);
}

}  // namespace spectra::mesh
