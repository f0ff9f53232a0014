#include "fusion/mesh/nearest_vertex.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace spectra::fusion {

namespace {

constexpr std::size_t kLeafSize = 8;
constexpr std::size_t kSpacingSamples = 1024;

double coordinate(const Vec3d& p, std::uint8_t axis) {
  return axis == 0 ? p.x : axis == 1 ? p.y : p.z;
}

double squared_distance(const Vec3d& a, const Vec3d& b) {
  const double x = a.x - b.x;
  const double y = a.y - b.y;
  const double z = a.z - b.z;
  return x * x + y * y + z * z;
}

}  // namespace

struct NearestVertex::Search {
  Vec3d position;
  double best = 0;              ///< Squared.
  bool elsewhere_only = false;  ///< Points at the very position do not count.
  bool has_hit = false;
  std::uint32_t index = 0;

  void offer(const Node& node) {
    const double distance = squared_distance(node.position, position);
    if (elsewhere_only && distance == 0) return;
    if (has_hit ? distance >= best : distance > best) return;
    best = distance;
    index = node.index;
    has_hit = true;
  }
};

NearestVertex::NearestVertex(std::span<const Vec3d> points) {
  nodes_.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) nodes_.push_back({points[i], static_cast<std::uint32_t>(i), 0});
  build(0, nodes_.size());
}

void NearestVertex::build(std::size_t begin, std::size_t end) {
  if (end - begin <= kLeafSize) return;
  Vec3d min = nodes_[begin].position;
  Vec3d max = min;
  for (std::size_t i = begin; i < end; ++i) {
    const Vec3d& p = nodes_[i].position;
    min = {std::min(min.x, p.x), std::min(min.y, p.y), std::min(min.z, p.z)};
    max = {std::max(max.x, p.x), std::max(max.y, p.y), std::max(max.z, p.z)};
  }
  const std::array<double, 3> extents = {max.x - min.x, max.y - min.y, max.z - min.z};
  const auto axis = static_cast<std::uint8_t>(std::max_element(extents.begin(), extents.end()) - extents.begin());
  const std::size_t middle = begin + (end - begin) / 2;
  const auto at = [this](std::size_t i) { return nodes_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end), [axis](const Node& a, const Node& b) {
    return coordinate(a.position, axis) < coordinate(b.position, axis);
  });
  nodes_[middle].split_axis = axis;
  build(begin, middle);
  build(middle + 1, end);
}

void NearestVertex::search(std::size_t begin, std::size_t end, Search& search) const {
  if (end - begin <= kLeafSize) {
    for (std::size_t i = begin; i < end; ++i) search.offer(nodes_[i]);
    return;
  }
  const std::size_t middle = begin + (end - begin) / 2;
  const Node& node = nodes_[middle];
  search.offer(node);
  const double offset = coordinate(search.position, node.split_axis) - coordinate(node.position, node.split_axis);
  const bool is_below = offset < 0;
  this->search(is_below ? begin : middle + 1, is_below ? middle : end, search);
  // Strict once there is a hit: many points at one place must not all be visited.
  const bool reaches_over = offset * offset < search.best || (!search.has_hit && offset * offset <= search.best);
  if (reaches_over) this->search(is_below ? middle + 1 : begin, is_below ? end : middle, search);
}

std::optional<NearestVertex::Hit> NearestVertex::find(const Vec3d& position, double max_distance) const {
  Search state{position, max_distance * max_distance};
  search(0, nodes_.size(), state);
  if (!state.has_hit) return std::nullopt;
  return Hit{state.index, std::sqrt(state.best)};
}

double NearestVertex::median_spacing() const {
  std::vector<double> spacings;
  const std::size_t step = std::max<std::size_t>(1, nodes_.size() / kSpacingSamples);
  for (std::size_t i = 0; i < nodes_.size(); i += step) {
    Search state{nodes_[i].position, std::numeric_limits<double>::infinity(), true};
    search(0, nodes_.size(), state);
    if (state.has_hit) spacings.push_back(std::sqrt(state.best));
  }
  if (spacings.empty()) return 0;
  const auto middle = spacings.begin() + static_cast<std::ptrdiff_t>(spacings.size() / 2);
  std::nth_element(spacings.begin(), middle, spacings.end());
  return *middle;
}

}  // namespace spectra::fusion
