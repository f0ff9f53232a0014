#include "fusion/mesh/polygon_cutter.hpp"

#include <algorithm>
#include <cmath>

#include "fusion/base/vector.hpp"

namespace spectra::mesh {

namespace {

/// Of a polygon's size: what is not seen.
constexpr double kTinyShare = 1e-6;
/// Half of what floats differ by at least, as a share of them, on two axes.
constexpr double kFloatShare = 1.2e-7;

}  // namespace

PolygonCutter::Result PolygonCutter::cut(std::span<const base::Vec3f> corners) {
  if (corners.size() < 4) return Result::Fan;
  if (!flatten(corners)) return Result::Fan;
  if (is_fan_right()) return Result::Fan;
  if (points_.size() > kMostCorners || crosses_itself()) return Result::Failed;
  return clip_ears() ? Result::Ears : Result::Failed;
}

/// Fills points_; false when no triangle of the fan has an area.
bool PolygonCutter::flatten(std::span<const base::Vec3f> corners) {
  base::Vec3d normal, largest;
  double largest_area = 0, size = 0, farthest = 0;
  base::Vec3d last = corners[1] - corners[0];
  for (const base::Vec3f& corner : corners) {
    for (const float coordinate : {corner.x, corner.y, corner.z}) {
      farthest = std::max(farthest, std::abs(static_cast<double>(coordinate)));
    }
    const base::Vec3d edge = corner - corners[0];
    size = std::max({size, std::abs(edge.x), std::abs(edge.y), std::abs(edge.z)});
    const base::Vec3d area = cross(last, edge);
    normal = {normal.x + area.x, normal.y + area.y, normal.z + area.z};
    const double amount = std::max({std::abs(area.x), std::abs(area.y), std::abs(area.z)});
    if (amount > largest_area) {
      largest_area = amount;
      largest = area;
    }
    last = edge;
  }
  rounding_ = kFloatShare * farthest;
  tiny_area_ = size * (kTinyShare * size + rounding_);
  if (largest_area <= tiny_area_) return false;
  // The halves of a bow tie turn against each other, and nothing is left.
  const double sum = std::max({std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)});
  const base::Vec3d& along = sum > tiny_area_ ? normal : largest;
  points_.clear();
  const double x = std::abs(along.x), y = std::abs(along.y), z = std::abs(along.z);
  for (const base::Vec3f& corner : corners) {
    const base::Vec3d p = corner - corners[0];
    if (z >= x && z >= y) {
      points_.push_back({along.z > 0 ? p.x : -p.x, p.y});
    } else if (x >= y) {
      points_.push_back({along.x > 0 ? p.y : -p.y, p.z});
    } else {
      points_.push_back({along.y > 0 ? p.z : -p.z, p.x});
    }
  }
  return true;
}

/// Twice the area of a triangle; above 0 where the way a, b, c turns left.
double PolygonCutter::turn(std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
  const Point &p = points_[a], &q = points_[b], &r = points_[c];
  return (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
}

/// On which side of a line through a and b the point c is: 1 left, -1 right, 0 on it.
int PolygonCutter::side(std::uint32_t a, std::uint32_t b, std::uint32_t c) const {
  const double area = turn(a, b, c);
  const double none = rounding_ * (std::abs(points_[b].x - points_[a].x) + std::abs(points_[b].y - points_[a].y));
  return (area > none ? 1 : 0) - (area < -none ? 1 : 0);
}

/// Seen from the first corner the others follow each other, all the way and no further than once around.
bool PolygonCutter::is_fan_right() const {
  const auto count = static_cast<std::uint32_t>(points_.size());
  bool is_past_half = false;
  for (std::uint32_t i = 2; i < count; ++i) {
    if (turn(0, i - 1, i) < -tiny_area_) return false;
    const double from_start = turn(0, 1, i);
    if (from_start < -tiny_area_) is_past_half = true;
    if (is_past_half && from_start > tiny_area_) return false;
  }
  return true;
}

/// Two edges have a point in common that is the end of neither. Edges that touch do not cross.
bool PolygonCutter::crosses_itself() const {
  const auto count = static_cast<std::uint32_t>(points_.size());
  const auto are_apart = [](double a, double b, double c, double d) {
    return std::max(a, b) <= std::min(c, d) || std::max(c, d) <= std::min(a, b);
  };
  for (std::uint32_t a = 0; a + 2 < count; ++a) {
    const Point &p = points_[a], &q = points_[a + 1];
    for (std::uint32_t c = a + 2; c < count; ++c) {
      const std::uint32_t d = c + 1 < count ? c + 1 : 0;
      const Point &r = points_[c], &s = points_[d];
      if ((p.x != q.x && r.x != s.x && are_apart(p.x, q.x, r.x, s.x)) ||
          (p.y != q.y && r.y != s.y && are_apart(p.y, q.y, r.y, s.y))) {
        continue;
      }
      if (side(a, a + 1, c) * side(a, a + 1, d) < 0 && side(c, d, a) * side(c, d, a + 1) < 0) return true;
    }
  }
  return false;
}

/// No other corner lies in the triangle that would be cut off, unless it stands where one of its own does.
bool PolygonCutter::is_ear(std::uint32_t corner) const {
  const std::uint32_t a = previous_[corner], c = next_[corner];
  const Point &p = points_[a], &q = points_[corner], &r = points_[c];
  const auto is_at = [](const Point& one, const Point& other) { return one.x == other.x && one.y == other.y; };
  return std::none_of(hollows_.begin(), hollows_.end(), [&](std::uint32_t v) {
    if (turn(a, corner, v) < 0 || turn(corner, c, v) < 0 || turn(c, a, v) < 0) return false;
    return !is_at(points_[v], p) && !is_at(points_[v], q) && !is_at(points_[v], r);
  });
}

void PolygonCutter::find_ears() {
  for (std::uint32_t v = 0; v < points_.size(); ++v) {
    if (next_[v] != v) ears_[v] = turn(previous_[v], v, next_[v]) > 0 && is_ear(v);
  }
}

/// Only the two beside it become or cease to be ears by that.
void PolygonCutter::cut_off(std::uint32_t corner) {
  const std::uint32_t before = previous_[corner], after = next_[corner];
  triangles_.push_back({before, corner, after});
  next_[before] = after;
  previous_[after] = before;
  next_[corner] = corner;
  ears_[corner] = false;
  std::erase(hollows_, corner);
  for (const std::uint32_t v : {before, after}) {
    std::erase(hollows_, v);
    if (turn(previous_[v], v, next_[v]) <= 0) hollows_.push_back(v);
  }
  for (const std::uint32_t v : {before, after}) ears_[v] = turn(previous_[v], v, next_[v]) > 0 && is_ear(v);
}

bool PolygonCutter::clip_ears() {
  const auto count = static_cast<std::uint32_t>(points_.size());
  previous_.resize(count);
  next_.resize(count);
  ears_.assign(count, false);
  hollows_.clear();
  triangles_.clear();
  for (std::uint32_t v = 0; v < count; ++v) {
    previous_[v] = v > 0 ? v - 1 : count - 1;
    next_[v] = v + 1 < count ? v + 1 : 0;
  }
  for (std::uint32_t v = 0; v < count; ++v) {
    if (turn(previous_[v], v, next_[v]) <= 0) hollows_.push_back(v);
  }
  find_ears();
  // Where edges touch or corners are flat, all may have to be looked at again; but not for ever.
  constexpr int kMostSearches = 16;
  int searches = 0;
  std::uint32_t v = 0;
  std::uint32_t left = count;
  while (left > 3) {
    std::uint32_t looked_at = 0;
    for (; looked_at < left && !ears_[v]; ++looked_at) v = next_[v];
    if (looked_at == left) {
      if (++searches > kMostSearches) return false;
      find_ears();
      for (looked_at = 0; looked_at < left && !ears_[v]; ++looked_at) v = next_[v];
    }
    // Corners without area wait, so that other triangles can have them.
    for (looked_at = ears_[v] ? left : 0; looked_at < left; ++looked_at) {
      if (std::abs(turn(previous_[v], v, next_[v])) <= tiny_area_) break;
      v = next_[v];
    }
    if (!ears_[v] && looked_at == left) return false;
    // Not the next one: triangles would become ever more slender.
    const std::uint32_t after = next_[next_[v]];
    cut_off(v);
    v = after;
    --left;
  }
  triangles_.push_back({previous_[v], v, next_[v]});
  return true;
}

}  // namespace spectra::mesh
