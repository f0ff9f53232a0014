#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

#include "fusion/base/parallel_for.hpp"
#include "fusion/base/vector.hpp"
#include "fusion/mesh/nearest_surface.hpp"

namespace spectra::mesh {

namespace {

using base::cross;
using base::difference;
using base::dot;
using base::Vector;
using base::vector_of;

constexpr std::size_t kReportedAt = 4096;
/// Ordinary searches look at some ten leaves.
constexpr std::uint32_t kMostLeaves = 64;
constexpr std::size_t kSamples = 256;

/// What is far beyond any surface stays so.
float float_of(double value) {
  constexpr double kLargest = 1e30;
  return static_cast<float>(std::clamp(value, -kLargest, kLargest));
}

/// A distance that is beyond that is any.
float reach_of(double value) {
  constexpr double kAny = 1e29;
  return value < kAny ? static_cast<float>(value) : std::numeric_limits<float>::infinity();
}

}  // namespace

/// Looks from groups of positions at a list of elements, parts the group, and strikes from the list what is nearest to none of the part. What
/// is struck is told by the plane and the box of an element together: long triangles lie in the boxes of all groups, but near few of them.
class NearestSurface::Groups {
 public:
  Groups(const NearestSurface& surface, std::span<const base::Vec3f> from, double max_distance)
      : surface_(surface), from_(from), max_distance_(max_distance) {
    const Box all = box_between(vector_of(surface.nodes_[0].box.min), vector_of(surface.nodes_[0].box.max));
    middle_ = all.centre;
    const double diagonal = 2 * std::sqrt(dot(all.half, all.half));
    if (diagonal > 0) unit_ = diagonal;
    all_.elements.reserve(surface.elements_.size());
    for (auto& row : all_.rows) row.reserve(surface.elements_.size());
    for (const std::uint32_t element : surface.elements_) add_plane_of(element);
  }

  /// Reorders the indices.
  template <class Found>
  void run(std::span<std::uint32_t> indices, const Found& found) const {
    constexpr std::size_t kLeastOfThread = 256, kMostGroups = 16;
    const auto groups = parts_of(indices, kMostGroups, kLeastOfThread);
    base::parallel_for(groups.size(), [&](std::size_t i) { descend(groups[i], all_, 0, found); });
  }

 private:
  struct Box {
    Vector centre{}, half{};
  };
  /// A box as planes are told: about the middle of the surface, in its diagonals.
  struct Place {
    std::array<float, 3> centre{}, half{};
    float rounding = 0;
  };
  /// Of elements, the planes that they lie in and the boxes that they fill; no normal where there is no plane to rely on.
  struct Planes {
    enum Row { kNormal = 0, kCentre = 3, kHalf = 6, kOffset = 9, kRowCount = 10 };

    std::vector<std::uint32_t> elements;
    std::array<std::vector<float>, kRowCount> rows;  ///< For lanes.

    std::size_t size() const { return elements.size(); }
    /// Those of the places.
    Planes picked(std::span<const std::uint32_t> places) const {
      Planes some;
      some.elements.reserve(places.size());
      for (const std::uint32_t i : places) some.elements.push_back(elements[i]);
      for (std::size_t row = 0; row < kRowCount; ++row) {
        some.rows[row].resize(places.size());
        std::transform(places.begin(), places.end(), some.rows[row].begin(),
                       [&](std::uint32_t i) { return rows[row][i]; });
      }
      return some;
    }
  };

  static Box box_between(const Vector& low, const Vector& high) {
    Box box;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.centre[axis] = low[axis] + (high[axis] - low[axis]) / 2;
      box.half[axis] = (high[axis] - low[axis]) / 2;
    }
    return box;
  }

  Place place_of(const Box& box) const {
    constexpr float kRounding = 1e-6F;
    Place place;
    place.rounding = kRounding;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      place.centre[axis] = float_of((box.centre[axis] - middle_[axis]) / unit_);
      place.half[axis] = float_of(box.half[axis] / unit_);
      place.rounding += kRounding * (std::abs(place.centre[axis]) + place.half[axis]);
    }
    return place;
  }

  void add_plane_of(std::uint32_t element) {
    const base::Triangle corners = surface_.corners(element);
    const Vector a = vector_of(surface_.positions_[corners[0]]), b = vector_of(surface_.positions_[corners[1]]),
                 c = vector_of(surface_.positions_[corners[2]]);
    Vector low{}, high{}, from_middle{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min({a[axis], b[axis], c[axis]});
      high[axis] = std::max({a[axis], b[axis], c[axis]});
      from_middle[axis] = (a[axis] - middle_[axis]) / unit_;
    }
    const Place place = place_of(box_between(low, high));
    const Vector u = difference(b, a), v = difference(c, a);
    Vector normal = cross(u, v);
    constexpr double kSliver = 1e-12;
    const double squared = dot(normal, normal);
    const double scale = squared > kSliver * dot(u, u) * dot(v, v) ? 1 / std::sqrt(squared) : 0;
    for (double& along : normal) along = scale > 0 ? along * scale : 0;
    all_.elements.push_back(element);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      all_.rows[Planes::kNormal + axis].push_back(float_of(normal[axis]));
      all_.rows[Planes::kCentre + axis].push_back(place.centre[axis]);
      all_.rows[Planes::kHalf + axis].push_back(place.half[axis]);
    }
    all_.rows[Planes::kOffset].push_back(float_of(dot(normal, from_middle)));
  }

  static constexpr std::size_t kLanes = 256;
  /// For some elements: no point of them is nearer to the centre, or to anything in the box, but for rounding.
  struct Least {
    std::array<float, kLanes> of_centre, of_box;
  };

  static void look(const Planes& planes, std::size_t begin, std::size_t count, const Place& place, Least& least) {
    const auto larger = [](float a, float b) { return a < b ? b : a; };
    const auto row = [&](std::size_t i) { return planes.rows[i].data() + begin; };
    const float *nx = row(0), *ny = row(1), *nz = row(2), *cx = row(3), *cy = row(4), *cz = row(5), *hx = row(6),
                *hy = row(7), *hz = row(8), *offset = row(Planes::kOffset);
    const auto [x, y, z] = place.centre;
    const auto [half_x, half_y, half_z] = place.half;
    for (std::size_t i = 0; i < count; ++i) {
      const float to_x = std::abs(x - cx[i]) - hx[i] - half_x;
      const float to_y = std::abs(y - cy[i]) - hy[i] - half_y;
      const float to_z = std::abs(z - cz[i]) - hz[i] - half_z;
      const float to_box = larger(larger(to_x, to_y), larger(to_z, 0));
      const float to_plane = std::abs(nx[i] * x + ny[i] * y + nz[i] * z - offset[i]);
      const float of_plane = std::abs(nx[i]) * half_x + std::abs(ny[i]) * half_y + std::abs(nz[i]) * half_z;
      least.of_centre[i] = larger(to_box, to_plane);
      least.of_box[i] = larger(to_box, to_plane - of_plane);
    }
  }

  Search search_from(const Vector& position, double max_distance) const {
    Search search;
    search.position = position;
    search.best_squared = max_distance * max_distance;
    return search;
  }

  /// Offers those of the candidates that may be nearest; `of_box`, where it is given, is told of every one.
  void offer_all(const Planes& candidates, const Place& place, Search& search, std::vector<float>* of_box) const {
    const auto limit = [&] { return reach_of(std::sqrt(search.best_squared) / unit_) + place.rounding; };
    float most = limit();
    Least least{};
    for (std::size_t begin = 0; begin < candidates.size(); begin += kLanes) {
      const std::size_t count = std::min(kLanes, candidates.size() - begin);
      look(candidates, begin, count, place, least);
      if (of_box != nullptr)
        of_box->insert(of_box->end(), least.of_box.begin(), least.of_box.begin() + static_cast<std::ptrdiff_t>(count));
      for (std::size_t i = 0; i < count; ++i) {
        if (least.of_centre[i] > most) continue;
        surface_.offer(candidates.elements[begin + i], search);
        most = limit();
      }
    }
  }

  /// How far anything in the box is from the element at most: distances from what is convex are largest at a corner.
  double farthest(const Box& box, std::uint32_t element) const {
    double squared = 0;
    for (unsigned corner = 0; corner < 8; ++corner) {
      Vector position = box.centre;
      for (std::size_t axis = 0; axis < 3; ++axis)
        position[axis] += (corner >> axis & 1U) != 0 ? box.half[axis] : -box.half[axis];
      Search search = search_from(position, std::numeric_limits<double>::infinity());
      surface_.offer(element, search);
      squared = std::max(squared, search.best_squared);
    }
    return std::sqrt(squared);
  }

  Box box_of(std::span<const std::uint32_t> group) const {
    Vector low = vector_of(from_[group[0]]), high = low;
    for (const std::uint32_t index : group) {
      const Vector p = vector_of(from_[index]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], p[axis]);
        high[axis] = std::max(high[axis], p[axis]);
      }
    }
    return box_between(low, high);
  }

  std::size_t halve(std::span<std::uint32_t> group, const Box& box) const {
    const auto axis = std::max_element(box.half.begin(), box.half.end()) - box.half.begin();
    const std::size_t middle = group.size() / 2;
    std::nth_element(
        group.begin(), group.begin() + static_cast<std::ptrdiff_t>(middle), group.end(),
        [&](std::uint32_t a, std::uint32_t b) {
          return axis == 0 ? from_[a].x < from_[b].x : axis == 1 ? from_[a].y < from_[b].y : from_[a].z < from_[b].z;
        });
    return middle;
  }

  /// At most `most`, a power of two; of not much fewer than `fewest` each.
  std::vector<std::span<std::uint32_t>> parts_of(std::span<std::uint32_t> group, std::size_t most,
                                                 std::size_t fewest) const {
    std::vector<std::span<std::uint32_t>> parts{group};
    while (parts.size() < most && parts.front().size() > fewest) {
      std::vector<std::span<std::uint32_t>> halves;
      for (const std::span<std::uint32_t> part : parts) {
        const std::size_t middle = halve(part, box_of(part));
        halves.push_back(part.first(middle));
        halves.push_back(part.subspan(middle));
      }
      parts = std::move(halves);
    }
    return parts;
  }

  /// `near` is an element that is near to the group, to begin with.
  template <class Found>
  void descend(std::span<std::uint32_t> group, const Planes& candidates, std::uint32_t near, const Found& found) const {
    constexpr std::size_t kFewPositions = 2, kFewElements = 16, kParts = 8;
    if (group.size() <= kFewPositions || candidates.size() <= kFewElements) {
      for (const std::uint32_t index : group) {
        Search search = search_from(vector_of(from_[index]), max_distance_);
        if (candidates.size() > 0) {
          surface_.offer(near, search);
          offer_all(candidates, place_of({search.position, {}}), search, nullptr);
        }
        found(index, search);
      }
      return;
    }
    const Box box = box_of(group);
    const Place place = place_of(box);
    const double radius = std::sqrt(dot(box.half, box.half));
    Search centre = search_from(box.centre, std::numeric_limits<double>::infinity());
    surface_.offer(near, centre);
    std::vector<float> all_least;
    all_least.reserve(candidates.size());
    offer_all(candidates, place, centre, &all_least);
    const double most =
        std::min({std::sqrt(centre.best_squared) + radius, farthest(box, centre.element), max_distance_});
    const float limit = reach_of(most / unit_) + place.rounding;
    std::vector<std::uint32_t> places;
    for (std::uint32_t i = 0; i < candidates.size(); ++i) {
      if (!(all_least[i] > limit)) places.push_back(i);
    }
    const Planes kept = candidates.picked(places);
    all_least = {};
    places = {};
    for (const auto& part : parts_of(group, kParts, 1)) descend(part, kept, centre.element, found);
  }

  const NearestSurface& surface_;
  std::span<const base::Vec3f> from_;
  double max_distance_;
  Vector middle_{};
  double unit_ = 1;
  Planes all_;
};

void NearestSurface::find_at_corners(std::span<const base::Vec3f> from, std::vector<std::uint32_t>& indices,
                                     const std::function<void(std::size_t index, const Hit& hit)>& found) const {
  const auto is_before = [](const base::Vec3f& a, const base::Vec3f& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
  };
  std::sort(indices.begin(), indices.end(), [&](std::uint32_t a, std::uint32_t b) {
    return is_before(from[a], from[b]) || (!is_before(from[b], from[a]) && a < b);
  });
  std::vector<bool> is_found(indices.size());
  for (const std::uint32_t element : elements_) {
    const base::Triangle triangle = corners(element);
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const base::Vec3f& place = positions_[triangle[corner]];
      auto at = std::lower_bound(indices.begin(), indices.end(), place,
                                 [&](std::uint32_t index, const base::Vec3f& p) { return is_before(from[index], p); });
      for (; at != indices.end() && !is_before(place, from[*at]); ++at) {
        const auto i = static_cast<std::size_t>(at - indices.begin());
        if (is_found[i]) break;  // And with it all that are there.
        is_found[i] = true;
        Hit hit{triangle, {}, 0};
        hit.weights[corner] = 1;
        found(*at, hit);
      }
    }
  }
  std::size_t kept_count = 0;
  for (std::size_t i = 0; i < indices.size(); ++i) {
    if (!is_found[i]) indices[kept_count++] = indices[i];
  }
  indices.resize(kept_count);
}

void NearestSurface::find_all(std::span<const base::Vec3f> from, double max_distance,
                              const std::function<void(std::size_t index, const Hit& hit)>& found,
                              const std::function<void(std::size_t count)>& done) const {
  const auto is_easy = [&](std::size_t index, Search& state) {
    state.position = vector_of(from[index]);
    state.best_squared = max_distance * max_distance;
    state.most_leaves = kMostLeaves;
    return search(state);
  };
  std::size_t sample_count = 0, hard_count = 0;
  for (std::size_t i = 0; i < from.size(); i += 1 + from.size() / kSamples, ++sample_count) {
    Search state;
    hard_count += is_easy(i, state) ? 0U : 1U;
  }
  std::vector<std::uint32_t> hard;
  if (2 * hard_count > sample_count) {
    for (std::uint32_t i = 0; i < from.size(); ++i) hard.push_back(i);
  } else {
    const std::size_t range_count = (from.size() + kReportedAt - 1) / kReportedAt;
    std::vector<std::vector<std::uint32_t>> hard_of_range(range_count);
    base::parallel_for(range_count, [&](std::size_t range) {
      const std::size_t begin = range * kReportedAt, end = std::min(from.size(), begin + kReportedAt);
      for (std::size_t i = begin; i < end; ++i) {
        Search state;
        if (!is_easy(i, state)) {
          hard_of_range[range].push_back(static_cast<std::uint32_t>(i));
        } else if (state.has_hit) {
          found(i, hit_of(state));
        }
      }
      if (done) done(end - begin - hard_of_range[range].size());
    });
    for (const auto& some : hard_of_range) hard.insert(hard.end(), some.begin(), some.end());
  }
  if (hard.empty()) return;
  const std::size_t hard_before = hard.size();
  find_at_corners(from, hard, found);
  if (done) done(hard_before - hard.size());
  std::atomic<std::size_t> looked_count = 0;
  if (hard.empty()) return;
  Groups(*this, from, max_distance).run(hard, [&](std::size_t index, const Search& state) {
    if (state.has_hit) found(index, hit_of(state));
    if (done && ++looked_count % kReportedAt == 0) done(kReportedAt);
  });
}

}  // namespace spectra::mesh
