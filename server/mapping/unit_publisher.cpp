#include "server/mapping/unit_publisher.hpp"

#include <algorithm>
#include <boost/unordered/unordered_flat_set.hpp>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <optional>
#include <tuple>
#include <utility>

namespace spectra::mapping {
namespace {

constexpr double kHotKelvin = 5;
constexpr float kCold = -1000;

std::string id_of(GridPlace at) {
  return "unit_" + std::to_string(at.x) + "_" + std::to_string(at.y) + "_" + std::to_string(at.z);
}

/// The units that share the faces, edges and corners of one.
std::vector<std::int32_t> neighbours_of(const VoxelMap& map, GridPlace at) {
  std::vector<std::int32_t> found;
  for (int i = 0; i < 27; ++i) {
    if (i == 13) continue;
    const std::int32_t unit = map.find_unit({at.x + i % 3 - 1, at.y + i / 3 % 3 - 1, at.z + i / 9 - 1});
    if (unit >= 0) found.push_back(unit);
  }
  return found;
}

/// The hottest that was noted, if the blocks noted more since the unit was looked at than it takes to tell it; the notes are taken back.
std::optional<float> take_notes(VoxelMap& map, MapUnit& unit) {
  float moved = unit.moved, warmed = 0, recoloured = 0, hottest = kCold;
  for (const std::int32_t block : unit.blocks) {
    if (block < 0) continue;
    const BlockHead& head = map.head(block);
    moved = std::max(moved, head.moved);
    warmed = std::max(warmed, head.warmed);
    recoloured = std::max(recoloured, head.recoloured);
    hottest = std::max(hottest, head.hottest);
  }
  if (moved <= UnitPublisher::kMovedVoxels && warmed <= UnitPublisher::kWarmedKelvin &&
      recoloured <= UnitPublisher::kRecolouredLevels) {
    return std::nullopt;
  }
  unit.moved = 0;
  for (const std::int32_t block : unit.blocks) {
    if (block < 0) continue;
    BlockHead& head = map.head(block);
    head.moved = head.warmed = head.recoloured = 0;
    head.hottest = kCold;
  }
  return hottest;
}

double squared_distance(const VoxelMap& map, std::int32_t unit, const Eigen::Vector3d& eye) {
  const GridPlace at = map.units()[static_cast<std::size_t>(unit)].at;
  const double edge = kUnitEdge * map.voxel_m();
  return (edge * Eigen::Vector3d(at.x + 0.5, at.y + 0.5, at.z + 0.5) - eye).squaredNorm();
}

}  // namespace

/// A unit that may be told.
struct UnitPublisher::Candidate {
  std::int32_t unit = -1;
  UnitMesh mesh;
  std::vector<BorderVertex> border;
  bool is_new = false;  ///< It differs from what was told.
  float hottest = kCold;
};

std::size_t UnitPublisher::size_bytes() const {
  std::size_t bytes = told_.capacity() * sizeof(Told);
  for (const Told& told : told_) {
    bytes += told.edges.capacity() * sizeof(told.edges[0]) + told.positions.capacity() * sizeof(told.positions[0]) +
             told.colours.capacity() * sizeof(told.colours[0]) + told.celsius.capacity() * sizeof(told.celsius[0]) +
             told.border.capacity() * sizeof(told.border[0]);
  }
  return bytes;
}

void UnitPublisher::note_changes(VoxelMap& map) {
  const std::size_t count = map.units().size();
  told_.resize(count);
  std::vector<std::optional<float>> noted(count);
  for (std::size_t i = 0; i < count; ++i) noted[i] = take_notes(map, map.unit(i));
  for (std::size_t i = 0; i < count; ++i) {
    std::optional<float> hottest = noted[i];
    // A cell reaches one voxel into the next units, so that what changes there changes it, too.
    const GridPlace at = map.units()[i].at;
    for (int k = 1; k < 8 && !hottest; ++k) {
      const std::int32_t next = map.find_unit({at.x + (k & 1), at.y + (k >> 1 & 1), at.z + (k >> 2)});
      if (next >= 0 && noted[static_cast<std::size_t>(next)]) hottest = kCold;
    }
    if (!hottest) continue;
    Waiting& waiting = waiting_.try_emplace(static_cast<std::int32_t>(i), Waiting{calls_, kCold}).first->second;
    waiting.hottest = std::max(waiting.hottest, *hottest);
  }
}

std::vector<std::int32_t> UnitPublisher::next_units(const VoxelMap& map, const Eigen::Vector3d& eye, double hot,
                                                    std::size_t most) {
  std::vector<std::int32_t> next;
  if (waiting_.size() <= most) {
    for (const auto& [unit, waiting] : waiting_) next.push_back(unit);
  } else {
    std::vector<std::tuple<bool, bool, double, std::int32_t>> ranks;
    for (const auto& [unit, waiting] : waiting_) {
      const float hottest =
          std::max(waiting.hottest, is_told(unit) ? told_[static_cast<std::size_t>(unit)].hottest : kCold);
      ranks.emplace_back(calls_ - waiting.since < kPatience, !(static_cast<double>(hottest) > hot),
                         squared_distance(map, unit, eye), unit);
    }
    const auto end = ranks.begin() + static_cast<std::ptrdiff_t>(most);
    std::nth_element(ranks.begin(), end, ranks.end());
    for (auto rank = ranks.begin(); rank != end; ++rank) next.push_back(std::get<3>(*rank));
  }
  std::sort(next.begin(), next.end());
  for (const std::int32_t unit : next) waiting_.erase(unit);
  return next;
}

std::vector<UnitPublisher::BorderVertex> UnitPublisher::border_of(const UnitMesh& mesh) {
  std::vector<BorderVertex> border;
  for (std::size_t i = 0; i < mesh.edges.size(); ++i) {
    // Some coordinate of the lower voxel is that of the first or last layer.
    const std::uint64_t edge = mesh.edges[i];
    constexpr std::uint64_t kWithin = kUnitEdge - 1;
    if ((edge & kWithin) == 0 || (edge >> 21 & kWithin) == 0 || (edge >> 42 & kWithin) == 0)
      border.push_back({edge, static_cast<std::uint32_t>(i)});
  }
  std::sort(border.begin(), border.end(), [](const auto& a, const auto& b) { return a.edge < b.edge; });
  return border;
}

bool UnitPublisher::has_changed(const Told& told, const UnitMesh& mesh, float voxel_m) {
  if (told.triangle_count != mesh.triangles.size() || told.edges != mesh.edges) return true;
  const float most = kMovedVoxels * voxel_m;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const base::Vec3f &a = told.positions[i], &b = mesh.positions[i];
    if (std::max({std::abs(a.x - b.x), std::abs(a.y - b.y), std::abs(a.z - b.z)}) > most) return true;
    if (std::isnan(told.celsius[i]) != std::isnan(mesh.celsius[i])) return true;
    if (std::abs(told.celsius[i] - mesh.celsius[i]) > kWarmedKelvin) return true;
    const base::Rgb8 &c = told.colours[i], &d = mesh.colours[i];
    if (std::max({std::abs(c.r - d.r), std::abs(c.g - d.g), std::abs(c.b - d.b)}) > static_cast<int>(kRecolouredLevels))
      return true;
  }
  return false;
}

UnitPublisher::Candidate UnitPublisher::made(const VoxelMap& map, const MeshRules& rules, std::int32_t unit,
                                             bool is_wanted_anyway) const {
  Candidate candidate;
  candidate.unit = unit;
  const UnitMesh& mesh = passing_mesh_of_unit(map, unit, rules);
  candidate.is_new = is_told(unit)
                         ? has_changed(told_[static_cast<std::size_t>(unit)], mesh, static_cast<float>(map.voxel_m()))
                         : !mesh.triangles.empty();
  if (!candidate.is_new && !is_wanted_anyway) return candidate;
  candidate.mesh = mesh;
  candidate.border = border_of(candidate.mesh);
  for (const float celsius : candidate.mesh.celsius) candidate.hottest = std::max(candidate.hottest, celsius);
  return candidate;
}

void UnitPublisher::keep(const Candidate& candidate) {
  Told& told = told_[static_cast<std::size_t>(candidate.unit)];
  if (candidate.mesh.triangles.empty()) {
    told = {};
    return;
  }
  told.edges = candidate.mesh.edges;
  told.positions = candidate.mesh.positions;
  told.colours = candidate.mesh.colours;
  told.celsius = candidate.mesh.celsius;
  told.border = candidate.border;
  told.triangle_count = candidate.mesh.triangles.size();
  told.hottest = candidate.hottest;
}

double UnitPublisher::median_celsius() const {
  std::vector<float> sample;
  for (const Told& told : told_) {
    for (std::size_t i = 0; i < told.celsius.size(); i += 37) {
      if (!std::isnan(told.celsius[i])) sample.push_back(told.celsius[i]);
    }
  }
  if (sample.empty()) return 1e9;
  const auto middle = sample.begin() + static_cast<std::ptrdiff_t>(sample.size() / 2);
  std::nth_element(sample.begin(), middle, sample.end());
  return static_cast<double>(*middle);
}

std::vector<PublishedUnit> UnitPublisher::take(VoxelMap& map, const MeshRules& rules, const Eigen::Vector3d& eye,
                                               jobs::WorkerPool& pool, std::size_t most) {
  ++calls_;
  note_changes(map);
  const double hot = median_celsius() + kHotKelvin;
  const std::vector<std::int32_t> looked_at = next_units(map, eye, hot, most);
  std::vector<Candidate> changed(looked_at.size());
  pool.for_each(looked_at.size(), [&](std::size_t i) { changed[i] = made(map, rules, looked_at[i], false); });
  std::erase_if(changed, [](const Candidate& candidate) { return !candidate.is_new; });
  boost::unordered_flat_set<std::int32_t> is_changed;
  for (const Candidate& candidate : changed) is_changed.insert(candidate.unit);
  const auto told_neighbours = [&](std::int32_t unit) {
    std::vector<std::int32_t> found;
    for (const std::int32_t neighbour : neighbours_of(map, map.units()[static_cast<std::size_t>(unit)].at)) {
      if (is_told(neighbour) && !is_changed.contains(neighbour)) found.push_back(neighbour);
    }
    return found;
  };

  // A neighbour that has other vertices at the common border than before is told as well ...
  const auto by_edge = [](const BorderVertex& a, const BorderVertex& b) { return a.edge < b.edge; };
  for (std::size_t next = 0; next < changed.size(); ++next) {
    const std::int32_t unit = changed[next].unit;
    if (!is_told(unit)) continue;
    const std::vector<BorderVertex>&now = changed[next].border, &before = told_[static_cast<std::size_t>(unit)].border;
    std::vector<BorderVertex> won, lost;
    std::set_difference(now.begin(), now.end(), before.begin(), before.end(), std::back_inserter(won), by_edge);
    std::set_difference(before.begin(), before.end(), now.begin(), now.end(), std::back_inserter(lost), by_edge);
    if (won.empty() && lost.empty()) continue;
    for (const std::int32_t neighbour : told_neighbours(unit)) {
      const std::vector<BorderVertex>& border = told_[static_cast<std::size_t>(neighbour)].border;
      const auto shared = [&](const std::vector<BorderVertex>& vertices) {
        return std::count_if(vertices.begin(), vertices.end(), [&](const BorderVertex& vertex) {
          return std::binary_search(border.begin(), border.end(), vertex, by_edge);
        });
      };
      if (shared(won) == shared(lost)) continue;
      changed.push_back(made(map, rules, neighbour, true));
      is_changed.insert(neighbour);
      waiting_.erase(neighbour);
    }
  }
  // ... and what the others have stays where they have it.
  pool.for_each(changed.size(), [&](std::size_t i) {
    Candidate& candidate = changed[i];
    for (const std::int32_t neighbour : told_neighbours(candidate.unit)) {
      const Told& told = told_[static_cast<std::size_t>(neighbour)];
      auto theirs = told.border.begin();
      for (const BorderVertex& mine : candidate.border) {
        while (theirs != told.border.end() && theirs->edge < mine.edge) ++theirs;
        if (theirs == told.border.end()) break;
        if (theirs->edge == mine.edge) candidate.mesh.positions[mine.index] = told.positions[theirs->index];
      }
    }
  });
  pool.for_each(changed.size(), [&](std::size_t i) { keep(changed[i]); });
  told_count_ = static_cast<std::size_t>(
      std::count_if(told_.begin(), told_.end(), [](const Told& told) { return told.triangle_count > 0; }));

  std::vector<std::tuple<bool, double, std::size_t>> ranks;
  for (std::size_t i = 0; i < changed.size(); ++i) {
    ranks.emplace_back(!(static_cast<double>(changed[i].hottest) > hot), squared_distance(map, changed[i].unit, eye),
                       i);
  }
  std::sort(ranks.begin(), ranks.end());
  std::vector<PublishedUnit> sorted;
  for (const auto& [is_cool, distance, index] : ranks) {
    Candidate& candidate = changed[index];
    sorted.push_back({id_of(map.units()[static_cast<std::size_t>(candidate.unit)].at), std::move(candidate.mesh)});
  }
  return sorted;
}

}  // namespace spectra::mapping
