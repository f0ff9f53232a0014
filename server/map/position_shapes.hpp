#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fusion/base/box.hpp"
#include "server/map/position_step.hpp"

/// What the parts of PositionSteps share.
namespace spectra::map::steps {

/// One in so many vertices of a few neighbours may fall together with another.
constexpr std::size_t kVerticesToMerged = 5;

/// More than a tile has steps from end to end.
constexpr std::uint8_t kMostHalvings = 24;

/// What is thinner beside its breadth is thin.
constexpr double kThin = 0x1p-12;
/// The same of a whole piece, which nobody takes for a wall that is not quite even.
constexpr double kThinPiece = 0x1p-15;
/// What is thinner than that is flat in any case: one tile of it would not have the steps.
constexpr double kFlat = 0x1p-20;
/// So many times what floats tell apart may be their rounding.
constexpr double kSpacings = 8;

inline std::array<float, 3> coordinates(const base::Vec3f& v) {
  return {v.x, v.y, v.z};
}

inline bool is_finite(const base::Vec3f& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

inline double longest_side(const base::Bounds& box) {
  return std::max({double{box.max.x} - double{box.min.x}, double{box.max.y} - double{box.min.y},
                   double{box.max.z} - double{box.min.z}});
}

/// How often `step_m` is halved until it is `wanted_m` or less.
inline std::uint8_t halvings_to(double wanted_m, double step_m) {
  if (wanted_m >= step_m) return 0;
  return static_cast<std::uint8_t>(std::min(std::ceil(std::log2(step_m / wanted_m)), double{kMostHalvings}));
}

/// A box of points and how it wants to be rounded.
struct Shape {
  base::Bounds bounds;
  std::array<double, 3> side{};
  std::array<double, 3> float_spacing{};  ///< Of coordinates as far out.

  explicit Shape(const base::Bounds& box) : bounds(box) {
    const auto low = coordinates(box.min), high = coordinates(box.max);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      side[axis] = double{high[axis]} - double{low[axis]};
      const double farthest = std::max(std::abs(double{low[axis]}), std::abs(double{high[axis]}));
      float_spacing[axis] = farthest > 0 ? std::ldexp(1, std::ilogb(farthest) - 23) : 0;
    }
  }

  StepHalvings within_precision(StepHalvings halvings, double step_m) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (float_spacing[axis] > 0) halvings[axis] = std::min(halvings[axis], halvings_to(float_spacing[axis], step_m));
    }
    return halvings;
  }

  /// What the points span there beside their breadth.
  double share_of_breadth(std::size_t axis) const {
    std::array<double, 3> sorted = side;
    std::sort(sorted.begin(), sorted.end());
    return side[axis] / sorted[1];
  }

  /// Whether they span something there that is neither thin nor rounding of floats.
  bool has_thickness(std::size_t axis, double thin = kThin) const {
    return side[axis] > kSpacings * float_spacing[axis] && share_of_breadth(axis) >= thin;
  }

  /// Whether what they span there is no flatness or rounding of floats. What is thin may be the rounding of another axis, too, by which
  /// all was turned once.
  bool has_side(std::size_t axis, double thin = kThin) const {
    if (has_thickness(axis, thin)) return true;
    const double coarsest = *std::max_element(float_spacing.begin(), float_spacing.end());
    return side[axis] > kSpacings * coarsest && share_of_breadth(axis) >= kFlat;
  }

  /// So that no side that is one changes by more than a tenth.
  StepHalvings for_sides(double step_of_side, double step_m, double thin = kThin) const {
    StepHalvings halvings{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (has_side(axis, thin)) halvings[axis] = halvings_to(step_of_side * side[axis], step_m);
    }
    return halvings;
  }
};

inline StepHalvings finer(const StepHalvings& a, const StepHalvings& b) {
  return {std::max(a[0], b[0]), std::max(a[1], b[1]), std::max(a[2], b[2])};
}

/// Never less than `to`, whoever else raises it.
inline void raise(std::uint8_t& value, std::uint8_t to) {
  const std::atomic_ref<std::uint8_t> shared(value);
  std::uint8_t now = shared.load(std::memory_order_relaxed);
  while (now < to && !shared.compare_exchange_weak(now, to, std::memory_order_relaxed)) {
  }
}

/// How many of these distinct positions fall together with another at steps of so much; where it is more than `enough`, any such number.
inline std::size_t merged_count(std::span<const base::Vec3f> positions, const std::array<double, 3>& steps_m,
                                std::size_t enough, std::vector<std::array<double, 3>>& rounded) {
  rounded.resize(positions.size());
  std::size_t merged = 0;
  for (std::size_t i = 0; i < positions.size() && merged <= enough; ++i) {
    const auto p = coordinates(positions[i]);
    for (std::size_t axis = 0; axis < 3; ++axis) rounded[i][axis] = std::floor(double{p[axis]} / steps_m[axis] + 0.5);
    const auto end = rounded.begin() + static_cast<std::ptrdiff_t>(i);
    if (std::find(rounded.begin(), end, rounded[i]) != end) ++merged;
  }
  return merged;
}

/// How often `step_m` is halved until all but `may_merge` of these distinct positions stay distinct.
inline std::uint8_t halvings_apart(std::span<const base::Vec3f> positions, std::size_t may_merge, double step_m) {
  std::vector<std::array<double, 3>> rounded;
  for (int halvings = 0; halvings < kMostHalvings; ++halvings) {
    const double step = std::ldexp(step_m, -halvings);
    if (merged_count(positions, {step, step, step}, may_merge, rounded) <= may_merge)
      return static_cast<std::uint8_t>(halvings);
  }
  return kMostHalvings;
}

}  // namespace spectra::map::steps

namespace spectra::map {

template <class Visit>
void PositionSteps::for_each_cell(const std::array<double, 3>& low, const std::array<double, 3>& high, Visit visit) {
  std::vector<std::uint32_t> open{0};
  while (!open.empty()) {
    const Node& node = nodes_[open.back()];
    open.pop_back();
    if (node.axis == kNoAxis) {
      visit(cells_[node.below]);
      continue;
    }
    if (low[node.axis] < double{node.split}) open.push_back(node.below);
    if (high[node.axis] >= double{node.split}) open.push_back(node.below + 1);
  }
}

}  // namespace spectra::map
