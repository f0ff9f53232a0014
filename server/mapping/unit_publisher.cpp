#include "server/mapping/unit_publisher.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <tuple>
#include <utility>

namespace spectra::mapping {
namespace {

constexpr double kHotKelvin = 5;

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

/// The blocks noted more since the unit was looked at than it takes to tell it; the notes are taken back.
bool take_notes(VoxelMap& map, MapUnit& unit) {
  float moved = unit.moved, warmed = 0, recoloured = 0;
  for (const std::int32_t block : unit.blocks) {
    if (block < 0) continue;
    const BlockHead& head = map.head(block);
    moved = std::max(moved, head.moved);
    warmed = std::max(warmed, head.warmed);
    recoloured = std::max(recoloured, head.recoloured);
  }
  if (moved <= UnitPublisher::kMovedVoxels && warmed <= UnitPublisher::kWarmedKelvin &&
      recoloured <= UnitPublisher::kRecolouredLevels) {
    return false;
  }
  unit.moved = 0;
  for (const std::int32_t block : unit.blocks) {
    if (block >= 0) map.head(block).moved = map.head(block).warmed = map.head(block).recoloured = 0;
  }
  return true;
}

}  // namespace

bool UnitPublisher::has_changed(const Told& told, const UnitMesh& mesh, float voxel_m) const {
  if (told.positions.size() != mesh.positions.size() || told.triangle_count != mesh.triangles.size()) return true;
  const float most = kMovedVoxels * voxel_m;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const auto found = told.index_by_edge.find(mesh.edges[i]);
    if (found == told.index_by_edge.end()) return true;
    const std::size_t k = found->second;
    const base::Vec3f &a = told.positions[k], &b = mesh.positions[i];
    if (std::max({std::abs(a.x - b.x), std::abs(a.y - b.y), std::abs(a.z - b.z)}) > most) return true;
    if (std::isnan(told.celsius[k]) != std::isnan(mesh.celsius[i])) return true;
    if (std::abs(told.celsius[k] - mesh.celsius[i]) > kWarmedKelvin) return true;
    const base::Rgb8 &c = told.colours[k], &d = mesh.colours[i];
    if (std::max({std::abs(c.r - d.r), std::abs(c.g - d.g), std::abs(c.b - d.b)}) > static_cast<int>(kRecolouredLevels))
      return true;
  }
  return false;
}

void UnitPublisher::keep(std::int32_t unit, const UnitMesh& mesh) {
  if (mesh.triangles.empty()) {
    told_.erase(unit);
    return;
  }
  Told& told = told_[unit];
  told.index_by_edge.clear();
  for (std::size_t i = 0; i < mesh.edges.size(); ++i)
    told.index_by_edge.emplace(mesh.edges[i], static_cast<std::uint32_t>(i));
  told.positions = mesh.positions;
  told.colours = mesh.colours;
  told.celsius = mesh.celsius;
  told.triangle_count = mesh.triangles.size();
}

double UnitPublisher::median_celsius() const {
  std::vector<float> sample;
  for (const auto& [unit, told] : told_) {
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
                                               jobs::WorkerPool& pool) {
  std::vector<std::int32_t> looked_at;
  std::vector<std::uint8_t> is_noted(map.units().size(), 0);
  for (std::size_t i = 0; i < is_noted.size(); ++i) is_noted[i] = take_notes(map, map.unit(i)) ? 1 : 0;
  // A cell reaches one voxel into the next units, so that what changes there changes it, too.
  for (std::size_t i = 0; i < is_noted.size(); ++i) {
    const GridPlace at = map.units()[i].at;
    bool is_touched = is_noted[i] != 0;
    for (int k = 1; k < 8 && !is_touched; ++k) {
      const std::int32_t next = map.find_unit({at.x + (k & 1), at.y + (k >> 1 & 1), at.z + (k >> 2)});
      is_touched = next >= 0 && is_noted[static_cast<std::size_t>(next)] != 0;
    }
    if (is_touched) looked_at.push_back(static_cast<std::int32_t>(i));
  }
  std::vector<UnitMesh> meshes(looked_at.size());
  pool.for_each(looked_at.size(), [&](std::size_t i) { meshes[i] = mesh_of_unit(map, looked_at[i], rules); });

  boost::unordered_flat_map<std::int32_t, UnitMesh> changed;
  std::vector<std::int32_t> order;
  const auto add = [&](std::int32_t unit, UnitMesh mesh) {
    order.push_back(unit);
    changed.emplace(unit, std::move(mesh));
  };
  for (std::size_t i = 0; i < looked_at.size(); ++i) {
    const auto told = told_.find(looked_at[i]);
    const bool is_new = told == told_.end() ? !meshes[i].triangles.empty()
                                            : has_changed(told->second, meshes[i], static_cast<float>(map.voxel_m()));
    if (is_new) add(looked_at[i], std::move(meshes[i]));
  }
  const auto told_neighbours = [&](std::int32_t unit) {
    std::vector<const Told*> found;
    for (const std::int32_t neighbour : neighbours_of(map, map.units()[static_cast<std::size_t>(unit)].at)) {
      const auto told = told_.find(neighbour);
      if (told != told_.end() && !changed.contains(neighbour)) found.push_back(&told->second);
    }
    return found;
  };
  // A neighbour that has other vertices at the common border than before is told as well ...
  for (std::size_t next = 0; next < order.size(); ++next) {
    const auto before = told_.find(order[next]);
    if (before == told_.end()) continue;
    const std::vector<std::uint64_t> edges = changed.at(order[next]).edges;
    for (const std::int32_t neighbour : neighbours_of(map, map.units()[static_cast<std::size_t>(order[next])].at)) {
      const auto told = told_.find(neighbour);
      if (told == told_.end() || changed.contains(neighbour)) continue;
      const auto is_shared = [&](std::uint64_t edge) { return told->second.index_by_edge.contains(edge); };
      const auto shared = std::count_if(edges.begin(), edges.end(), is_shared);
      const auto shared_before = std::count_if(before->second.index_by_edge.begin(), before->second.index_by_edge.end(),
                                               [&](const auto& entry) { return is_shared(entry.first); });
      if (shared != shared_before) add(neighbour, mesh_of_unit(map, neighbour, rules));
    }
  }
  // ... and what the others have stays where they have it.
  for (const std::int32_t unit : order) {
    UnitMesh& mesh = changed.at(unit);
    for (const Told* neighbour : told_neighbours(unit)) {
      for (std::size_t i = 0; i < mesh.edges.size(); ++i) {
        const auto found = neighbour->index_by_edge.find(mesh.edges[i]);
        if (found != neighbour->index_by_edge.end()) mesh.positions[i] = neighbour->positions[found->second];
      }
    }
  }

  std::vector<PublishedUnit> units;
  std::vector<std::tuple<bool, double, std::size_t>> ranks;
  const double hot = median_celsius() + kHotKelvin;
  for (const std::int32_t unit : order) {
    UnitMesh& mesh = changed.at(unit);
    const GridPlace at = map.units()[static_cast<std::size_t>(unit)].at;
    keep(unit, mesh);
    const bool is_hot =
        std::any_of(mesh.celsius.begin(), mesh.celsius.end(), [hot](float t) { return static_cast<double>(t) > hot; });
    const double edge = kUnitEdge * map.voxel_m();
    const Eigen::Vector3d centre = edge * Eigen::Vector3d(at.x + 0.5, at.y + 0.5, at.z + 0.5);
    ranks.emplace_back(!is_hot, (centre - eye).squaredNorm(), units.size());
    units.push_back({id_of(at), std::move(mesh)});
  }
  std::sort(ranks.begin(), ranks.end());
  std::vector<PublishedUnit> sorted;
  for (const auto& [is_cool, distance, index] : ranks) sorted.push_back(std::move(units[index]));
  return sorted;
}

}  // namespace spectra::mapping
