#include "fusion/files/position_sample.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <tuple>

namespace spectra::files {

namespace {

constexpr std::uint64_t kMostEntries = 16'384;
constexpr std::size_t kFewestInAHole = 12;
constexpr std::size_t kFewestElsewhere = 12;
/// Where many places have several vertices each, none of them is a hole.
constexpr std::size_t kMoreThanAnyOther = 8;
constexpr double kBulkReach = 32;

constexpr std::array<double base::Vec3d::*, 3> kAxes = {&base::Vec3d::x, &base::Vec3d::y, &base::Vec3d::z};

bool is_finite(const base::Vec3d& p) {
  constexpr double kFloatMax = std::numeric_limits<float>::max();
  return std::abs(p.x) <= kFloatMax && std::abs(p.y) <= kFloatMax && std::abs(p.z) <= kFloatMax;
}

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// From a box to a point; 0 inside.
double distance(const Bulk& box, const base::Vec3d& p) {
  std::array<double, 3> gap{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double at = p.*kAxes[axis];
    gap[axis] = std::max({0.0, box.min.*kAxes[axis] - at, at - box.max.*kAxes[axis]});
  }
  return std::hypot(gap[0], gap[1], gap[2]);
}

/// The least or greatest of many numbers, and how it stands to the others.
struct Extreme {
  double value = 0;
  std::size_t count = 0;
  double gap = 0;                  ///< To the nearest other.
  double range_of_others = 0;      ///< From the least to the greatest of them.
  std::size_t most_of_others = 0;  ///< That are one number.
};

template <class Iterator>
Extreme extreme_of(Iterator first, Iterator last) {
  Extreme extreme;
  if (first == last) return extreme;
  extreme.value = *first;
  const Iterator others = std::find_if(first, last, [&](double value) { return value != extreme.value; });
  extreme.count = static_cast<std::size_t>(others - first);
  if (others == last) return extreme;
  extreme.gap = std::abs(*others - extreme.value);
  extreme.range_of_others = std::abs(*std::prev(last) - *others);
  for (Iterator begin = others, end = others; begin != last; begin = end) {
    while (end != last && *end == *begin) ++end;
    extreme.most_of_others = std::max(extreme.most_of_others, static_cast<std::size_t>(end - begin));
  }
  return extreme;
}

Extreme lowest_of(const std::vector<double>& sorted) {
  return extreme_of(sorted.begin(), sorted.end());
}
Extreme highest_of(const std::vector<double>& sorted) {
  return extreme_of(sorted.rbegin(), sorted.rend());
}

/// Numbers that are written for none: powers of ten, nines (also -9999.9), and the ends of whole numbers of 16 bits and more.
bool is_customary_none(double number) {
  const double size = std::abs(number);
  const auto is = [size](double other) { return std::abs(size - other) <= 1e-7 * other; };
  constexpr double kLeastBelow = 998, kLeastAbove = 9990;
  if (size < (number < 0 ? kLeastBelow : kLeastAbove)) return false;
  for (const int bits : {15, 16, 31, 32, 63, 64}) {
    if (is(std::ldexp(1, bits)) || is(std::ldexp(1, bits) - 1)) return true;
  }
  const double power = std::pow(10, std::round(std::log10(size)));
  return is(power) || is(power - 1) || is(power - 0.1) || is(power - 0.01);
}

}  // namespace

double Bulk::extent() const {
  return std::max({max.x - min.x, max.y - min.y, max.z - min.z});
}

PositionSample::PositionSample(std::uint64_t vertex_count)
    : bucket_size_(std::max<std::uint64_t>(1, (vertex_count + kMostEntries - 1) / kMostEntries)) {
  entries_.reserve(static_cast<std::size_t>(std::min(vertex_count, kMostEntries)));
  choose_next();
}

/// One vertex of every bucket.
void PositionSample::choose_next() {
  constexpr std::uint64_t kMixer = 0x9E37'79B9'7F4A'7C15U;
  next_vertex_ = bucket_ * bucket_size_ + ((bucket_ + 1) * kMixer >> 33U) % bucket_size_;
  ++bucket_;
}

void PositionSample::add(std::uint64_t first_vertex, std::span<const base::Vec3d> positions) {
  for (; next_vertex_ < first_vertex + positions.size(); choose_next()) {
    const base::Vec3d& position = positions[static_cast<std::size_t>(next_vertex_ - first_vertex)];
    if (is_finite(position)) entries_.push_back({next_vertex_, position});
  }
}

void PositionSample::conclude(double metres) {
  find_hole();
  find_coordinate_hole(metres);
  find_bulk();
  if (!hole_) return;
  if (!bulk_) {
    hole_.reset();
    return;
  }
  const double size = std::hypot(bulk_->max.x - bulk_->min.x, bulk_->max.y - bulk_->min.y, bulk_->max.z - bulk_->min.z);
  hole_->is_far = distance(*bulk_, hole_->place) > size;
}

void PositionSample::find_hole() {
  const auto key = [](const Entry& entry) {
    return std::tuple(entry.position.x, entry.position.y, entry.position.z, entry.vertex);
  };
  std::sort(entries_.begin(), entries_.end(), [&](const Entry& a, const Entry& b) { return key(a) < key(b); });
  std::size_t most = 0;
  std::size_t second = 0;
  std::size_t most_begin = 0;
  for (std::size_t begin = 0, end = 0; begin < entries_.size(); begin = end) {
    while (end < entries_.size() && entries_[end].position == entries_[begin].position) ++end;
    if (end - begin > most) {
      second = most;
      most = end - begin;
      most_begin = begin;
    } else {
      second = std::max(second, end - begin);
    }
  }
  if (most < kFewestInAHole || most < kMoreThanAnyOther * second || entries_.size() - most < kFewestElsewhere) return;
  const auto first = entries_.begin() + static_cast<std::ptrdiff_t>(most_begin);
  const auto last = first + static_cast<std::ptrdiff_t>(most);
  hole_ = {first->position, {}, false};
  for (auto entry = first; entry != last; ++entry) hole_->vertices.push_back(entry->vertex);
  entries_.erase(first, last);
}

void PositionSample::find_coordinate_hole(double metres) {
  std::vector<double> sorted(entries_.size());
  const auto sort = [&](std::size_t axis) {
    std::transform(entries_.begin(), entries_.end(), sorted.begin(),
                   [axis](const Entry& entry) { return entry.position.*kAxes[axis]; });
    std::sort(sorted.begin(), sorted.end());
  };
  std::array<double, 3> ranges{};
  for (std::size_t axis = 0; axis < kAxes.size() && !sorted.empty(); ++axis) {
    sort(axis);
    ranges[axis] = sorted.back() - sorted.front();
  }
  for (std::size_t axis = 0; axis < kAxes.size(); ++axis) {
    sort(axis);
    for (const Extreme& extreme : {lowest_of(sorted), highest_of(sorted)}) {
      if (extreme.count < kFewestInAHole || entries_.size() - extreme.count < kFewestElsewhere) continue;
      if (!(extreme.gap > extreme.range_of_others)) continue;
      Hole hole{{}, {false, false, false}};
      hole.place.*kAxes[axis] = extreme.value;
      hole.axes[axis] = true;
      // A floor far below all else is as wide as the scene.
      const double size = std::hypot(ranges[(axis + 1) % 3], ranges[(axis + 2) % 3], extreme.range_of_others);
      constexpr double kCertain = 2, kLikely = 1.0 / 8, kMoreThanOthersAre = 4;
      if (is_customary_none(extreme.value / metres) || extreme.gap > kCertain * size) {
        std::erase_if(entries_, [&hole](const Entry& entry) { return hole.has(entry.position); });
        coordinate_hole_ = hole;
        shared_coordinate_.reset();
        return;
      }
      if (extreme.gap > kLikely * size && extreme.gap > kMoreThanOthersAre * extreme.range_of_others &&
          extreme.count >= kMoreThanAnyOther * extreme.most_of_others) {
        shared_coordinate_ = {hole, static_cast<double>(extreme.count) / static_cast<double>(entries_.size())};
      }
    }
  }
}

void PositionSample::find_bulk() {
  if (entries_.empty()) return;
  base::Vec3d middle;
  double half = 0;
  std::vector<double> values(entries_.size());
  for (const auto axis : kAxes) {
    const auto coordinate = [axis](const Entry& entry) { return entry.position.*axis; };
    std::transform(entries_.begin(), entries_.end(), values.begin(), coordinate);
    middle.*axis = median(values);
    for (double& value : values) value = std::abs(value - middle.*axis);
    half = std::max(half, median(values));
  }
  if (half == 0) return;
  Bulk bulk{middle, middle};
  for (const Entry& entry : entries_) {
    const bool is_near = std::all_of(kAxes.begin(), kAxes.end(), [&](const auto axis) {
      return std::abs(entry.position.*axis - middle.*axis) <= kBulkReach * half;
    });
    if (!is_near) continue;
    for (const auto axis : kAxes) {
      bulk.min.*axis = std::min(bulk.min.*axis, entry.position.*axis);
      bulk.max.*axis = std::max(bulk.max.*axis, entry.position.*axis);
    }
  }
  bulk_ = bulk;
}

}  // namespace spectra::files
