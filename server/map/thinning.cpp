#include "server/map/thinning.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "fusion/mesh/point_groups.hpp"
#include "fusion/mesh/simplify.hpp"

namespace spectra::map {
namespace {

using base::Rgb8;
using base::Triangle;
using base::Vec3f;

constexpr std::uint32_t kNone = mesh::Surface::kNone;

/// What is between the measured samples may be farther away than they are.
constexpr double kErrorMargin = 1.1;
/// Points that stand for themselves because they differ from their group, of all.
constexpr double kMostOutliers = 1.0 / 8;

/// The triangles with each vertex replaced by what stands for it, without those that become degenerate.
std::vector<base::Triangle> mapped(const std::vector<base::Triangle>& triangles,
                                   std::span<const std::uint32_t> standing) {
  std::vector<base::Triangle> result;
  for (const base::Triangle& t : triangles) {
    const base::Triangle image{standing[t[0]], standing[t[1]], standing[t[2]]};
    if (image[0] != image[1] && image[1] != image[2] && image[2] != image[0]) result.push_back(image);
  }
  return result;
}

std::vector<bool> are_used(const std::vector<base::Triangle>& triangles, std::size_t vertex_count) {
  std::vector<bool> is_used(vertex_count);
  for (const base::Triangle& t : triangles) {
    for (const std::uint32_t v : t) is_used[v] = true;
  }
  return is_used;
}

/// Groups of vertices and what they show together.
class GroupMeans {
 public:
  GroupMeans(std::span<const std::uint32_t> members, std::span<const std::uint32_t> standing,
             std::span<const base::Rgb8> visible, std::span<const float> celsius, std::span<const std::uint32_t> weight)
      : means_(standing.size()) {
    for (const std::uint32_t v : members) {
      Mean& mean = means_[standing[v]];
      const auto w = static_cast<double>(weight[v]);
      mean.r += w * visible[v].r;
      mean.g += w * visible[v].g;
      mean.b += w * visible[v].b;
      mean.weight += w;
      if (!std::isfinite(celsius[v])) continue;
      mean.celsius += w * static_cast<double>(celsius[v]);
      mean.celsius_weight += w;
    }
    for (const std::uint32_t v : members) {
      Mean& mean = means_[standing[v]];
      const double difference = deviation(v, standing, celsius);
      if (difference <= mean.largest) continue;
      mean.largest = difference;
      mean.outlier = v;
    }
  }

  base::Rgb8 colour(std::uint32_t group) const {
    const Mean& mean = means_[group];
    const auto channel = [&](double sum) { return static_cast<std::uint8_t>(std::lround(sum / mean.weight)); };
    return {channel(mean.r), channel(mean.g), channel(mean.b)};
  }
  float celsius(std::uint32_t group) const {
    const Mean& mean = means_[group];
    return mean.celsius_weight > 0 ? static_cast<float>(mean.celsius / mean.celsius_weight)
                                   : std::numeric_limits<float>::quiet_NaN();
  }
  std::uint32_t weight(std::uint32_t group) const {
    return static_cast<std::uint32_t>(std::min(means_[group].weight, 4294967295.0));
  }
  /// The member whose temperature differs most from the mean, and by how much.
  std::pair<double, std::uint32_t> outlier(std::uint32_t group) const {
    return {means_[group].largest, means_[group].outlier};
  }

 private:
  struct Mean {
    double r = 0, g = 0, b = 0, weight = 0, celsius = 0, celsius_weight = 0;
    double largest = 0;
    std::uint32_t outlier = kNone;
  };

  double deviation(std::uint32_t v, std::span<const std::uint32_t> standing, std::span<const float> celsius) const {
    const Mean& mean = means_[standing[v]];
    if (std::isnan(celsius[v]) || !(mean.celsius_weight > 0)) return 0;
    return std::fabs(static_cast<double>(celsius[v]) - mean.celsius / mean.celsius_weight);
  }

  std::vector<Mean> means_;
};

/// The nearest of some points, for the few vertices that no edge connects to one.
class NearestPoint {
 public:
  NearestPoint(std::span<const base::Vec3f> positions, std::vector<std::uint32_t> points)
      : positions_(positions), points_(std::move(points)) {
    std::sort(points_.begin(), points_.end(), [&](std::uint32_t a, std::uint32_t b) {
      return std::pair(positions[a].x, a) < std::pair(positions[b].x, b);
    });
  }

  std::uint32_t operator()(const base::Vec3f& p) const {
    const auto middle = std::lower_bound(points_.begin(), points_.end(), p.x,
                                         [&](std::uint32_t v, float x) { return positions_[v].x < x; });
    std::uint32_t best = points_.front();
    double best_squared = std::numeric_limits<double>::infinity();
    const auto is_beyond = [&](std::uint32_t v) {
      const double dx = static_cast<double>(positions_[v].x) - static_cast<double>(p.x);
      if (dx * dx > best_squared) return true;
      const double squared = mesh::squared_distance(p, positions_[v]);
      if (squared < best_squared || (squared == best_squared && v < best)) {
        best_squared = squared;
        best = v;
      }
      return false;
    };
    for (auto up = middle; up != points_.end() && !is_beyond(*up); ++up) {
    }
    for (auto down = middle; down != points_.begin() && !is_beyond(*std::prev(down)); --down) {
    }
    return best;
  }

 private:
  std::span<const base::Vec3f> positions_;
  std::vector<std::uint32_t> points_;
};

/// Joins vertices near each other until few enough are left. What differs much from its group decides for it: it must not be lost.
void join_near_vertices(mesh::Simplified& mesh, const MergedTiles& merged, const std::vector<bool>& is_locked,
                        const ThinningOptions& options) {
  const std::vector<bool> is_used = are_used(mesh.triangles, merged.positions.size());
  std::vector<std::uint32_t> free;
  std::size_t locked_count = 0;
  for (std::uint32_t v = 0; v < is_used.size(); ++v) {
    if (!is_used[v]) continue;
    if (is_locked[v]) {
      ++locked_count;
    } else {
      free.push_back(v);
    }
  }
  if (4 * (free.size() + locked_count) <= 5 * options.wanted_count) return;
  const std::size_t group_count = options.wanted_count > locked_count ? options.wanted_count - locked_count : 1;
  const std::vector<std::uint32_t> standing = mesh::group_representatives(merged.positions, free, group_count);
  mesh.triangles = mapped(mesh.triangles, standing);
  const GroupMeans means(free, standing, mesh.visible, mesh.temperature_celsius, merged.weight);
  const std::vector<float> before = mesh.temperature_celsius;
  for (const std::uint32_t v : free) {
    if (standing[v] != v) continue;
    mesh.visible[v] = means.colour(v);
    const auto [difference, outlier] = means.outlier(v);
    mesh.temperature_celsius[v] = difference >= options.span_celsius / 16 ? before[outlier] : means.celsius(v);
  }
}

}  // namespace

Thinning thinned_surface(const MergedTiles& mesh, const mesh::Surface& fine, const std::vector<bool>& is_locked,
                         const ThinningOptions& options, mesh::SimplifyMemory& memory) {
  mesh::Simplified simple = mesh::simplified({.surface = fine,
                                              .visible = mesh.visible,
                                              .temperature_celsius = mesh.temperature_celsius,
                                              .is_locked = is_locked,
                                              .span_celsius = options.span_celsius},
                                             options.wanted_count, memory);
  join_near_vertices(simple, mesh, is_locked, options);
  if (simple.triangles.empty()) simple.triangles.push_back(mesh.any_triangle);

  Thinning result;
  result.triangles = std::move(simple.triangles);
  const std::vector<bool> is_kept = are_used(result.triangles, mesh.positions.size());
  std::vector<std::uint32_t> index_of(mesh.positions.size(), kNone);
  std::vector<base::Vec3f> positions;
  for (std::uint32_t v = 0; v < is_kept.size(); ++v) {
    if (!is_kept[v]) continue;
    index_of[v] = static_cast<std::uint32_t>(result.kept.size());
    result.kept.push_back(v);
    positions.push_back(mesh.positions[v]);
    result.visible.push_back(simple.visible[v]);
    result.temperature_celsius.push_back(simple.temperature_celsius[v]);
  }
  for (base::Triangle& t : result.triangles) t = {index_of[t[0]], index_of[t[1]], index_of[t[2]]};

  const std::vector<std::uint32_t> seeds = fine.nearest_seeds(is_kept);
  const NearestPoint nearest(mesh.positions, result.kept);
  result.weight.assign(result.kept.size(), 0);
  result.kept_of_merged.resize(mesh.positions.size());
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    const std::uint32_t k = index_of[seeds[v] != kNone ? seeds[v] : nearest(mesh.positions[v])];
    result.kept_of_merged[v] = k;
    result.weight[k] += std::min(mesh.weight[v], 0xffffffffu - result.weight[k]);
  }
  result.distance_m = kErrorMargin * two_sided_distance(fine, mesh::Surface(positions, result.triangles),
                                                        result.kept_of_merged, result.kept);
  return result;
}

Thinning thinned_points(const MergedTiles& cloud, const std::vector<bool>& is_locked, const ThinningOptions& options) {
  std::vector<std::uint32_t> members;
  for (std::uint32_t v = 0; v < cloud.positions.size(); ++v) {
    if (!is_locked[v]) members.push_back(v);
  }
  const std::size_t locked_count = cloud.positions.size() - members.size();
  const auto most_outliers = static_cast<std::size_t>(kMostOutliers * static_cast<double>(options.wanted_count));
  const std::size_t others = locked_count + most_outliers;
  const std::size_t group_count = options.wanted_count > others ? options.wanted_count - others : 1;
  std::vector<std::uint32_t> standing = mesh::group_representatives(cloud.positions, members, group_count);
  const GroupMeans means(members, standing, cloud.visible, cloud.temperature_celsius, cloud.weight);

  std::vector<base::Rgb8> visible = cloud.visible;
  std::vector<float> celsius = cloud.temperature_celsius;
  std::vector<std::pair<double, std::uint32_t>> outliers;
  for (const std::uint32_t v : members) {
    if (standing[v] != v) continue;
    visible[v] = means.colour(v);
    celsius[v] = means.celsius(v);
    const auto [difference, outlier] = means.outlier(v);
    if (difference >= options.span_celsius / 16) outliers.emplace_back(-difference, outlier);
  }
  std::sort(outliers.begin(), outliers.end());
  for (std::size_t i = 0; i < outliers.size(); ++i) {
    const std::uint32_t outlier = outliers[i].second;
    const std::uint32_t group = standing[outlier];
    if (i < most_outliers && outlier != group) {
      standing[outlier] = outlier;
    } else {
      celsius[group] = cloud.temperature_celsius[outlier];  // Never lost, even where there is no room.
    }
  }

  Thinning result;
  std::vector<std::uint32_t> index_of(cloud.positions.size(), kNone);
  for (std::uint32_t v = 0; v < cloud.positions.size(); ++v) {
    if (standing[v] != v) continue;
    index_of[v] = static_cast<std::uint32_t>(result.kept.size());
    result.kept.push_back(v);
    result.visible.push_back(visible[v]);
    result.temperature_celsius.push_back(celsius[v]);
  }
  result.weight.assign(result.kept.size(), 0);
  double largest_squared = 0;
  for (std::uint32_t v = 0; v < cloud.positions.size(); ++v) {
    const std::uint32_t k = index_of[standing[v]];
    result.kept_of_merged.push_back(k);
    result.weight[k] += std::min(cloud.weight[v], 0xffffffffu - result.weight[k]);
    largest_squared =
        std::max(largest_squared, mesh::squared_distance(cloud.positions[v], cloud.positions[standing[v]]));
  }
  result.distance_m = std::sqrt(largest_squared);
  return result;
}

}  // namespace spectra::map
