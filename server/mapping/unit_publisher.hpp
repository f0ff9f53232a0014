#pragma once

#include <Eigen/Core>
#include <boost/unordered/unordered_flat_map.hpp>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "server/jobs/worker_pool.hpp"
#include "server/mapping/surface_mesh.hpp"

namespace spectra::mapping {

/// A unit of a map that others are to hear of.
struct PublishedUnit {
  std::string id;  ///< unit_X_Y_Z, its place in units.
  UnitMesh mesh;   ///< Empty: there is no longer a surface in it.
};

/// Tells which units of a map differ from what was told of them before, by more than a tenth of a voxel, 0.05 K or 2 levels. What was told
/// of neighbours meets bit for bit at all times: where a unit changes and its neighbour does not, the vertices that both have stay where
/// they were told to be. For one thread; uses a pool inside.
class UnitPublisher {
 public:
  static constexpr float kMovedVoxels = 0.1F, kWarmedKelvin = 0.05F, kRecolouredLevels = 2;
  static constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
  /// Calls of take() after which a unit that still waits comes before all others.
  static constexpr std::uint32_t kPatience = 20;

  /// Units to tell now: hot ones first (5 K above the middle of all that was told), then those near to `eye`. Takes back what the map has noted of
  /// changes; not while it is changed. At most about `most` units are meshed; those for which that was too few wait for the next call, hot and near
  /// ones again before the others, but none for more than kPatience calls while there is room.
  std::vector<PublishedUnit> take(VoxelMap& map, const MeshRules& rules, const Eigen::Vector3d& eye,
                                  jobs::WorkerPool& pool, std::size_t most = kAll);

  std::size_t told_count() const { return told_count_; }
  /// Units that are known to have changed and wait.
  std::size_t waiting_count() const { return waiting_.size(); }
  /// All that is kept.
  std::size_t size_bytes() const;

 private:
  /// A vertex on the outside of a unit, where others may have it, too.
  struct BorderVertex {
    std::uint64_t edge;
    std::uint32_t index;
  };
  /// What was told of a unit; nothing: it has no surface.
  struct Told {
    std::vector<std::uint64_t> edges;
    std::vector<base::Vec3f> positions;
    std::vector<base::Rgb8> colours;
    std::vector<float> celsius;
    std::vector<BorderVertex> border;  ///< In rising order of edges.
    std::size_t triangle_count = 0;
    float hottest = 0;
  };
  struct Waiting {
    std::uint32_t since = 0;  ///< The call of take() that has found it.
    float hottest = 0;        ///< Of what was noted.
  };
  struct Candidate;

  void note_changes(VoxelMap& map);
  std::vector<std::int32_t> next_units(const VoxelMap& map, const Eigen::Vector3d& eye, double hot, std::size_t most);
  static std::vector<BorderVertex> border_of(const UnitMesh& mesh);
  static bool has_changed(const Told& told, const UnitMesh& mesh, float voxel_m);
  /// Without its mesh where that is no news, and not wanted anyway.
  Candidate made(const VoxelMap& map, const MeshRules& rules, std::int32_t unit, bool is_wanted_anyway) const;
  void keep(const Candidate& candidate);
  double median_celsius() const;
  bool is_told(std::int32_t unit) const { return told_[static_cast<std::size_t>(unit)].triangle_count > 0; }

  std::vector<Told> told_;  ///< By the index of the unit.
  boost::unordered_flat_map<std::int32_t, Waiting> waiting_;
  std::size_t told_count_ = 0;
  std::uint32_t calls_ = 0;
};

}  // namespace spectra::mapping
