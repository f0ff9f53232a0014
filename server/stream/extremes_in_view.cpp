#include "server/stream/extremes_in_view.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "fusion/base/vector.hpp"
#include "server/stream/view_selection.hpp"

namespace spectra::stream {
namespace {

constexpr int kLongerSide = 640;
/// suggested_position_step_m() is about a quarter of the distance between points.
constexpr double kStepsBetweenPoints = 4;
constexpr double kWidestPoint = 32;
/// What is nearer to the eye than this share of the distance to what is looked at cannot be told from the eye.
constexpr double kNearShare = 1e-4;

using base::cross;
using base::dot;
using base::Vector;
using base::vector_of;

Vector unit(const Vector& a) {
  const double size = std::sqrt(dot(a, a));
  return {a[0] / size, a[1] / size, a[2] / size};
}

/// A point as the camera has it: right of and above the line of sight, and how far along it.
struct Seen {
  double right = 0, up = 0, depth = 0;
};

/// A place on the map; `nearness` is 1 / depth, which is linear over a plane.
struct Place {
  double x = 0, y = 0, nearness = 0;
};

class Eye {
 public:
  Eye(const Camera& camera, const PictureWindow& window) : eye_(vector_of(camera.eye)) {
    const Vector target = vector_of(camera.target);
    const Vector way{target[0] - eye_[0], target[1] - eye_[1], target[2] - eye_[2]};
    forward_ = unit(way);
    near_ = kNearShare * std::sqrt(dot(way, way));
    Vector right = cross(forward_, vector_of(camera.up));
    if (dot(right, right) < 1e-12) {
      right = cross(forward_, std::abs(forward_[0]) < 0.9 ? Vector{1, 0, 0} : Vector{0, 1, 0});
    }
    right_ = unit(right);
    up_ = cross(right_, forward_);
    const double tangent_y = std::tan(camera.fov_y_deg * std::numbers::pi / 360);
    const double tangent_x = tangent_y * camera.viewport[0] / camera.viewport[1];
    const auto [left, top, right_side, bottom] = window;
    left_ = (2 * left - 1) * tangent_x;
    top_ = (1 - 2 * top) * tangent_y;
    const double width = 2 * (right_side - left) * tangent_x;
    const double height = 2 * (bottom - top) * tangent_y;
    pixels_per_tangent_ = kLongerSide / std::max(width, height);
    width_ = std::max(1, static_cast<int>(std::ceil(width * pixels_per_tangent_)));
    height_ = std::max(1, static_cast<int>(std::ceil(height * pixels_per_tangent_)));
    extent_x_ = width * pixels_per_tangent_;
    extent_y_ = height * pixels_per_tangent_;
  }

  int width() const { return width_; }
  int height() const { return height_; }
  double near() const { return near_; }
  double pixels_per_tangent() const { return pixels_per_tangent_; }

  Seen see(const base::Vec3f& position) const {
    const Vector p = vector_of(position);
    const Vector way{p[0] - eye_[0], p[1] - eye_[1], p[2] - eye_[2]};
    return {dot(way, right_), dot(way, up_), dot(way, forward_)};
  }
  Place place(const Seen& seen) const {
    const double nearness = 1 / seen.depth;
    return {(seen.right * nearness - left_) * pixels_per_tangent_, (top_ - seen.up * nearness) * pixels_per_tangent_,
            nearness};
  }
  bool is_inside(const Place& place) const {
    return place.x >= 0 && place.y >= 0 && place.x <= extent_x_ && place.y <= extent_y_;
  }

 private:
  Vector eye_, forward_{}, right_{}, up_{};
  double near_ = 0, left_ = 0, top_ = 0, pixels_per_tangent_ = 1, extent_x_ = 0, extent_y_ = 0;
  int width_ = 1, height_ = 1;
};

/// How near the foremost surface is, at the middle of every pixel; 0 = nothing there.
class DepthMap {
 public:
  DepthMap(int width, int height)
      : width_(width), height_(height), nearness_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

  void draw(const Place& a, const Place& b, const Place& c) {
    const double area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if (area == 0 || !std::isfinite(area)) return;
    const auto [x_from, x_to] = pixels(std::min({a.x, b.x, c.x}), std::max({a.x, b.x, c.x}), width_);
    const auto [y_from, y_to] = pixels(std::min({a.y, b.y, c.y}), std::max({a.y, b.y, c.y}), height_);
    for (int y = y_from; y <= y_to; ++y) {
      for (int x = x_from; x <= x_to; ++x) {
        const double px = x + 0.5;
        const double py = y + 0.5;
        const double of_a = ((b.x - px) * (c.y - py) - (b.y - py) * (c.x - px)) / area;
        const double of_b = ((c.x - px) * (a.y - py) - (c.y - py) * (a.x - px)) / area;
        const double of_c = 1 - of_a - of_b;
        if (of_a < 0 || of_b < 0 || of_c < 0) continue;
        take(x, y, of_a * a.nearness + of_b * b.nearness + of_c * c.nearness);
      }
    }
  }

  void draw_point(const Place& place, double diameter) {
    const double radius = std::clamp(diameter, 1.0, kWidestPoint) / 2;
    const auto [x_from, x_to] = pixels(place.x - radius, place.x + radius, width_);
    const auto [y_from, y_to] = pixels(place.y - radius, place.y + radius, height_);
    for (int y = y_from; y <= y_to; ++y) {
      for (int x = x_from; x <= x_to; ++x) take(x, y, place.nearness);
    }
  }

  /// The farthest of the four pixels around a place: no plane through the place is nearer at all of them.
  double nearness_around(const Place& place) const {
    const auto x = static_cast<int>(std::floor(place.x - 0.5));
    const auto y = static_cast<int>(std::floor(place.y - 0.5));
    return std::min({at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)});
  }

 private:
  /// The pixels whose middles lie from one place to another.
  static std::pair<int, int> pixels(double from, double to, int size) {
    return {static_cast<int>(std::ceil(std::clamp(from - 0.5, 0.0, static_cast<double>(size)))),
            static_cast<int>(std::floor(std::clamp(to - 0.5, -1.0, static_cast<double>(size - 1))))};
  }
  void take(int x, int y, double nearness) {
    auto& known =
        nearness_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)];
    known = std::max(known, static_cast<float>(nearness));
  }
  double at(int x, int y) const {
    const int inside_x = std::clamp(x, 0, width_ - 1);
    const int inside_y = std::clamp(y, 0, height_ - 1);
    return static_cast<double>(nearness_[static_cast<std::size_t>(inside_y) * static_cast<std::size_t>(width_) +
                                         static_cast<std::size_t>(inside_x)]);
  }

  int width_, height_;
  std::vector<float> nearness_;
};

/// Draws a triangle, cut off where it comes too near to the eye.
void draw_triangle(DepthMap& map, const Eye& eye, const std::array<Seen, 3>& corners) {
  std::array<Seen, 4> cut;
  std::size_t count = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const Seen& a = corners[i];
    const Seen& b = corners[(i + 1) % 3];
    if (a.depth >= eye.near()) cut[count++] = a;
    if ((a.depth >= eye.near()) == (b.depth >= eye.near())) continue;
    const double share = (eye.near() - a.depth) / (b.depth - a.depth);
    cut[count++] = {a.right + share * (b.right - a.right), a.up + share * (b.up - a.up), eye.near()};
  }
  for (std::size_t i = 2; i < count; ++i) map.draw(eye.place(cut[0]), eye.place(cut[i - 1]), eye.place(cut[i]));
}

/// The first of the input among those of the same temperature.
class Choice {
 public:
  /// `index`: where the vertex stands in the input.
  void offer(const map::Tile& tile, std::size_t vertex, std::uint32_t index, bool is_better) {
    const float celsius = tile.temperature_celsius[vertex];
    if (best_ && !is_better && !(celsius == best_->temperature_celsius && index < index_)) return;
    best_ = {tile.positions[vertex], celsius};
    index_ = index;
  }
  const std::optional<map::Extreme>& best() const { return best_; }

 private:
  std::optional<map::Extreme> best_;
  std::uint32_t index_ = 0;
};

class Choices {
 public:
  void offer(const map::Tile& tile, std::size_t vertex, std::uint32_t index) {
    const float celsius = tile.temperature_celsius[vertex];
    if (std::isinf(celsius)) {
      (celsius > 0 ? over_ : under_).offer(tile, vertex, index, false);
      return;
    }
    hottest_.offer(tile, vertex, index, celsius > hottest_.best().value_or(map::Extreme{}).temperature_celsius);
    coldest_.offer(tile, vertex, index, celsius < coldest_.best().value_or(map::Extreme{}).temperature_celsius);
  }
  /// Whether a vertex of this temperature may change anything: only then it has to be known whether it is seen.
  bool may_want(float celsius) const {
    if (std::isnan(celsius)) return false;
    if (std::isinf(celsius) || !hottest_.best() || !coldest_.best()) return true;
    return celsius >= hottest_.best()->temperature_celsius || celsius <= coldest_.best()->temperature_celsius;
  }
  ExtremesInView result() const { return {hottest_.best(), coldest_.best(), over_.best(), under_.best()}; }

 private:
  Choice hottest_, coldest_, over_, under_;
};

}  // namespace

ExtremesInView extremes_in_view(const map::SceneSnapshot& scene, const Camera& camera, const PictureWindow& window) {
  if (!is_usable(camera)) return {};
  const Eye eye(camera, window);
  DepthMap map(eye.width(), eye.height());
  std::vector<const map::Tile*> tiles;
  for (const auto& tile : scene.tiles()) {
    if (tile->child_mask == 0 && !tile->positions.empty() && may_be_in_view(camera, tile->bounds)) {
      tiles.push_back(tile.get());
    }
  }
  const double point_width = kStepsBetweenPoints * static_cast<double>(scene.suggested_position_step_m());
  std::vector<Seen> seen;
  for (const map::Tile* tile : tiles) {
    seen.clear();
    for (const auto& position : tile->positions) seen.push_back(eye.see(position));
    for (const auto& [a, b, c] : tile->triangles) draw_triangle(map, eye, {seen[a], seen[b], seen[c]});
    if (!tile->triangles.empty()) continue;
    for (const Seen& point : seen) {
      if (point.depth < eye.near()) continue;
      map.draw_point(eye.place(point), point_width * eye.pixels_per_tangent() / point.depth);
    }
  }

  Choices choices;
  std::vector<bool> is_drawn;
  for (const map::Tile* tile : tiles) {
    // Vertices of no triangle are not drawn.
    is_drawn.assign(tile->positions.size(), tile->triangles.empty());
    for (const auto& triangle : tile->triangles) {
      for (const auto corner : triangle) is_drawn[corner] = true;
    }
    for (std::size_t i = 0; i < tile->positions.size(); ++i) {
      if (!is_drawn[i] || !choices.may_want(tile->temperature_celsius[i])) continue;
      const Seen point = eye.see(tile->positions[i]);
      if (point.depth < eye.near()) continue;
      const Place place = eye.place(point);
      if (!eye.is_inside(place)) continue;
      const double nearness = map.nearness_around(place);  // 0 where nothing is drawn.
      if (nearness > 0 && point.depth - point.depth / eye.pixels_per_tangent() > 1 / nearness) continue;
      choices.offer(*tile, i, scene.vertex_index(*tile, i));
    }
  }
  return choices.result();
}

}  // namespace spectra::stream
