#include "fusion/files/coordinate_hole.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

namespace spectra::files {

namespace {

constexpr std::size_t kFewestInAHole = 12;
constexpr std::size_t kFewestElsewhere = 12;
constexpr std::size_t kMoreThanAnyOther = 8;
constexpr std::size_t kManyNumbers = 12;
constexpr std::size_t kManyRuns = 12;
/// Different ones, as they are measured; no form is built ring by ring of so many.
constexpr std::size_t kMeasuredNumbers = 100;
/// Distances are compared with the size of the scene.
constexpr double kFar = 2, kVeryFar = 16, kFartherThanAnyForm = 1000, kBeyondAllForms = 1e9;

constexpr std::array<double base::Vec3d::*, 3> kAxes = {&base::Vec3d::x, &base::Vec3d::y, &base::Vec3d::z};

enum class NumberKind { Any, Round, WrittenForNone };

/// Written for none are nines (also -9999.9) and the ends of whole numbers of 16 bits (also in millimetres, when the file has
/// metres, as of depth cameras) and more, and sometimes powers of ten.
NumberKind kind_of(double number) {
  const double size = std::abs(number);
  const auto is = [size](double other) { return std::abs(size - other) <= 1e-7 * other; };
  if (is(65.535) || is(32.767) || is(32.768)) return NumberKind::WrittenForNone;
  constexpr double kLeastBelow = 998, kLeastAbove = 9990;
  if (size < (number < 0 ? kLeastBelow : kLeastAbove)) return NumberKind::Any;
  for (const int bits : {15, 16, 31, 32, 63, 64}) {
    if (is(std::ldexp(1, bits)) || is(std::ldexp(1, bits) - 1)) return NumberKind::WrittenForNone;
  }
  const double power = std::pow(10, std::round(std::log10(size)));
  if (is(power)) return NumberKind::Round;
  return is(power - 1) || is(power - 0.1) || is(power - 0.01) ? NumberKind::WrittenForNone : NumberKind::Any;
}

/// The least of many numbers.
struct Extreme {
  double value = std::numeric_limits<double>::infinity();
  std::size_t count = 0;
  double next = std::numeric_limits<double>::infinity();  ///< The nearest other.

  void add(double number) {
    if (number < value) {
      next = std::exchange(value, number);
      count = 1;
    } else if (number == value) {
      ++count;
    } else {
      next = std::min(next, number);
    }
  }
};

class Finder {
 public:
  Finder(std::span<const SampledVertex> vertices, double metres, const IsUsed& is_used)
      : vertices_(vertices), metres_(metres), is_used_(is_used) {}

  CoordinateHoles find() const {
    CoordinateHoles holes;
    for (std::size_t axis = 0; axis < kAxes.size(); ++axis) {
      Extreme lowest, highest;
      for (const SampledVertex& vertex : vertices_) {
        lowest.add(vertex.position.*kAxes[axis]);
        highest.add(-(vertex.position.*kAxes[axis]));
      }
      const double low = lowest.value;
      const double high = -highest.value;
      judge({axis, low, lowest.count, lowest.next - low, high - lowest.next}, holes);
      if (!holes.certain) judge({axis, high, highest.count, high + highest.next, -highest.next - low}, holes);
      const double low_gap = lowest.next - low, high_gap = high + highest.next;
      const double between = -highest.next - lowest.next;
      const bool are_both_shared = lowest.count >= kFewestInAHole && highest.count >= kFewestInAHole;
      if (!holes.certain && are_both_shared && between >= 0 && std::min(low_gap, high_gap) > between) {
        const CoordinateHoles of_low = without({axis, low, lowest.count, low_gap, between}, high);
        const CoordinateHoles of_high = without({axis, high, highest.count, high_gap, between}, low);
        if (of_low.certain && of_high.certain) holes.certain = of_low.certain;
        if (!of_low.possible.empty() && !of_high.possible.empty()) {
          holes.possible.push_back(of_low.possible.front());
          holes.possible.push_back(of_high.possible.front());
        }
      }
      if (holes.certain) return {holes.certain, {}};
    }
    return holes;
  }

 private:
  struct Candidate {
    std::size_t axis = 0;
    double value = 0;
    std::size_t count = 0;
    double gap = 0;              ///< To the nearest other.
    double range_of_others = 0;  ///< From the least to the greatest of them.
  };

  /// What the vertices tell that have another number, and those that have it.
  struct Evidence {
    std::size_t most_of_others = 0;     ///< That are one number.
    std::size_t numbers_of_others = 0;  ///< That are different.
    bool is_among_others = true;        ///< Does not widen them in the two other coordinates.
    double size = 0;                    ///< Of the scene without this coordinate, and of the others in it.
    std::size_t run_count = 0;          ///< In the order of the file.
    bool is_used = false;
  };

  /// What is found of a number at one end where those at the other are no vertices.
  CoordinateHoles without(const Candidate& candidate, double other_end) const {
    std::vector<SampledVertex> rest;
    std::copy_if(vertices_.begin(), vertices_.end(), std::back_inserter(rest),
                 [&](const SampledVertex& vertex) { return vertex.position.*kAxes[candidate.axis] != other_end; });
    CoordinateHoles holes;
    Finder(rest, metres_, is_used_).judge(candidate, holes);
    return holes;
  }

  void judge(const Candidate& candidate, CoordinateHoles& holes) const {
    if (candidate.count < kFewestInAHole || vertices_.size() - candidate.count < kFewestElsewhere) return;
    if (!(candidate.gap > candidate.range_of_others)) return;
    Hole hole{{}, {false, false, false}};
    hole.place.*kAxes[candidate.axis] = candidate.value;
    hole.axes[candidate.axis] = true;
    const Evidence evidence = evidence_for(candidate);
    const NumberKind kind = kind_of(candidate.value / metres_);
    if (is_certain(candidate, kind, evidence)) {
      holes.certain = hole;
    } else if (is_possible(candidate, kind, evidence)) {
      holes.possible.push_back({hole, static_cast<double>(candidate.count) / static_cast<double>(vertices_.size())});
    }
  }

  Evidence evidence_for(const Candidate& candidate) const {
    const auto axis = kAxes[candidate.axis];
    Evidence evidence;
    std::vector<double> others;
    std::vector<std::pair<std::uint64_t, bool>> in_order;
    for (const SampledVertex& vertex : vertices_) {
      const bool is_in = vertex.position.*axis == candidate.value;
      in_order.emplace_back(vertex.vertex, is_in);
      if (!is_in) others.push_back(vertex.position.*axis);
      evidence.is_used = evidence.is_used || (is_in && is_used_(vertex.vertex));
    }
    std::sort(others.begin(), others.end());
    for (std::size_t begin = 0, end = 0; begin < others.size(); begin = end) {
      while (end < others.size() && others[end] == others[begin]) ++end;
      evidence.most_of_others = std::max(evidence.most_of_others, end - begin);
      ++evidence.numbers_of_others;
    }
    std::sort(in_order.begin(), in_order.end());
    bool was_in = false;
    for (const auto& [vertex, is_in] : in_order) {
      evidence.run_count += is_in && !was_in ? 1U : 0U;
      was_in = is_in;
    }
    std::array<double, 3> ranges{0, 0, candidate.range_of_others};
    for (std::size_t i = 1; i < kAxes.size(); ++i) {
      const auto [all, without] = ranges_of((candidate.axis + i) % kAxes.size(), candidate);
      // Cells at the rim may be without a height, too; a base is often wider than what stands on it.
      constexpr double kMostWidening = 1.5;
      evidence.is_among_others = evidence.is_among_others && all <= kMostWidening * without;
      ranges[i - 1] = all;
    }
    // A floor far below all else is as wide as the scene.
    evidence.size = std::hypot(ranges[0], ranges[1], ranges[2]);
    return evidence;
  }

  /// Of all, and of those that have another number.
  std::pair<double, double> ranges_of(std::size_t axis, const Candidate& candidate) const {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    std::array<double, 2> low = {kInfinity, kInfinity};
    std::array<double, 2> high = {-kInfinity, -kInfinity};
    for (const SampledVertex& vertex : vertices_) {
      const double at = vertex.position.*kAxes[axis];
      for (std::size_t i = 0; i < (vertex.position.*kAxes[candidate.axis] == candidate.value ? 1U : 2U); ++i) {
        low[i] = std::min(low[i], at);
        high[i] = std::max(high[i], at);
      }
    }
    return {high[0] - low[0], high[1] - low[1]};
  }

  static bool is_certain(const Candidate& candidate, NumberKind kind, const Evidence& evidence) {
    // Two places, say: what is far is told by how large the scene is.
    if (!(evidence.size > 0)) return false;
    const auto is_away = [&](double sizes) { return candidate.gap > sizes * evidence.size; };
    if (is_away(kBeyondAllForms)) return true;
    if (kind == NumberKind::WrittenForNone) {
      return !evidence.is_used || evidence.numbers_of_others >= kManyNumbers || is_away(kFartherThanAnyForm);
    }
    if (evidence.numbers_of_others < kMeasuredNumbers &&
        (evidence.numbers_of_others < kManyNumbers || candidate.count < kMoreThanAnyOther * evidence.most_of_others)) {
      return false;
    }
    if (!evidence.is_among_others || evidence.run_count < kManyRuns) return false;
    if (!evidence.is_used) return is_away(kFar);
    return is_away(kind == NumberKind::Round ? kVeryFar : kFartherThanAnyForm);
  }

  static bool is_possible(const Candidate& candidate, NumberKind kind, const Evidence& evidence) {
    if (kind != NumberKind::Any) return evidence.numbers_of_others >= kManyNumbers;
    constexpr double kLikely = 1.0 / 8, kMoreThanOthersAre = 4;
    return candidate.gap > kLikely * evidence.size && candidate.gap > kMoreThanOthersAre * candidate.range_of_others &&
           candidate.count >= kMoreThanAnyOther * evidence.most_of_others;
  }

  std::span<const SampledVertex> vertices_;
  double metres_;
  const IsUsed& is_used_;
};

}  // namespace

bool stands_for_none(const base::Vec3d& place, double sizes, bool is_used) {
  if (!(sizes > 1)) return false;
  return !is_used || sizes > kFartherThanAnyForm || is_written_for_none(place);
}

bool is_written_for_none(const base::Vec3d& place) {
  const bool is_one_number = place.x == place.y && place.y == place.z;
  return std::all_of(kAxes.begin(), kAxes.end(), [&](const auto axis) {
    const double number = place.*axis;
    const NumberKind kind = kind_of(number);
    return number == 0 || kind == NumberKind::WrittenForNone || (kind == NumberKind::Round && is_one_number);
  });
}

CoordinateHoles find_coordinate_holes(std::span<const SampledVertex> vertices, double metres, const IsUsed& is_used) {
  return Finder(vertices, metres, is_used).find();
}

}  // namespace spectra::files
