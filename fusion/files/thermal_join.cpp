#include "fusion/files/thermal_join.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fusion/base/distance_text.hpp"
#include "fusion/files/ply_notes.hpp"
#include "fusion/files/ply_values.hpp"
#include "fusion/mesh/nearest_surface.hpp"
#include "fusion/mesh/stray_points.hpp"
#include "fusion/mesh/surface.hpp"

namespace spectra::files {

namespace {

constexpr float kMissing = std::numeric_limits<float>::quiet_NaN();
/// Places agree when they differ by less than this share of the scene's size.
constexpr double kSamePlace = 1e-4;
constexpr double kSpacings = 3;
constexpr double kOffsets = 3;
/// The least and the most of the scene's diagonal that a surface reaches.
constexpr double kLeastReach = 0.005;
constexpr double kMostReach = 0.02;
/// Of an edge: how far the surface may be from the triangles that stand for it.
constexpr double kCutOff = 0.5;
constexpr double kLeastShare = 0.1;
/// Of the scene's diagonal: how far the points of a cloud reach at most.
constexpr double kMostReachOfPoints = 0.1;
/// By how much the directions of two boxes of one shape differ.
constexpr double kSameShape = 0.03;

/// A box in the coordinates of the file.
struct Box {
  std::array<double, 3> low{}, high{};

  double extent(std::size_t axis) const { return high[axis] - low[axis]; }
  double diagonal() const { return std::hypot(extent(0), extent(1), extent(2)); }
  /// To another box; 0 where they meet.
  double distance(const Box& other) const {
    std::array<double, 3> gap{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      gap[axis] = std::max({0.0, other.low[axis] - high[axis], low[axis] - other.high[axis]});
    }
    return std::hypot(gap[0], gap[1], gap[2]);
  }
};

Box core_box(const mesh::MultispectralMesh& mesh) {
  const base::Bounds core = mesh::stray_points(mesh.positions(), mesh.triangles()).core;
  const auto absolute = [&mesh](const base::Vec3f& p) -> std::array<double, 3> {
    return {mesh.origin.x + static_cast<double>(p.x), mesh.origin.y + static_cast<double>(p.y),
            mesh.origin.z + static_cast<double>(p.z)};
  };
  return {absolute(core.min), absolute(core.max)};
}

/// How many times as large `b` is as `a` where it is the same in all directions; absent where it has another shape.
std::optional<double> ratio_of_same_shape(const Box& a, const Box& b) {
  if (!(a.diagonal() > 0) || !(b.diagonal() > 0)) return std::nullopt;
  constexpr double kFlat = 0.02;
  const double ratio = b.diagonal() / a.diagonal();
  std::size_t agreeing_count = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (a.extent(axis) < kFlat * a.diagonal() && b.extent(axis) < kFlat * b.diagonal()) continue;
    if (!(std::abs(b.extent(axis) / (a.extent(axis) * ratio) - 1) < kSameShape)) return std::nullopt;
    ++agreeing_count;
  }
  return agreeing_count > 1 ? std::optional(ratio) : std::nullopt;
}

/// How many times as large `b` is as `a` when that is so in all directions and the ratio of two units of length.
std::optional<double> unit_ratio(const Box& a, const Box& b) {
  const std::optional<double> found = ratio_of_same_shape(a, b);
  if (!found) return std::nullopt;
  // A million: millimetres beside metres, and the metres scaled as if they were the millimetres.
  for (const double unit : {1e6, 1000.0, 100.0, 10.0, 1000 / 304.8, 1000 / 25.4, 25.4, 304.8, 12.0, 30.48, 2.54}) {
    for (const double ratio : {unit, 1 / unit}) {
      if (std::abs(*found / ratio - 1) < kSameShape) return ratio;
    }
  }
  return std::nullopt;
}

std::string range_text(const Box& box) {
  std::string text;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::array<char, 80> part{};
    std::snprintf(part.data(), part.size(), "%s%c %.7g..%.7g", axis == 0 ? "" : ", ", static_cast<int>('x' + axis),
                  box.low[axis], box.high[axis]);
    text += part.data();
  }
  return text;
}

base::Error no_overlap(const LoadedScene& scene, const LoadedScene& thermal, const std::string& what) {
  return {base::ErrorCode::Unsupported,
          thermal.mesh.name + ": the thermal file does not lie on " + scene.mesh.name + ": " + what, thermal.mesh.name};
}

/// The thermal vertices relative to the scene's origin.
std::vector<base::Vec3f> positions_in(const mesh::MultispectralMesh& scene, const mesh::MultispectralMesh& thermal) {
  std::vector<base::Vec3f> positions(thermal.vertex_count());
  const auto moved = [](double origin, double other_origin, float p) {
    constexpr double kLargest = std::numeric_limits<float>::max();
    return static_cast<float>(std::clamp(origin - other_origin + static_cast<double>(p), -kLargest, kLargest));
  };
  std::transform(thermal.positions().begin(), thermal.positions().end(), positions.begin(), [&](const base::Vec3f& p) {
    return base::Vec3f{moved(thermal.origin.x, scene.origin.x, p.x), moved(thermal.origin.y, scene.origin.y, p.y),
                       moved(thermal.origin.z, scene.origin.z, p.z)};
  });
  return positions;
}

/// The largest difference of a coordinate, vertex by vertex.
double largest_difference(std::span<const base::Vec3f> a, std::span<const base::Vec3f> b) {
  double largest = 0;
  for (std::size_t v = 0; v < a.size(); ++v) {
    for (const auto& [p, q] : {std::pair{a[v].x, b[v].x}, std::pair{a[v].y, b[v].y}, std::pair{a[v].z, b[v].z}}) {
      largest = std::max(largest, std::abs(static_cast<double>(p) - static_cast<double>(q)));
    }
  }
  return largest;
}

/// What a float in the coordinates of the file is rounded by.
double file_rounding(const Box& box) {
  double farthest = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    farthest = std::max({farthest, std::abs(box.low[axis]), std::abs(box.high[axis])});
  }
  return farthest * 0x1p-23;
}

/// Infinite where one is over the range of the sensor; -infinity where there is none.
float hottest_of(std::span<const float> values) {
  float hottest = -std::numeric_limits<float>::infinity();
  for (const float value : values) {
    if (!std::isnan(value)) hottest = std::max(hottest, value);
  }
  return hottest;
}

std::string celsius_text(float celsius) {
  if (celsius == -std::numeric_limits<float>::infinity()) return "none";
  if (std::isinf(celsius)) return "one over the range of the sensor";
  return number_text(std::round(static_cast<double>(celsius) * 10) / 10) + " degC";
}

/// Vertices of the scene that are not where the thermal ones of the same number are, but for what a float in the coordinates of the file is
/// rounded by; those farthest apart first.
std::vector<std::uint32_t> moved_vertices(const mesh::MultispectralMesh& scene, std::span<const base::Vec3f> thermal) {
  const auto is_same = [](double origin, float a, float b) {
    const double rounding = (std::abs(origin + static_cast<double>(a)) + std::abs(origin)) * 0x1p-23;
    return std::abs(static_cast<double>(a) - static_cast<double>(b)) <= rounding;
  };
  const std::span<const base::Vec3f> places = scene.positions();
  std::vector<std::uint32_t> moved;
  for (std::uint32_t v = 0; v < places.size(); ++v) {
    if (!is_same(scene.origin.x, places[v].x, thermal[v].x) || !is_same(scene.origin.y, places[v].y, thermal[v].y) ||
        !is_same(scene.origin.z, places[v].z, thermal[v].z)) {
      moved.push_back(v);
    }
  }
  std::sort(moved.begin(), moved.end(), [&](std::uint32_t a, std::uint32_t b) {
    const double one = mesh::squared_distance(places[a], thermal[a]),
                 other = mesh::squared_distance(places[b], thermal[b]);
    return one != other ? one > other : a < b;
  });
  return moved;
}

/// Whether the vertices of both are in the same order, within `tolerance` of each other: where one has moved, no other is nearer. Looked at is a
/// sample of those, the farthest among them.
bool is_in_order(const mesh::MultispectralMesh& scene, std::span<const base::Vec3f> thermal, double tolerance) {
  constexpr std::size_t kFarthest = 64, kOthers = 64;
  const std::span<const base::Vec3f> places = scene.positions();
  if (largest_difference(places, thermal) > tolerance) return false;
  const std::vector<std::uint32_t> moved = moved_vertices(scene, thermal);
  const std::size_t pace = std::max<std::size_t>(1, moved.size() / kOthers);
  for (std::size_t i = 0; i < moved.size(); i += i < kFarthest ? 1 : pace) {
    const base::Vec3f& place = places[moved[i]];
    const double own = mesh::squared_distance(place, thermal[moved[i]]);
    constexpr double kClearly = 0.98;
    if (std::any_of(thermal.begin(), thermal.end(),
                    [&](const base::Vec3f& p) { return mesh::squared_distance(place, p) < kClearly * own; })) {
      return false;
    }
  }
  return true;
}

/// Vertices whose triangles do not close round them. Where the triangles run the same way round, the neighbours that come
/// before and after a vertex are the same ones.
std::vector<bool> border_vertices(const mesh::MultispectralMesh& mesh) {
  std::vector<std::int64_t> balance(mesh.vertex_count());
  for (const base::Triangle& t : mesh.triangles()) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      balance[t[corner]] +=
          static_cast<std::int64_t>(t[(corner + 1) % 3]) - static_cast<std::int64_t>(t[(corner + 2) % 3]);
    }
  }
  std::vector<bool> is_border(balance.size());
  for (std::size_t v = 0; v < balance.size(); ++v) is_border[v] = balance[v] != 0;
  return is_border;
}

using Direction = std::array<float, 3>;

Direction unit(const std::array<double, 3>& v) {
  const double length = std::hypot(v[0], v[1], v[2]);
  if (!(length > 0) || !std::isfinite(length)) return {};
  return {static_cast<float>(v[0] / length), static_cast<float>(v[1] / length), static_cast<float>(v[2] / length)};
}

/// Which way the surface of a scene faces at its vertices; 0 where there is none, or nothing to tell it by.
std::vector<Direction> facings(std::span<const base::Vec3f> positions, std::span<const base::Triangle> triangles) {
  std::vector<std::array<double, 3>> sums(positions.size());
  for (const auto& [a, b, c] : triangles) {
    const auto edge = [&](std::uint32_t to) -> std::array<double, 3> {
      return {static_cast<double>(positions[to].x) - static_cast<double>(positions[a].x),
              static_cast<double>(positions[to].y) - static_cast<double>(positions[a].y),
              static_cast<double>(positions[to].z) - static_cast<double>(positions[a].z)};
    };
    const auto u = edge(b), v = edge(c);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t next = (axis + 1) % 3, last = (axis + 2) % 3;
      const double area = u[next] * v[last] - u[last] * v[next];
      for (const std::uint32_t corner : {a, b, c}) sums[corner][axis] += area;
    }
  }
  std::vector<Direction> directions(positions.size());
  std::transform(sums.begin(), sums.end(), directions.begin(), unit);
  return directions;
}

float dot(const Direction& a, const Direction& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// On the two sides of something thin.
bool are_opposite(const Direction& a, const Direction& b) {
  return dot(a, b) < -0.5F;
}

/// The thermal surface under a scene's vertices.
class PlaceJoin {
 public:
  PlaceJoin(const mesh::MultispectralMesh& scene, const mesh::MultispectralMesh& thermal,
            const base::Progress& progress)
      : progress_(progress),
        scene_(scene),
        thermal_(thermal),
        positions_(positions_in(scene, thermal)),
        is_border_(border_vertices(thermal)),
        surface_(positions_, thermal.triangles()),
        spacing_(surface_.median_spacing()) {}

  const mesh::NearestSurface& surface() const { return surface_; }
  std::span<const base::Vec3f> thermal_positions() const { return positions_; }

  /// Looks from every vertex of the scene, not further than `most`.
  void look(double most) {
    places_.assign(scene_.vertex_count(), {});
    std::atomic<std::size_t> done_count = 0;
    const std::span<const base::Vec3f> from = scene_.positions();
    surface_.find_all(
        from, most,
        [&](std::size_t v, const mesh::NearestSurface::Hit& hit) {
          places_[v] = {static_cast<float>(hit.distance), static_cast<float>(beyond_border(from[v], hit)),
                        temperature(hit), hit.corners[0]};
        },
        [&](std::size_t count) {
          const double share = static_cast<double>(done_count += count) / static_cast<double>(from.size());
          base::report(progress_, base::kJoiningPhase, kBuildingShare + (1 - kBuildingShare) * std::min(1.0, share));
        });
  }

  /// A point of a thermal cloud may be nearest to a vertex of the scene though it lies on the other side of a wall: the points are nearest
  /// to a side each, and a vertex takes the nearest of those that are not on the opposite one. To be called after look().
  void keep_to_sides(double most) {
    if (!thermal_.is_point_cloud() || scene_.is_point_cloud()) return;
    const std::span<const base::Vec3f> from = scene_.positions();
    const std::vector<Direction> facing = facings(from, scene_.triangles());
    std::vector<Direction> facing_of_points(positions_.size());
    mesh::NearestSurface(from, scene_.triangles()).find_all(positions_, most, [&](std::size_t p, const auto& hit) {
      std::array<double, 3> sum{};
      for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          sum[axis] += hit.weights[i] * static_cast<double>(facing[hit.corners[i]][axis]);
        }
      }
      facing_of_points[p] = unit(sum);
    });
    std::array<std::vector<std::uint32_t>, 6> vertices;  // By where they face most: x, -x, y ...
    for (std::uint32_t v = 0; v < places_.size(); ++v) {
      if (places_[v].point == kNone || !are_opposite(facing[v], facing_of_points[places_[v].point])) continue;
      const auto axis =
          static_cast<std::size_t>(std::max_element(facing[v].begin(), facing[v].end(),
                                                    [](float a, float b) { return std::abs(a) < std::abs(b); }) -
                                   facing[v].begin());
      vertices[2 * axis + (facing[v][axis] < 0 ? 1 : 0)].push_back(v);
    }
    for (std::size_t way = 0; way < vertices.size(); ++way) {
      if (vertices[way].empty()) continue;
      std::vector<std::uint32_t> points;
      std::vector<base::Vec3f> places_of_points, places_of_vertices;
      for (std::uint32_t p = 0; p < facing_of_points.size(); ++p) {
        const Direction& direction = facing_of_points[p];
        const float along = way % 2 == 0 ? direction[way / 2] : -direction[way / 2];
        if (direction == Direction{} || along < 0) continue;
        points.push_back(p);
        places_of_points.push_back(positions_[p]);
      }
      for (const std::uint32_t v : vertices[way]) {
        places_[v].is_of_other_side = true;
        places_of_vertices.push_back(from[v]);
      }
      mesh::NearestSurface(places_of_points, {})
          .find_all(places_of_vertices, most, [&](std::size_t i, const auto& hit) {
            const std::uint32_t v = vertices[way][i];
            const std::uint32_t point = points[hit.corners[0]];
            if (are_opposite(facing[v], facing_of_points[point])) return;
            places_[v] = {static_cast<float>(hit.distance), 0, thermal_.temperature_celsius()[point], point};
            places_[v].is_beside_nearer = true;
          });
    }
  }

  /// How many of the vertices within `reach` are on one of two sides that are near each other: those that have the nearest point of
  /// their own, and those that have one of the other, because their own has none.
  std::pair<std::uint64_t, std::uint64_t> side_counts(double reach) const {
    std::pair<std::uint64_t, std::uint64_t> counts;
    for (const Place& place : places_) {
      if (!is_within(place, reach)) continue;
      counts.first += place.is_beside_nearer ? 1U : 0U;
      counts.second += place.is_of_other_side ? 1U : 0U;
    }
    return counts;
  }

  /// The distance up to which places are joined.
  double reach(double diagonal) {
    const bool has_surface = !thermal_.is_point_cloud();
    // Triangles cut off what is round by a share of their size.
    const double coarser = std::max(spacing_, mesh::median_edge(scene_.positions(), scene_.triangles()));
    const double cut = std::min(kCutOff * coarser, kMostReach * diagonal);
    const double most_of_spacings = (has_surface ? kLeastReach : kMostReachOfPoints) * diagonal;
    const double near = std::max(cut, std::min(kSpacings * spacing_, most_of_spacings));
    const double most = std::max(near, kMostReach * diagonal);
    look(most);
    std::vector<float> found = found_distances(most);
    return std::clamp(kOffsets * quantile(found, 0.5), near, most);
  }

  /// How far the vertices that are within `reach` are.
  std::vector<float> found_distances(double reach) const {
    std::vector<float> found;
    for (const Place& place : places_) {
      if (is_within(place, reach)) found.push_back(place.distance);
    }
    return found;
  }

  static double quantile(std::vector<float>& values, double share) {
    if (values.empty()) return 0;
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return static_cast<double>(*at);
  }

  void write(double reach, std::span<float> temperatures) const {
    for (std::size_t v = 0; v < temperatures.size(); ++v) {
      temperatures[v] = is_within(places_[v], reach) ? places_[v].temperature_celsius : kMissing;
    }
  }

 private:
  /// What is nearest to a vertex of the scene.
  struct Place {
    float distance = std::numeric_limits<float>::infinity();
    float beyond_border = 0;
    float temperature_celsius = kMissing;
    std::uint32_t point = kNone;    ///< Of a cloud: which; else a corner of a triangle.
    bool is_beside_nearer = false;  ///< A nearer one is on the other side of something thin.
    bool is_of_other_side = false;  ///< This one is.
  };
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  /// Beyond the border the surface reaches as far as neighbours are apart, or as it may be displaced.
  bool is_within(const Place& place, double reach) const {
    return static_cast<double>(place.distance) <= reach &&
           static_cast<double>(place.beyond_border) <= std::max(spacing_, reach / kOffsets);
  }

  /// How far off its edge a place is that is not over the surface; else 0.
  double beyond_border(const base::Vec3f& place, const mesh::NearestSurface::Hit& hit) const {
    if (hit.corners[0] == hit.corners[1]) return 0;
    bool is_inside = true;
    for (std::size_t i = 0; i < 3; ++i) {
      if (hit.weights[i] == 0) {
        is_inside = false;
      } else if (!is_border_[hit.corners[i]]) {
        return 0;
      }
    }
    if (is_inside) return 0;
    const auto vector = [](const base::Vec3f& from, const base::Vec3f& to) -> std::array<double, 3> {
      return {static_cast<double>(to.x) - static_cast<double>(from.x),
              static_cast<double>(to.y) - static_cast<double>(from.y),
              static_cast<double>(to.z) - static_cast<double>(from.z)};
    };
    const base::Vec3f& a = positions_[hit.corners[0]];
    const auto u = vector(a, positions_[hit.corners[1]]);
    const auto v = vector(a, positions_[hit.corners[2]]);
    const auto w = vector(a, place);
    const std::array<double, 3> normal = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                                          u[0] * v[1] - u[1] * v[0]};
    const double length = std::hypot(normal[0], normal[1], normal[2]);
    const double height = length > 0 ? (w[0] * normal[0] + w[1] * normal[1] + w[2] * normal[2]) / length : 0;
    return std::sqrt(std::max(0.0, hit.distance * hit.distance - height * height));
  }

  /// Between the corners where all have one; else that of the corner that counts most.
  float temperature(const mesh::NearestSurface::Hit& hit) const {
    const std::span<const float> celsius = thermal_.temperature_celsius();
    double sum = 0;
    bool is_finite = true;
    for (std::size_t i = 0; i < 3; ++i) {
      if (hit.weights[i] == 0) continue;
      const float t = celsius[hit.corners[i]];
      is_finite = is_finite && std::isfinite(t);
      sum += hit.weights[i] * static_cast<double>(t);
    }
    if (is_finite) return static_cast<float>(sum);
    const auto heaviest = std::max_element(hit.weights.begin(), hit.weights.end()) - hit.weights.begin();
    return celsius[hit.corners[static_cast<std::size_t>(heaviest)]];
  }

  /// Of the time, until places can be looked for.
  static constexpr double kBuildingShare = 0.1;

  const base::Progress& progress_;
  const mesh::MultispectralMesh& scene_;
  const mesh::MultispectralMesh& thermal_;
  std::vector<base::Vec3f> positions_;
  std::vector<bool> is_border_;
  mesh::NearestSurface surface_;
  double spacing_;
  std::vector<Place> places_;  ///< Per vertex of the scene.
};

/// The share of the thermal vertices that lie within `reach` of the scene, over a sample.
double share_on_scene(const mesh::MultispectralMesh& scene, std::span<const base::Vec3f> thermal_positions,
                      double reach) {
  constexpr std::size_t kSampleCount = 1000;
  const mesh::NearestSurface surface(scene.positions(), scene.triangles());
  const std::size_t step = std::max<std::size_t>(1, thermal_positions.size() / kSampleCount);
  std::vector<base::Vec3f> samples;
  for (std::size_t v = 0; v < thermal_positions.size(); v += step) samples.push_back(thermal_positions[v]);
  std::atomic<std::size_t> near_count = 0;
  surface.find_all(samples, reach, [&](std::size_t, const mesh::NearestSurface::Hit&) { ++near_count; });
  return static_cast<double>(near_count) / static_cast<double>(samples.size());
}

std::string percent_text(std::uint64_t part, std::uint64_t whole) {
  const double percent = 100 * static_cast<double>(part) / static_cast<double>(whole);
  if (part < whole && percent > 99.9) return "over 99.9 %";
  return number_text(std::round(percent * 10) / 10) + " %";
}

/// Whether the thermal file is more than one place of a scene whose vertices take what is within `reach`.
base::Result<void> check_extent(const LoadedScene& scene, const LoadedScene& thermal, const Box& scene_box,
                                const Box& thermal_box, double reach) {
  if (!(scene_box.diagonal() > 0) || thermal_box.diagonal() > reach) return base::success();
  const std::size_t count = thermal.mesh.vertex_count();
  const std::string what = count == 1 ? "it has one point only"
                           : thermal_box.diagonal() == 0
                               ? "all positions of the thermal file are in one place"
                               : "it spans only " + base::distance_text(thermal_box.diagonal()) + ", less than the " +
                                     base::distance_text(reach) +
                                     " within which places are joined; see --scale if their units differ";
  return BOOST_OUTCOME_V2_NAMESPACE::failure(no_overlap(
      scene, thermal,
      what + " (the scene spans " + range_text(scene_box) + ", the thermal file " + range_text(thermal_box) + ")"));
}

base::Result<void> join_by_place(const LoadedScene& thermal, double join_distance_m, const Box& scene_box,
                                 const Box& thermal_box, LoadedScene& scene, const base::Progress& progress) {
  mesh::MultispectralMesh& mesh = scene.mesh;
  PlaceJoin join(mesh, thermal.mesh, progress);
  double reach = join_distance_m;
  if (reach > 0) {
    join.look(reach);
  } else {
    reach = join.reach(scene_box.diagonal());
  }
  join.keep_to_sides(reach);
  std::vector<float> found = join.found_distances(reach);
  BOOST_OUTCOME_TRYV(check_extent(scene, thermal, scene_box, thermal_box, join_distance_m == 0 ? reach : 0));
  const std::uint64_t count = mesh.vertex_count();
  const std::uint64_t joined_count = found.size();
  const double share = static_cast<double>(joined_count) / static_cast<double>(count);
  if (joined_count == 0 || (share < kLeastShare && join_distance_m == 0 &&
                            share_on_scene(mesh, join.thermal_positions(), reach) < kLeastShare)) {
    return BOOST_OUTCOME_V2_NAMESPACE::failure(
        no_overlap(scene, thermal,
                   "only " + std::to_string(joined_count) + " of " + std::to_string(count) +
                       " vertices have a thermal place within " + base::distance_text(reach) + " (the scene spans " +
                       range_text(scene_box) + ", the thermal file " + range_text(thermal_box) +
                       "); bring both into one frame, and see --scale if their units differ"));
  }
  join.write(reach, mesh.temperature_celsius());
  const double median_m = PlaceJoin::quantile(found, 0.5);
  const double farthest_m = PlaceJoin::quantile(found, 1);
  scene.notes.push_back({"thermal_joined_nearest", joined_count,
                         std::to_string(joined_count) + " of " + std::to_string(count) + " vertices (" +
                             percent_text(joined_count, count) + ") have the temperature of the nearest place of " +
                             thermal.mesh.name + " within " + base::distance_text(reach) + " (half of them within " +
                             base::distance_text(median_m) + ", the farthest at " + base::distance_text(farthest_m) +
                             ")"});
  const float hottest = hottest_of(thermal.mesh.temperature_celsius());
  const float kept = hottest_of(mesh.temperature_celsius());
  constexpr float kNoticed = 1;
  if (hottest - kept > kNoticed) {
    const auto celsius = thermal.mesh.temperature_celsius();
    const auto vertex = static_cast<std::size_t>(std::find(celsius.begin(), celsius.end(), hottest) - celsius.begin());
    const mesh::NearestSurface surface(mesh.positions(), mesh.triangles());
    const std::string advice = surface.find(join.thermal_positions()[vertex], reach)
                                   ? "; give the finer file as the scene"
                                   : "; the scene has nothing within " + base::distance_text(reach) + " of it: open " +
                                         thermal.mesh.name + " alone to see it";
    scene.notes.push_back({"thermal_extremes_lost", 1,
                           "The hottest reading of " + thermal.mesh.name + ", " + celsius_text(hottest) +
                               ", has no vertex of the scene at it: the scene's hottest has " + celsius_text(kept) +
                               advice,
                           true});
  }
  if (const auto [own_count, other_count] = join.side_counts(reach); own_count + other_count > 0) {
    scene.notes.push_back(
        {"thermal_sides", own_count + other_count,
         "Two sides of the scene are closer to each other than the points of " + thermal.mesh.name +
             " are: " + counted(own_count, "vertex takes", "vertices take") + " the nearest of the own side, " +
             counted(other_count, "vertex takes", "vertices take") + " one of the other, the own having none within " +
             base::distance_text(reach) + "; a point is of the side that it is nearest to",
         other_count > 0});
  }
  if (joined_count < count) {
    scene.notes.push_back({"thermal_not_reached", count - joined_count,
                           counted(count - joined_count, "vertex has", "vertices have") + " no thermal place within " +
                               base::distance_text(reach) + ": temperature missing"});
  }
  return base::success();
}

}  // namespace

base::Result<void> check_overlap(const LoadedScene& scene, const LoadedScene& thermal) {
  const Box scene_box = core_box(scene.mesh);
  const Box thermal_box = core_box(thermal.mesh);
  if (const auto ratio = unit_ratio(scene_box, thermal_box)) {
    const bool is_thermal_larger = *ratio > 1;
    const double factor = is_thermal_larger ? *ratio : 1 / *ratio;
    const std::string larger = is_thermal_larger ? thermal.mesh.name : scene.mesh.name;
    const std::string factor_text = number_text(std::round(factor * 100) / 100);
    return BOOST_OUTCOME_V2_NAMESPACE::failure(
        no_overlap(scene, thermal,
                   larger + " is " + factor_text + " times as large, as if in another unit; --scale " +
                       number_text(std::round(1e6 / factor) / 1e6) + " reads that file in the unit of the other"));
  }
  const double gap = scene_box.distance(thermal_box);
  if (gap > kMostReach * std::max(scene_box.diagonal(), thermal_box.diagonal())) {
    return BOOST_OUTCOME_V2_NAMESPACE::failure(
        no_overlap(scene, thermal,
                   "they are " + base::distance_text(gap) + " apart (the scene spans " + range_text(scene_box) +
                       ", the thermal file " + range_text(thermal_box) +
                       "); bring both into one frame, and see --scale if their units differ"));
  }
  return base::success();
}

bool sizes_agree(const LoadedScene& scene, const LoadedScene& thermal) {
  constexpr double kSameSize = 0.1;
  constexpr double kLeastOfUnits = 2.5;  // an inch has 2.54 centimetres
  const Box scene_box = core_box(scene.mesh);
  const Box thermal_box = core_box(thermal.mesh);
  if (const auto ratio = ratio_of_same_shape(scene_box, thermal_box)) return std::abs(*ratio - 1) < kSameSize;
  const double ratio = thermal_box.diagonal() / scene_box.diagonal();
  return ratio < kLeastOfUnits && ratio > 1 / kLeastOfUnits;
}

base::Result<void> join_thermal(const LoadedScene& thermal, double join_distance_m, LoadedScene& scene,
                                const base::Progress& progress) {
  mesh::MultispectralMesh& mesh = scene.mesh;
  const Box scene_box = core_box(mesh);
  const Box thermal_box = core_box(thermal.mesh);
  if (thermal.mesh.vertex_count() == mesh.vertex_count()) {
    const double tolerance = std::max(kSamePlace * scene_box.diagonal(), file_rounding(scene_box));
    if (is_in_order(mesh, positions_in(mesh, thermal.mesh), tolerance)) {
      const std::span<const float> celsius = thermal.mesh.temperature_celsius();
      std::copy(celsius.begin(), celsius.end(), mesh.temperature_celsius().begin());
      mesh.confidence = thermal.mesh.confidence;
      scene.notes.push_back({"thermal_joined_in_order", mesh.vertex_count(),
                             "Temperatures of " + thermal.mesh.name + " taken in order: its " +
                                 std::to_string(mesh.vertex_count()) + " vertices are where those of " + mesh.name +
                                 " are, within " + base::distance_text(tolerance)});
      return base::success();
    }
  }
  return join_by_place(thermal, join_distance_m, scene_box, thermal_box, scene, progress);
}

}  // namespace spectra::files
