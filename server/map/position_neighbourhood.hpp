#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "server/map/position_shapes.hpp"
#include "server/map/position_step.hpp"

/// The vertices around a cell and the balls among them: what keeps the sides of balls (position_balls.cpp) works on.
namespace spectra::map::steps {

/// Balls of so many vertices or more are looked at; and in so many rings up to the largest one.
constexpr std::size_t kFewestOfBall = 50;
constexpr std::size_t kRings = 14;

/// The change of a side that is left to them.
constexpr double kMostSideChange = 0.0985;

/// Where the ends of the box of some vertices are, as they are and as they are rounded; those at the upper end negative, so that
/// every number is a least one.
struct Ends {
  static constexpr float kFar = std::numeric_limits<float>::infinity();
  std::array<float, 12> least{kFar, kFar, kFar, kFar, kFar, kFar, kFar, kFar, kFar, kFar, kFar, kFar};

  Ends() = default;
  Ends(const std::array<float, 3>& place, const std::array<float, 3>& rounded) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      least[axis] = place[axis];
      least[3 + axis] = rounded[axis];
      least[6 + axis] = -place[axis];
      least[9 + axis] = -rounded[axis];
    }
  }
  float low(std::size_t axis) const { return least[axis]; }
  float high(std::size_t axis) const { return -least[6 + axis]; }
  float rounded_low(std::size_t axis) const { return least[3 + axis]; }
  float rounded_high(std::size_t axis) const { return -least[9 + axis]; }

  bool operator==(const Ends&) const = default;

  void join(const Ends& other) {
    for (std::size_t i = 0; i < least.size(); ++i) least[i] = std::min(least[i], other.least[i]);
  }
  /// Whether a side changes by more than is left to it.
  bool are_off() const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float side = high(axis) - low(axis), rounded_side = rounded_high(axis) - rounded_low(axis);
      if (std::abs(rounded_side - side) > static_cast<float>(kMostSideChange) * side) return true;
    }
    return false;
  }
  /// Whether those of any part between `inner` and `outer`, which holds it, may be.
  static bool may_be_off_between(const Ends& inner, const Ends& outer) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float side = inner.high(axis) - inner.low(axis), most_side = outer.high(axis) - outer.low(axis);
      const float rounded_side = inner.rounded_high(axis) - inner.rounded_low(axis);
      const float most_rounded_side = outer.rounded_high(axis) - outer.rounded_low(axis);
      constexpr auto kMost = static_cast<float>(kMostSideChange);
      if (most_rounded_side > (1 + kMost) * side || rounded_side < (1 - kMost) * most_side) return true;
    }
    return false;
  }
};

}  // namespace spectra::map::steps

namespace spectra::map {

/// The vertices around a cell or a vertex, seen from a corner of it.
struct PositionSteps::Neighbourhood {
  std::array<float, 3> corner{};
  static constexpr std::array<float, 3> kFarthest{steps::Ends::kFar, steps::Ends::kFar, steps::Ends::kFar};
  double reach = 0;                      ///< Beyond a box, as far as they were looked for.
  bool wants_twins = false;              ///< Which of them fall together.
  bool are_too_many = false;             ///< Then there are none here.
  std::array<float, 3> coarsest_step{};  ///< Of any of them.
  std::vector<std::uint32_t> points;
  std::vector<std::uint32_t> changed;  ///< Those of `points` that were rounded anew in the last round.
  std::vector<std::array<float, 3>> place, rounded;
  std::vector<float> xs, ys, zs;            ///< Of `place`.
  std::vector<steps::Ends> ends;            ///< Of each alone.
  std::vector<float> distance;              ///< To a vertex of the cell, squared.
  std::vector<std::uint8_t> is_later_twin;  ///< Another one is rounded to the same place.
  std::vector<std::uint32_t> twins;
  std::vector<std::uint32_t> near, ball;
  std::vector<double> near_distance;  ///< Squared; which of two is nearer is told apart on a regular grid, too.
  std::vector<float> found;
  std::vector<std::uint32_t> ring;
  std::array<std::uint32_t, steps::kRings + 2> ring_begin{};
  std::vector<std::pair<double, std::uint32_t>> in_order;  ///< Distance and number, nearest first.

  void resize(std::size_t count) {
    place.resize(count);
    rounded.resize(count);
    for (auto* axis : {&xs, &ys, &zs}) axis->resize(count);
    ends.resize(count);
    distance.resize(count);
    near.resize(count);
    ball.resize(count);
    near_distance.resize(count);
    ring.resize(count);
  }

  /// Fills in `distance`.
  void measure_from(const std::array<float, 3>& center) {
    const std::size_t count = distance.size();
    for (std::size_t n = 0; n < count; ++n) {
      const float x = xs[n] - center[0], y = ys[n] - center[1], z = zs[n] - center[2];
      distance[n] = x * x + y * y + z * z;
    }
  }

  /// Fills in `near_distance` of the first `near_count` of `near`.
  void measure_near(const base::Vec3f& center, std::span<const Point> all, std::size_t near_count) {
    for (std::size_t n = 0; n < near_count; ++n) {
      const base::Vec3f& p = all[points[near[n]]].position;
      const double x = double{p.x} - double{center.x}, y = double{p.y} - double{center.y};
      const double z = double{p.z} - double{center.z};
      near_distance[n] = x * x + y * y + z * z;
    }
  }

  /// Puts those within a radius (squared) into `near`; returns how many.
  std::size_t gather(float radius) {
    std::size_t kept = 0;
    for (std::size_t n = 0; n < distance.size(); ++n) {
      near[kept] = static_cast<std::uint32_t>(n);
      kept += distance[n] <= radius ? 1u : 0u;
    }
    return kept;
  }

  /// Of the first `near_count` of `near`: in which ring around a ball each is; in it is 0, and beyond the last ring the last.
  void find_rings(std::size_t near_count, double radius, double width) {
    for (std::size_t n = 0; n < near_count; ++n) {
      const double beyond = (near_distance[n] - radius) / width;
      // Where floats end it is no number.
      const double at_most = beyond < steps::kRings ? beyond : steps::kRings;
      const double at_least = at_most > 0 ? at_most : 0;
      const auto below = static_cast<std::int32_t>(at_least);
      const std::int32_t above = below + (static_cast<double>(below) < at_least ? 1 : 0);
      ring[n] = near_distance[n] <= radius ? 0u : static_cast<std::uint32_t>(above);
    }
  }

  /// Fills in `is_later_twin`.
  void find_twins() {
    is_later_twin.assign(points.size(), 0);
    twins.resize(points.size());
    std::iota(twins.begin(), twins.end(), 0u);
    std::sort(twins.begin(), twins.end(), [&](std::uint32_t a, std::uint32_t b) { return rounded[a] < rounded[b]; });
    for (std::size_t i = 1; i < twins.size(); ++i) is_later_twin[twins[i]] = rounded[twins[i]] == rounded[twins[i - 1]];
  }
  /// Whether a fifth of some ball of the first `near_count` of `near` may fall together.
  bool may_be_merged(std::size_t near_count) const {
    std::size_t twin_count = 0;
    for (std::size_t n = 0; n < near_count; ++n) twin_count += is_later_twin[near[n]];
    return twin_count * steps::kVerticesToMerged > steps::kFewestOfBall;
  }

  /// Whether no rounding to such a `step` or a finer one could change a side of a ball (of a radius, squared; of the first `near_count` of
  /// `near`) by more than is left to it, nor of a larger one: each end is off by half a step at most.
  bool keeps_sides_around(float radius, std::size_t near_count, const std::array<float, 3>& step) const {
    std::array<float, 3> low = kFarthest, high = kFarthest;  // The upper ends negative.
    for (std::size_t n = 0; n < near_count; ++n) {
      if (distance[near[n]] > radius) continue;
      const std::array<float, 3>& p = place[near[n]];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], p[axis]);
        high[axis] = std::min(high[axis], -p[axis]);
      }
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!((-high[axis] - low[axis]) * static_cast<float>(steps::kMostSideChange) >= step[axis])) return false;
    }
    return true;
  }

  /// Fills in `in_order` and `ring_begin` by ring; in no order within one.
  void sort_by_ring(std::size_t near_count) {
    ring_begin.fill(0);
    for (std::size_t n = 0; n < near_count; ++n) ++ring_begin[ring[n] + 1];
    std::partial_sum(ring_begin.begin(), ring_begin.end(), ring_begin.begin());
    in_order.resize(near_count);
    std::array<std::uint32_t, steps::kRings + 2> next = ring_begin;
    for (std::size_t n = 0; n < near_count; ++n) in_order[next[ring[n]]++] = {near_distance[n], near[n]};
  }

  /// Of the first `near_count` of `near` (at least `count`): a radius that has `count` of them, or more where several are equally far.
  /// Bisection; several times faster here than std::nth_element.
  float radius_of(std::size_t count, std::size_t near_count) {
    float most = 0;
    found.resize(near_count);
    for (std::size_t n = 0; n < near_count; ++n) {
      found[n] = distance[near[n]];
      most = std::max(most, found[n]);
    }
    if (near_count == count) return most;
    float least = 0;
    for (;;) {
      const float middle = (least + most) / 2;
      if (!(middle > least && middle < most)) return most;
      std::uint32_t within = 0;
      for (std::size_t n = 0; n < near_count; ++n) within += found[n] <= middle ? 1u : 0u;
      if (within == count) return middle;
      (within < count ? least : most) = middle;
    }
  }
};

}  // namespace spectra::map
