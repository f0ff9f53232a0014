#include "fusion/files/position_sample.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

namespace spectra::files {

namespace {

constexpr std::uint64_t kMostEntries = 16'384;
constexpr std::size_t kFewestInAHole = 12;
constexpr std::size_t kFewestElsewhere = 12;
/// Where many places have several vertices each, none of them is a hole.
constexpr std::size_t kMoreThanAnyOther = 8;
constexpr std::size_t kMostHoles = 4;
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

void PositionSample::conclude(double metres, const IsUsed& is_used) {
  find_holes();
  while (coordinate_holes_.size() < kMostHoles) {
    CoordinateHoles found = find_coordinate_holes(entries_, metres, is_used);
    shared_coordinates_ = std::move(found.possible);
    if (!found.certain) break;
    coordinate_holes_.push_back(*found.certain);
    std::erase_if(entries_, [&](const SampledVertex& entry) { return found.certain->has(entry.position); });
  }
  find_bulk();
  if (!bulk_) {
    holes_.clear();
    return;
  }
  const double size = std::hypot(bulk_->max.x - bulk_->min.x, bulk_->max.y - bulk_->min.y, bulk_->max.z - bulk_->min.z);
  for (HolePlace& hole : holes_) {
    hole.is_used = std::any_of(hole.vertices.begin(), hole.vertices.end(), is_used);
    const base::Vec3d in_file = {hole.place.x / metres, hole.place.y / metres, hole.place.z / metres};
    hole.is_certain = (hole.place == base::Vec3d{} && !hole.is_used) ||
                      stands_for_none(in_file, distance(*bulk_, hole.place) / size, hole.is_used);
    // The two ends of a tank whose triangles share no vertices are crowded like that.
    hole.is_suspect = holes_.size() == 1 || !hole.is_used || is_written_for_none(in_file);
  }
}

void PositionSample::find_holes() {
  const auto key = [](const SampledVertex& entry) {
    return std::tuple(entry.position.x, entry.position.y, entry.position.z, entry.vertex);
  };
  std::sort(entries_.begin(), entries_.end(),
            [&](const SampledVertex& a, const SampledVertex& b) { return key(a) < key(b); });
  struct Run {
    std::size_t begin = 0, count = 0;
  };
  std::array<Run, kMostHoles + 1> runs{};  // The longest, from the longest on.
  for (std::size_t begin = 0, end = 0; begin < entries_.size(); begin = end) {
    while (end < entries_.size() && entries_[end].position == entries_[begin].position) ++end;
    if (end - begin <= runs.back().count) continue;
    runs.back() = {begin, end - begin};
    for (std::size_t i = kMostHoles; i > 0 && runs[i].count > runs[i - 1].count; --i) std::swap(runs[i], runs[i - 1]);
  }
  std::size_t hole_count = 0;
  std::size_t rest = entries_.size();
  for (std::size_t i = 0; i < kMostHoles && runs[i].count >= kFewestInAHole; ++i) {
    rest -= runs[i].count;
    if (rest < kFewestElsewhere) break;
    if (runs[i].count >= kMoreThanAnyOther * runs[i + 1].count) hole_count = i + 1;
  }
  for (std::size_t i = 0; i < hole_count; ++i) {
    const auto first = entries_.begin() + static_cast<std::ptrdiff_t>(runs[i].begin);
    HolePlace& hole = holes_.emplace_back();
    hole.place = first->position;
    std::for_each_n(first, runs[i].count, [&](const SampledVertex& entry) { hole.vertices.push_back(entry.vertex); });
  }
  std::erase_if(entries_, [this](const SampledVertex& entry) {
    return std::any_of(holes_.begin(), holes_.end(),
                       [&](const HolePlace& hole) { return hole.place == entry.position; });
  });
}

void PositionSample::find_bulk() {
  if (entries_.empty()) return;
  base::Vec3d middle;
  double half = 0;
  std::vector<double> values(entries_.size());
  for (const auto axis : kAxes) {
    const auto coordinate = [axis](const SampledVertex& entry) { return entry.position.*axis; };
    std::transform(entries_.begin(), entries_.end(), values.begin(), coordinate);
    middle.*axis = median(values);
    for (double& value : values) value = std::abs(value - middle.*axis);
    half = std::max(half, median(values));
  }
  if (half == 0) return;
  Bulk bulk{middle, middle};
  for (const SampledVertex& entry : entries_) {
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
