#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <thread>
#include <tuple>
#include <vector>

#include "fusion/mesh/nearest_surface.hpp"

namespace spectra::mesh {

namespace {

using Vector = std::array<double, 3>;

constexpr std::size_t kReportedAt = 4096;
/// Ordinary searches look at some ten leaves.
constexpr std::uint32_t kMostLeaves = 64;
constexpr std::size_t kSamples = 256;

Vector vector_of(const base::Vec3f& p) {
  return {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
}
Vector difference(const Vector& a, const Vector& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
double dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

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

/// Calls `work(i)` for each of 0..count once, in as many threads as there are processors.
template <class Work>
void for_each_of(std::size_t count, const Work& work) {
  std::atomic<std::size_t> next = 0;
  const auto run = [&] {
    for (std::size_t i = next++; i < count; i = next++) work(i);
  };
  std::vector<std::jthread> threads;
  const std::size_t thread_count = std::min<std::size_t>(std::max(1U, std::thread::hardware_concurrency()), count);
  for (std::size_t i = 1; i < thread_count; ++i) threads.emplace_back(run);
  run();
}

}  // namespace

/// Looks from groups of positions at a list of elements, halves the group, and strikes from the list what is nearest to none of the half. What
/// is struck is told by the plane and the box of an element together: long triangles lie in the boxes of all groups, but near few of them.
class NearestSurface::Groups {
 public:
  Groups(const NearestSurface& surface, std::span<const base::Vec3f> from, double max_distance)
      : surface_(surface), from_(from), max_distance_(max_distance) {
    const Box all = box_between(vector_of(surface.nodes_[0].box.min), vector_of(surface.nodes_[0].box.max));
    middle_ = all.centre;
    const double diagonal = 2 * std::sqrt(dot(all.half, all.half));
    if (diagonal > 0) unit_ = diagonal;
    planes_.reserve(surface.elements_.size());
    for (const std::uint32_t element : surface.elements_) planes_.push_back(plane_of(element));
  }

  /// Reorders the indices.
  template <class Found>
  void run(std::span<std::uint32_t> indices, const Found& found) const {
    constexpr std::size_t kLeastOfThread = 256, kMostGroups = 16;
    std::vector<std::span<std::uint32_t>> groups{indices};
    while (groups.size() < kMostGroups && groups.front().size() > kLeastOfThread) {
      std::vector<std::span<std::uint32_t>> halves;
      for (const std::span<std::uint32_t> group : groups) {
        const std::size_t middle = halve(group, box_of(group));
        halves.push_back(group.first(middle));
        halves.push_back(group.subspan(middle));
      }
      groups = std::move(halves);
    }
    std::vector<std::uint32_t> all(planes_.size());
    for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
    for_each_of(groups.size(), [&](std::size_t i) { descend(groups[i], all, 0, found); });
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
  /// The plane that a triangle lies in and the box that it fills; no normal where there is no plane to rely on.
  struct Plane {
    std::array<float, 3> normal{};
    float offset = 0;
    std::array<float, 3> centre{}, half{};
  };
  struct Least {
    float of_centre, of_box;
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

  Plane plane_of(std::uint32_t element) const {
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
    Plane plane{{}, 0, place.centre, place.half};
    const Vector u = difference(b, a), v = difference(c, a);
    const Vector normal = cross(u, v);
    constexpr double kSliver = 1e-12;
    const double squared = dot(normal, normal);
    if (!(squared > kSliver * dot(u, u) * dot(v, v))) return plane;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      plane.normal[axis] = float_of(normal[axis] / std::sqrt(squared));
    }
    plane.offset = float_of(dot(normal, from_middle) / std::sqrt(squared));
    return plane;
  }

  /// No point of the element is nearer to the centre, or to anything in the box, but for rounding.
  static Least least(const Plane& plane, const Place& place) {
    float to_box = 0, to_plane = -plane.offset, of_plane = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      to_box =
          std::max(to_box, std::abs(place.centre[axis] - plane.centre[axis]) - plane.half[axis] - place.half[axis]);
      to_plane += plane.normal[axis] * place.centre[axis];
      of_plane += std::abs(plane.normal[axis]) * place.half[axis];
    }
    to_plane = std::abs(to_plane);
    return {std::max(to_box, to_plane), std::max(to_box, to_plane - of_plane)};
  }

  Search search_from(const Vector& position, double max_distance) const {
    Search search;
    search.position = position;
    search.best_squared = max_distance * max_distance;
    return search;
  }

  /// Offers those of the candidates that may be nearest; `all_least`, where it is given, is told of every one.
  void offer_all(std::span<const std::uint32_t> candidates, const Place& place, Search& search,
                 std::vector<float>* all_least) const {
    const auto limit = [&] { return reach_of(std::sqrt(search.best_squared) / unit_) + place.rounding; };
    float most = limit();
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const Least nearest = least(planes_[candidates[i]], place);
      if (all_least != nullptr) (*all_least)[i] = nearest.of_box;
      if (nearest.of_centre > most) continue;
      surface_.offer(surface_.elements_[candidates[i]], search);
      most = limit();
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

  /// `near` is an element that is near to the group, to begin with.
  template <class Found>
  void descend(std::span<std::uint32_t> group, std::span<const std::uint32_t> candidates, std::uint32_t near,
               const Found& found) const {
    constexpr std::size_t kFewPositions = 2, kFewElements = 16;
    if (group.size() <= kFewPositions || candidates.size() <= kFewElements) {
      for (const std::uint32_t index : group) {
        Search search = search_from(vector_of(from_[index]), max_distance_);
        if (!candidates.empty()) {
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
    std::vector<float> all_least(candidates.size());
    offer_all(candidates, place, centre, &all_least);
    const double most =
        std::min({std::sqrt(centre.best_squared) + radius, farthest(box, centre.element), max_distance_});
    const float limit = reach_of(most / unit_) + place.rounding;
    std::vector<std::uint32_t> kept;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (!(all_least[i] > limit)) kept.push_back(candidates[i]);
    }
    all_least = {};
    const std::size_t middle = halve(group, box);
    descend(group.first(middle), kept, centre.element, found);
    descend(group.subspan(middle), kept, centre.element, found);
  }

  const NearestSurface& surface_;
  std::span<const base::Vec3f> from_;
  double max_distance_;
  Vector middle_{};
  double unit_ = 1;
  std::vector<Plane> planes_;  ///< Of elements_.
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
    for_each_of(range_count, [&](std::size_t range) {
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
