#include "fusion/mesh/point_groups.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <queue>

namespace spectra::mesh {
namespace {

using base::Vec3f;

double coordinate(const base::Vec3f& p, unsigned axis) {
  return static_cast<double>(axis == 0 ? p.x : axis == 1 ? p.y : p.z);
}

struct Group {
  double extent = 0;  ///< Along `axis`, the longest.
  double middle = 0;
  unsigned axis = 0;
  std::size_t begin = 0, end = 0;

  bool operator<(const Group& other) const {
    return extent != other.extent ? extent < other.extent : begin > other.begin;
  }
};

Group group_of(std::span<const base::Vec3f> points, std::span<const std::uint32_t> members, std::size_t begin,
               std::size_t end) {
  Group group;
  group.begin = begin;
  group.end = end;
  for (unsigned axis = 0; axis < 3; ++axis) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (std::size_t i = begin; i < end; ++i) {
      const double c = coordinate(points[members[i]], axis);
      low = std::min(low, c);
      high = std::max(high, c);
    }
    if (high - low > group.extent) {
      group.extent = high - low;
      group.middle = low + (high - low) / 2;
      group.axis = axis;
    }
  }
  return group;
}

std::uint32_t representative(std::span<const base::Vec3f> points, std::span<const std::uint32_t> members) {
  std::array<double, 3> mean{};
  for (const std::uint32_t v : members) {
    for (unsigned axis = 0; axis < 3; ++axis) mean[axis] += coordinate(points[v], axis);
  }
  for (double& c : mean) c /= static_cast<double>(members.size());
  std::uint32_t best = members[0];
  double best_squared = std::numeric_limits<double>::infinity();
  for (const std::uint32_t v : members) {
    double squared = 0;
    for (unsigned axis = 0; axis < 3; ++axis) {
      const double d = coordinate(points[v], axis) - mean[axis];
      squared += d * d;
    }
    if (squared < best_squared) {
      best_squared = squared;
      best = v;
    }
  }
  return best;
}

}  // namespace

std::vector<std::uint32_t> group_representatives(std::span<const base::Vec3f> points,
                                                 std::vector<std::uint32_t> members, std::size_t group_count) {
  std::vector<std::uint32_t> result(points.size());
  std::iota(result.begin(), result.end(), 0u);
  if (members.empty()) return result;
  std::priority_queue<Group> groups;
  groups.push(group_of(points, members, 0, members.size()));
  while (groups.size() < group_count && groups.top().extent > 0) {
    const Group group = groups.top();
    groups.pop();
    const auto first = members.begin();
    const auto cut =
        std::partition(first + static_cast<std::ptrdiff_t>(group.begin), first + static_cast<std::ptrdiff_t>(group.end),
                       [&](std::uint32_t v) { return coordinate(points[v], group.axis) < group.middle; });
    const auto middle = static_cast<std::size_t>(cut - first);
    groups.push(group_of(points, members, group.begin, middle));
    groups.push(group_of(points, members, middle, group.end));
  }
  for (; !groups.empty(); groups.pop()) {
    const auto group = std::span(members).subspan(groups.top().begin, groups.top().end - groups.top().begin);
    const std::uint32_t standing = representative(points, group);
    for (const std::uint32_t v : group) result[v] = standing;
  }
  return result;
}

}  // namespace spectra::mesh
