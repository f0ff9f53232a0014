#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "server/map/position_neighbourhood.hpp"
#include "server/map/position_shapes.hpp"
#include "server/map/position_step.hpp"

namespace spectra::map {

using namespace steps;

namespace {

/// Where one in so many of a cell falls together with another, balls that reach beyond it are looked at.
constexpr std::size_t kVerticesToCrowd = 16;

/// Balls around every vertex are looked at, from the smallest up to those of so much the radius (squared; as many times the vertices, on a
/// surface); larger ones, up to so many times that, around one vertex of a cell: around its neighbours they are nearly the same.
constexpr float kLargestBall = 2.2F;
constexpr float kLargestOfCell = 10;
constexpr int kMostRounds = 8;
/// About what share of the time is over when they begin, and after the first; each other one takes half of what is left then.
constexpr double kRoundsBegin = 0.04;
constexpr double kFirstRoundEnd = 0.64;

/// What they may reach beyond the cell, in parts of its longest side; and what is looked for where they reach farther.
constexpr double kBallReach = 1;
constexpr double kSpareReach = 1.25;

/// Of more vertices around a cell each of its own is looked at with what is around it alone: a wide cell, with something dense within its
/// reach. Some 500 are usual.
constexpr std::size_t kMostAround = 1 << 14;
constexpr int kMostReaches = 40;

/// Instead of the radius of a ball: no further look is needed, as steps only get finer, or none is taken; and all that there is.
constexpr float kSafe = -1;
constexpr float kEverywhere = std::numeric_limits<float>::infinity();

double squared_gap(const base::Bounds& a, const base::Bounds& b) {
  double sum = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double gap = std::max({0.0, double{coordinates(a.min)[axis]} - double{coordinates(b.max)[axis]},
                                 double{coordinates(b.min)[axis]} - double{coordinates(a.max)[axis]}});
    sum += gap * gap;
  }
  return sum;
}

}  // namespace

template <class Visit>
void PositionSteps::for_each_cell_around(const base::Bounds& box, double reach, Visit visit) {
  std::array<double, 3> low{}, high{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    low[axis] = double{coordinates(box.min)[axis]} - reach;
    high[axis] = double{coordinates(box.max)[axis]} + reach;
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

void PositionSteps::keep_sides(jobs::WorkerPool& pool, const std::function<void(double)>& found_share) {
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
  double begin_share = kRoundsBegin, end_share = kFirstRoundEnd;
  for (int i = 0; i < kMostRounds; ++i) {
    round.is_first = i == 0;
    const std::size_t chunk_count = (cells_.size() + kChunk - 1) / kChunk;
    std::atomic<std::size_t> done_count{0};
    pool.for_each(chunk_count, [&](std::size_t chunk) {
      Neighbourhood around;
      for (std::size_t c = chunk * kChunk; c < std::min(cells_.size(), (chunk + 1) * kChunk); ++c) {
        keep_sides_in(cells_[c], around, round);
      }
      if (!found_share) return;
      const double of_round = static_cast<double>(++done_count) / static_cast<double>(chunk_count);
      found_share(begin_share + of_round * (end_share - begin_share));
    });
    begin_share = std::exchange(end_share, (end_share + 1) / 2);
    keep_flat(planes, round.wanted);
    keep_pieces_apart(round.wanted, round.is_first);
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

void PositionSteps::gather_around(const base::Bounds& box, double reach, Neighbourhood& around,
                                  const SidesRound& round) {
  const auto step_m = static_cast<double>(largest_step_m_);
  around.reach = reach;
  around.corner = coordinates(box.min);
  around.points.clear();
  around.changed.clear();
  for_each_cell_around(box, reach, [&](const Cell& other) {
    if (around.points.size() > kMostAround || squared_gap(other.bounds, box) > reach * reach) return;
    for (std::uint32_t i = other.begin; i < other.end; ++i) {
      if (round.is_changed[i] != 0) around.changed.push_back(static_cast<std::uint32_t>(around.points.size()));
      around.points.push_back(i);
    }
  });
  around.are_too_many = around.points.size() > kMostAround;
  if (around.are_too_many) {
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
  if (around.wants_twins) around.find_twins();
}

float PositionSteps::gather_alone(std::uint32_t seed, double first_reach, Neighbourhood& around, SidesRound& round) {
  const base::Bounds box{points_[seed].position, points_[seed].position};
  const auto smallest_ball = [&] {
    around.measure_from({});
    return around.radius_of(kFewestOfBall, around.gather(kEverywhere));
  };
  float& radius = round.radius[seed];
  if (round.is_first) {
    radius = kSafe;
    double few = 0, many = std::numeric_limits<double>::infinity(), reach = first_reach;
    for (int i = 0; i < kMostReaches; ++i) {
      gather_around(box, reach, around, round);
      if (around.points.size() >= kFewestOfBall || around.points.size() == points_.size()) break;
      (around.are_too_many ? many : few) = reach;
      reach = std::isfinite(many) ? (few + many) / 2 : 2 * reach;
    }
    if (around.points.size() < kFewestOfBall) return 0;
    // Farther out than was looked it may be smaller.
    const float farthest = smallest_ball();
    gather_around(box, kSpareReach * std::sqrt(double{farthest}), around, round);
    if (around.are_too_many) gather_around(box, reach, around, round);
    radius = smallest_ball();
  }
  for (const float largest : {kLargestBall, 1.8F, 1.4F, 1.1F}) {
    gather_around(box, std::sqrt(double{radius} * double{largest}), around, round);
    if (!around.are_too_many) return largest;
  }
  radius = kSafe;
  return 0;
}

void PositionSteps::keep_sides_in(const Cell& cell, Neighbourhood& around, SidesRound& round) {
  double reach = longest_side(cell.bounds) * kBallReach;
  if (!round.is_first) {
    const auto largest = std::max_element(round.radius.begin() + cell.begin, round.radius.begin() + cell.end);
    if (*largest < 0) return;
    reach = std::sqrt(double{*largest} * double{kLargestBall});
    bool is_any_changed = false;
    for_each_cell_around(cell.bounds, reach,
                         [&](const Cell& other) { is_any_changed = is_any_changed || other.is_changed; });
    if (!is_any_changed) return;
  }
  around.wants_twins = cell.is_crowded;
  gather_around(cell.bounds, reach, around, round);
  bool is_each_alone = around.are_too_many;
  float radius_of_large = kSafe;
  float last_radius = kEverywhere;
  for (std::uint32_t seed = cell.begin; seed < cell.end; ++seed) {
    float& radius = round.radius[seed];  // Of the smallest ball around it; squared.
    if (!round.is_first && radius == kSafe) continue;
    const base::Vec3f& at = points_[seed].position;
    float largest_ball = kLargestBall;
    std::array<float, 3> center{};
    const auto see_from_corner = [&] {
      for (std::size_t axis = 0; axis < 3; ++axis)
        center[axis] = static_cast<float>(double{coordinates(at)[axis]} - double{around.corner[axis]});
      around.measure_from(center);
    };
    if (round.is_first && !is_each_alone) {
      if (around.points.size() < kFewestOfBall) {
        radius = kSafe;
        continue;
      }
      see_from_corner();
      // Among few, if it is about as large as the one before.
      std::size_t few_count = around.gather(last_radius * 1.5F);
      if (few_count < kFewestOfBall) few_count = around.gather(kEverywhere);
      radius = around.radius_of(kFewestOfBall, few_count);
      const double wanted_reach = std::sqrt(double{radius} * double{kLargestBall});
      if (wanted_reach > around.reach && std::isfinite(wanted_reach) && around.points.size() < points_.size()) {
        // It may be smaller then.
        gather_around(cell.bounds, kSpareReach * wanted_reach, around, round);
        is_each_alone = around.are_too_many;
        if (!is_each_alone) {
          see_from_corner();
          radius = around.radius_of(kFewestOfBall, around.gather(radius));
        }
      }
      last_radius = radius;
    }
    if (is_each_alone) {
      largest_ball = gather_alone(seed, longest_side(cell.bounds), around, round);
      if (radius == kSafe) continue;
    }
    see_from_corner();
    // Where nothing has changed since it was looked at nothing else would come of it.
    if (!round.is_first && std::none_of(around.changed.begin(), around.changed.end(),
                                        [&](std::uint32_t n) { return around.distance[n] <= radius * largest_ball; })) {
      continue;
    }
    const std::size_t near_count = around.gather(radius * largest_ball);
    if (cell.is_crowded && around.may_be_merged(near_count)) keep_apart(around, near_count, round.wanted);
    const bool is_safe = around.keeps_sides_around(radius, near_count, around.coarsest_step);
    if (seed == cell.begin && round.is_first) {
      const float any = largest_step_m_;
      if (!around.keeps_sides_around(kEverywhere, near_count, {any, any, any})) radius_of_large = radius * kLargestBall;
    }
    if (!is_safe) {
      around.measure_near(at, points_, near_count);
      keep_balls_of(around, near_count, radius, largest_ball, round.wanted);
    } else if (!cell.is_crowded) {
      radius = kSafe;
    }
  }
  if (radius_of_large != kSafe) keep_large_balls_at(cell.begin, radius_of_large, around, round);
}

void PositionSteps::keep_large_balls_at(std::uint32_t seed, float radius, Neighbourhood& around, SidesRound& round) {
  const base::Vec3f& at = points_[seed].position;
  gather_around({at, at}, std::sqrt(double{radius} * double{kLargestOfCell}), around, round);
  around.measure_from({});
  const std::size_t near_count = around.gather(radius * kLargestOfCell);
  if (near_count < kFewestOfBall || around.keeps_sides_around(radius, near_count, around.coarsest_step)) return;
  around.measure_near(at, points_, near_count);
  keep_balls_of(around, near_count, radius, kLargestOfCell, round.wanted);
}

void PositionSteps::keep_balls_of(Neighbourhood& around, std::size_t near_count, float smallest, float largest,
                                  std::vector<StepHalvings>& wanted) {
  // A little less: those about as far as the farthest of the smallest ball each count by their own distance.
  const double radius = double{smallest} * (1 - 0x1p-16);
  // What each ring between a ball and the next larger one adds to it.
  around.find_rings(near_count, radius, radius * (double{largest} - 1) / kRings);
  std::array<Ends, kRings + 1> rings;
  for (std::size_t n = 0; n < near_count; ++n) rings[around.ring[n]].join(around.ends[around.near[n]]);
  Ends kept_ends;
  const auto keep_ball = [&](const Ends& ends, double ball_radius) {
    // Another vertex between the same ends asks for nothing else.
    if (ends == kept_ends) return;
    kept_ends = ends;
    std::size_t kept = 0;
    for (std::size_t n = 0; n < near_count; ++n) {
      around.ball[kept] = around.near[n];
      kept += around.near_distance[n] <= ball_radius ? 1u : 0u;
    }
    keep_sides_of(around, std::span(around.ball).first(kept), wanted);
  };
  around.sort_by_ring(near_count);
  Ends ball = rings[0];
  if (around.ring_begin[1] >= kFewestOfBall && ball.are_off()) keep_ball(ball, radius);
  for (std::uint32_t ring = 1; ring <= kRings; ++ring) {
    const Ends before = ball;
    ball.join(rings[ring]);
    if (!Ends::may_be_off_between(before, ball)) continue;
    const std::size_t begin = around.ring_begin[ring], end = around.ring_begin[ring + 1];
    std::sort(around.in_order.begin() + static_cast<std::ptrdiff_t>(begin),
              around.in_order.begin() + static_cast<std::ptrdiff_t>(end));
    // Each ball that ends within it.
    Ends growing = before;
    for (std::size_t i = begin; i < end; ++i) {
      const auto [distance, n] = around.in_order[i];
      growing.join(around.ends[n]);
      const bool is_ball = i + 1 >= kFewestOfBall && (i + 1 == end || around.in_order[i + 1].first > distance);
      if (is_ball && growing.are_off()) keep_ball(growing, distance);
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
