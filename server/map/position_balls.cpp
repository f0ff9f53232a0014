#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "server/map/position_shapes.hpp"
#include "server/map/position_step.hpp"

namespace spectra::map {

using namespace steps;

namespace {

/// Where one in so many of a cell falls together with another, balls that reach beyond it are looked at.
constexpr std::size_t kVerticesToCrowd = 16;

/// Balls around every vertex are looked at: of so many vertices, and in so many steps up to those of so much the
/// radius (squared; as many times the vertices, on a surface). What they may reach beyond the cell, in parts of its longest side; and the
/// change of a side that is left to them.
constexpr std::size_t kFewestOfBall = 50;
constexpr std::size_t kRings = 14;
constexpr float kLargestBall = 2.2F;
constexpr double kBallReach = 1;
constexpr double kSpareReach = 1.25;
constexpr double kMostSideChange = 0.0985;
constexpr int kMostRounds = 8;

/// Of more vertices around a cell it is not looked at: one of strays, far larger than its own vertices are from each other, that has
/// half the scene in its reach. Some 500 are usual.
constexpr std::size_t kMostAround = 1 << 14;

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

}  // namespace

/// The vertices around a cell, seen from a corner of it.
struct PositionSteps::Neighbourhood {
  std::array<float, 3> corner{};
  static constexpr std::array<float, 3> kFarthest{Ends::kFar, Ends::kFar, Ends::kFar};
  double reach = 0;                      ///< Beyond the cell, as far as they were looked for.
  std::array<float, 3> coarsest_step{};  ///< Of any of them.
  std::vector<std::uint32_t> points;
  std::vector<std::uint32_t> changed;  ///< Those of `points` that were rounded anew in the last round.
  std::vector<std::array<float, 3>> place, rounded;
  std::vector<float> xs, ys, zs;            ///< Of `place`.
  std::vector<Ends> ends;                   ///< Of each alone.
  std::vector<float> distance;              ///< To a vertex of the cell, squared.
  std::vector<std::uint8_t> is_later_twin;  ///< Another one is rounded to the same place.
  std::vector<std::uint32_t> twins;
  std::vector<std::uint32_t> near, ball;
  std::vector<float> near_distance;
  std::vector<std::uint32_t> ring;
  std::array<std::uint32_t, kRings + 2> ring_begin{};
  std::vector<std::pair<float, std::uint32_t>> in_order;  ///< Distance and number, nearest first.

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

  /// Squared.
  float distance_from(const std::array<float, 3>& center, std::size_t n) const {
    const std::array<float, 3>& p = place[n];
    const float x = p[0] - center[0], y = p[1] - center[1], z = p[2] - center[2];
    return x * x + y * y + z * z;
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
  void find_rings(std::size_t near_count, float radius, float width) {
    for (std::size_t n = 0; n < near_count; ++n) near_distance[n] = distance[near[n]];
    for (std::size_t n = 0; n < near_count; ++n) {
      const float beyond = (near_distance[n] - radius) / width;
      // Where floats end it is no number.
      const float at_most = beyond < kRings ? beyond : kRings;
      const float at_least = at_most > 0 ? at_most : 0;
      const auto below = static_cast<std::int32_t>(at_least);
      const std::int32_t above = below + (static_cast<float>(below) < at_least ? 1 : 0);
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
    return twin_count * kVerticesToMerged > kFewestOfBall;
  }

  /// Whether no step could change a side of a ball (of a radius, squared; of the first `near_count` of `near`) by more than is left to
  /// it, nor of a larger one: each end is off by half a step at most.
  bool keeps_sides_around(float radius, std::size_t near_count) const {
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
      if (!((-high[axis] - low[axis]) * static_cast<float>(kMostSideChange) >= coarsest_step[axis])) return false;
    }
    return true;
  }

  /// Fills in `in_order` and `ring_begin` by ring; in no order within one.
  void sort_by_ring(std::size_t near_count) {
    ring_begin.fill(0);
    for (std::size_t n = 0; n < near_count; ++n) ++ring_begin[ring[n] + 1];
    std::partial_sum(ring_begin.begin(), ring_begin.end(), ring_begin.begin());
    in_order.resize(near_count);
    std::array<std::uint32_t, kRings + 2> next = ring_begin;
    for (std::size_t n = 0; n < near_count; ++n) in_order[next[ring[n]]++] = {near_distance[n], near[n]};
  }

  /// Of the first `near_count` of `near` (at least `count`): a radius that has `count` of them, or more where several are equally far.
  /// Bisection; several times faster here than std::nth_element.
  float radius_of(std::size_t count, std::size_t near_count) {
    float most = 0;
    for (std::size_t n = 0; n < near_count; ++n) {
      near_distance[n] = distance[near[n]];
      most = std::max(most, near_distance[n]);
    }
    if (near_count == count) return most;
    float least = 0;
    for (;;) {
      const float middle = (least + most) / 2;
      if (!(middle > least && middle < most)) return most;
      std::uint32_t within = 0;
      for (std::size_t n = 0; n < near_count; ++n) within += near_distance[n] <= middle ? 1u : 0u;
      if (within == count) return middle;
      (within < count ? least : most) = middle;
    }
  }
};

template <class Visit>
void PositionSteps::for_each_cell_around(const Cell& cell, double reach, Visit visit) {
  std::array<double, 3> low{}, high{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    low[axis] = double{coordinates(cell.bounds.min)[axis]} - reach;
    high[axis] = double{coordinates(cell.bounds.max)[axis]} + reach;
  }
  for_each_cell(low, high, visit);
}

bool PositionSteps::is_crowded(const Cell& cell) {
  const auto step_m = static_cast<double>(largest_step_m_);
  std::array<double, 3> steps_m{};
  for (std::size_t axis = 0; axis < 3; ++axis) steps_m[axis] = std::ldexp(step_m, -cell.halvings[axis]);
  std::vector<base::Vec3f> positions;
  for (std::uint32_t i = cell.begin; i < cell.end; ++i) positions.push_back(points_[i].position);
  const std::size_t most = positions.size() / kVerticesToCrowd;
  std::vector<std::array<double, 3>> rounded;
  return merged_count(positions, steps_m, most, rounded) > most;
}

void PositionSteps::keep_sides(jobs::WorkerPool& pool) {
  constexpr std::size_t kChunk = 16;
  halvings_.resize(points_.size());
  for (const Cell& cell : cells_) {
    std::fill(halvings_.begin() + cell.begin, halvings_.begin() + cell.end, cell.halvings);
  }
  pool.for_each((cells_.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
    for (std::size_t c = chunk * kChunk; c < std::min(cells_.size(), (chunk + 1) * kChunk); ++c) {
      cells_[c].is_crowded = is_crowded(cells_[c]);
    }
  });
  const Planes planes = find_planes();
  keep_flat(planes, halvings_);
  SidesRound round{.is_changed = std::vector<std::uint8_t>(points_.size(), 1),
                   .radius = std::vector<float>(points_.size()),
                   .wanted = halvings_};
  for (int i = 0; i < kMostRounds; ++i) {
    round.is_first = i == 0;
    pool.for_each((cells_.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
      Neighbourhood around;
      for (std::size_t c = chunk * kChunk; c < std::min(cells_.size(), (chunk + 1) * kChunk); ++c) {
        keep_sides_in(cells_[c], around, round);
      }
    });
    keep_flat(planes, round.wanted);
    bool is_any_changed = false;
    for (Cell& cell : cells_) {
      cell.is_changed = false;
      for (std::uint32_t p = cell.begin; p < cell.end; ++p) {
        round.is_changed[p] = halvings_[p] == round.wanted[p] ? 0 : 1;
        cell.is_changed = cell.is_changed || round.is_changed[p] != 0;
      }
      is_any_changed = is_any_changed || cell.is_changed;
    }
    halvings_ = round.wanted;
    if (!is_any_changed) break;
  }
}

PositionSteps::Planes PositionSteps::find_planes() const {
  Planes planes;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<float> flat;
    for (const Cell& cell : cells_) {
      const float low = coordinates(cell.bounds.min)[axis];
      if (cell.end - cell.begin > 1 && low == coordinates(cell.bounds.max)[axis]) flat.push_back(low);
    }
    std::sort(flat.begin(), flat.end());
    flat.erase(std::unique(flat.begin(), flat.end()), flat.end());
    planes[axis].resize(flat.size());
    if (flat.empty()) continue;
    for (std::uint32_t p = 0; p < points_.size(); ++p) {
      const float at = coordinates(points_[p].position)[axis];
      const auto found = std::lower_bound(flat.begin(), flat.end(), at);
      if (found == flat.end() || *found != at) continue;
      planes[axis][static_cast<std::size_t>(found - flat.begin())].push_back(p);
    }
  }
  return planes;
}

void PositionSteps::keep_flat(const Planes& planes, std::vector<StepHalvings>& halvings) const {
  const auto step_m = static_cast<double>(largest_step_m_);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const std::vector<std::uint32_t>& plane : planes[axis]) {
      std::uint8_t finest = 0;
      for (const std::uint32_t p : plane) finest = std::max(finest, halvings[p][axis]);
      const double at = double{coordinates(points_[plane.front()].position)[axis]};
      const auto rounded = [&](int fineness) {
        const double step = std::ldexp(step_m, -fineness);
        return std::floor(at / step + 0.5) * step;
      };
      std::uint8_t coarsest = finest;
      while (coarsest > 0 && rounded(coarsest - 1) == rounded(finest)) --coarsest;
      for (const std::uint32_t p : plane) halvings[p][axis] = std::max(halvings[p][axis], coarsest);
    }
  }
}

void PositionSteps::gather_around(const Cell& cell, double reach, Neighbourhood& around, const SidesRound& round) {
  const auto step_m = static_cast<double>(largest_step_m_);
  around.reach = reach;
  around.corner = coordinates(cell.bounds.min);
  around.points.clear();
  around.changed.clear();
  for_each_cell_around(cell, reach, [&](const Cell& other) {
    if (around.points.size() > kMostAround) return;
    for (std::uint32_t i = other.begin; i < other.end; ++i) {
      if (round.is_changed[i] != 0) around.changed.push_back(static_cast<std::uint32_t>(around.points.size()));
      around.points.push_back(i);
    }
  });
  if (around.points.size() > kMostAround) {
    around.points.clear();
    around.changed.clear();
  }
  const std::size_t count = around.points.size();
  around.resize(count);
  around.coarsest_step = {};
  std::array<double, kMostHalvings + 1> steps_m{};
  for (std::size_t h = 0; h < steps_m.size(); ++h) steps_m[h] = std::ldexp(step_m, -static_cast<int>(h));
  for (std::size_t n = 0; n < count; ++n) {
    const std::uint32_t point = around.points[n];
    const auto p = coordinates(points_[point].position);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double step = steps_m[halvings_[point][axis]];
      around.coarsest_step[axis] = std::max(around.coarsest_step[axis], static_cast<float>(step));
      around.place[n][axis] = static_cast<float>(double{p[axis]} - double{around.corner[axis]});
      around.rounded[n][axis] =
          static_cast<float>(std::floor(double{p[axis]} / step + 0.5) * step - double{around.corner[axis]});
    }
    around.ends[n] = Ends(around.place[n], around.rounded[n]);
    around.xs[n] = around.place[n][0];
    around.ys[n] = around.place[n][1];
    around.zs[n] = around.place[n][2];
  }
  if (cell.is_crowded) around.find_twins();
}

void PositionSteps::keep_sides_in(const Cell& cell, Neighbourhood& around, SidesRound& round) {
  double reach = longest_side(cell.bounds) * kBallReach;
  if (!round.is_first) {
    const auto largest = std::max_element(round.radius.begin() + cell.begin, round.radius.begin() + cell.end);
    if (*largest < 0) return;
    reach = std::sqrt(double{*largest} * double{kLargestBall});
    bool is_any_changed = false;
    for_each_cell_around(cell, reach, [&](const Cell& other) { is_any_changed = is_any_changed || other.is_changed; });
    if (!is_any_changed) return;
  }
  gather_around(cell, reach, around, round);
  constexpr float kSafe =
      -1;  // Instead of a radius: no further look is needed, as steps only get finer, or none is taken.
  constexpr float kEverywhere = std::numeric_limits<float>::infinity();
  float radius = kEverywhere;  // Of the smallest ball around the vertex before; all squared.
  for (std::uint32_t seed = cell.begin; seed < cell.end; ++seed) {
    std::array<float, 3> center = coordinates(points_[seed].position);
    for (std::size_t axis = 0; axis < 3; ++axis)
      center[axis] = static_cast<float>(double{center[axis]} - double{around.corner[axis]});
    if (around.points.size() < kFewestOfBall) {
      round.radius[seed] = kSafe;
      continue;
    }
    if (!round.is_first) {
      radius = round.radius[seed];
      if (radius == kSafe) continue;
      // Where nothing has changed since it was looked at nothing else would come of it.
      const bool is_any_near = std::any_of(around.changed.begin(), around.changed.end(), [&](std::uint32_t n) {
        return around.distance_from(center, n) <= radius * kLargestBall;
      });
      if (!is_any_near) continue;
    }
    around.measure_from(center);
    if (round.is_first) {
      // Among few, if it is about as large as the one before.
      std::size_t few_count = around.gather(radius * 1.5F);
      if (few_count < kFewestOfBall) few_count = around.gather(kEverywhere);
      radius = around.radius_of(kFewestOfBall, few_count);
      const double wanted_reach = std::sqrt(double{radius} * double{kLargestBall});
      if (wanted_reach > around.reach && std::isfinite(wanted_reach) && around.points.size() < points_.size()) {
        // It may be smaller then.
        gather_around(cell, kSpareReach * wanted_reach, around, round);
        if (around.points.size() < kFewestOfBall) {
          round.radius[seed] = kSafe;
          continue;
        }
        around.measure_from(center);
        radius = around.radius_of(kFewestOfBall, around.gather(radius));
      }
      round.radius[seed] = radius;
    }
    const std::size_t near_count = around.gather(radius * kLargestBall);
    if (cell.is_crowded && around.may_be_merged(near_count)) keep_apart(around, near_count, round.wanted);
    const bool is_safe = around.keeps_sides_around(radius, near_count);
    if (is_safe && !cell.is_crowded) round.radius[seed] = kSafe;
    if (is_safe) continue;
    // What each ring between a ball and the next larger one adds to it.
    const float ring_width = radius * (kLargestBall - 1) / kRings;
    around.find_rings(near_count, radius, ring_width);
    std::array<Ends, kRings + 1> rings;
    for (std::size_t n = 0; n < near_count; ++n) rings[around.ring[n]].join(around.ends[around.near[n]]);
    Ends ball = rings[0];
    around.in_order.clear();
    Ends kept_ends;
    const auto keep_ball = [&](const Ends& ends, float ball_radius) {
      // Another vertex between the same ends asks for nothing else.
      if (ends == kept_ends) return;
      kept_ends = ends;
      std::size_t kept = 0;
      for (std::size_t n = 0; n < near_count; ++n) {
        around.ball[kept] = around.near[n];
        kept += around.near_distance[n] <= ball_radius ? 1u : 0u;
      }
      keep_sides_of(around, std::span(around.ball).first(kept), round.wanted);
    };
    if (ball.are_off()) keep_ball(ball, radius);
    for (std::uint32_t ring = 1; ring <= kRings; ++ring) {
      const Ends before = ball;
      ball.join(rings[ring]);
      if (!Ends::may_be_off_between(before, ball)) continue;
      if (around.in_order.empty()) around.sort_by_ring(near_count);
      const auto in_ring = std::span(around.in_order)
                               .subspan(around.ring_begin[ring], around.ring_begin[ring + 1] - around.ring_begin[ring]);
      std::sort(in_ring.begin(), in_ring.end());
      // Each ball that ends within it.
      Ends growing = before;
      for (std::size_t i = 0; i < in_ring.size(); ++i) {
        const auto [distance, n] = in_ring[i];
        growing.join(around.ends[n]);
        const bool is_ball = i + 1 == in_ring.size() || in_ring[i + 1].first > distance;
        if (is_ball && growing.are_off()) keep_ball(growing, distance);
      }
    }
  }
}

void PositionSteps::keep_apart(Neighbourhood& around, std::size_t near_count, std::vector<StepHalvings>& wanted) {
  around.in_order.clear();
  for (std::size_t i = 0; i < near_count; ++i)
    around.in_order.emplace_back(around.distance[around.near[i]], around.near[i]);
  std::sort(around.in_order.begin(), around.in_order.end());
  std::map<std::array<float, 3>, std::uint32_t> first_at;
  std::vector<std::uint32_t> merged;
  std::size_t merged_in_crowd = 0;  // Of `merged`, those in the largest ball of which too many fall together.
  for (std::size_t i = 0; i < near_count; ++i) {
    const auto [distance, n] = around.in_order[i];
    const auto [first, is_new] = first_at.try_emplace(around.rounded[n], n);
    if (!is_new) {
      merged.push_back(n);
      merged.push_back(first->second);
    }
    const bool is_ball = i + 1 >= kFewestOfBall && (i + 1 == near_count || around.in_order[i + 1].first > distance);
    if (is_ball && (i + 1 - first_at.size()) * kVerticesToMerged > i + 1) merged_in_crowd = merged.size();
  }
  for (const std::uint32_t n : std::span(merged).first(merged_in_crowd)) {
    const std::uint32_t point = around.points[n];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const int finer_by_one = std::min(halvings_[point][axis] + 1, int{most_halvings_});
      raise(wanted[point][axis], static_cast<std::uint8_t>(finer_by_one));
    }
  }
}

void PositionSteps::keep_sides_of(const Neighbourhood& around, std::span<const std::uint32_t> ball,
                                  std::vector<StepHalvings>& wanted) {
  constexpr auto kMost = static_cast<float>(kMostSideChange);
  Ends ends;
  for (const std::uint32_t n : ball) ends.join(around.ends[n]);
  std::array<float, 3> low{}, high{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    low[axis] = ends.low(axis);
    high[axis] = ends.high(axis);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float side = high[axis] - low[axis];
    const float at_low = low[axis] - ends.rounded_low(axis), at_high = ends.rounded_high(axis) - high[axis];
    if (std::abs(at_low + at_high) <= kMost * side) continue;
    const auto absolute = [&](const std::array<float, 3>& p) {
      return base::Vec3f{p[0] + around.corner[0], p[1] + around.corner[1], p[2] + around.corner[2]};
    };
    if (!Shape({absolute(low), absolute(high)}).has_side(axis)) continue;
    // One end where that is enough: the worse one.
    const float most = kMost * side;
    const bool is_low_worse = std::abs(at_low) > std::abs(at_high);
    const float other = is_low_worse ? at_high : at_low;
    const bool are_both = std::abs(other) > 0.75F * most;
    if (is_low_worse || are_both)
      keep_end(around, ball, axis, low[axis], -1, are_both ? -most / 2 : -most - other,
               are_both ? most / 2 : most - other, wanted);
    if (!is_low_worse || are_both)
      keep_end(around, ball, axis, high[axis], 1, are_both ? -most / 2 : -most - other,
               are_both ? most / 2 : most - other, wanted);
  }
}

void PositionSteps::keep_end(const Neighbourhood& around, std::span<const std::uint32_t> ball, std::size_t axis,
                             float end, int direction, float least, float most, std::vector<StepHalvings>& wanted) {
  const auto step_m = static_cast<double>(largest_step_m_);
  const auto sign = static_cast<float>(direction);
  // How far beyond the end.
  const auto beyond = [&](float there) { return sign * (there - end); };
  const bool is_lost =
      std::none_of(ball.begin(), ball.end(), [&](std::uint32_t n) { return beyond(around.rounded[n][axis]) >= least; });
  for (const std::uint32_t n : ball) {
    const bool is_end = is_lost && around.place[n][axis] == end;
    const std::uint32_t point = around.points[n];
    const double at = double{coordinates(points_[point].position)[axis]};
    int halvings = halvings_[point][axis];
    float there = around.rounded[n][axis];
    while ((beyond(there) > most || (is_end && beyond(there) < least)) && halvings < int{most_halvings_}) {
      const double step = std::ldexp(step_m, -++halvings);
      there = static_cast<float>(std::floor(at / step + 0.5) * step - double{around.corner[axis]});
    }
    raise(wanted[point][axis], static_cast<std::uint8_t>(halvings));
  }
}

}  // namespace spectra::map
