#pragma once

#include <Eigen/Core>
#include <boost/unordered/unordered_flat_map.hpp>
#include <cstddef>
#include <cstdint>
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
/// they were told to be.
class UnitPublisher {
 public:
  static constexpr float kMovedVoxels = 0.1F, kWarmedKelvin = 0.05F, kRecolouredLevels = 2;

  /// Units to tell now: hot ones first (5 K above the middle of all that was told), then those near to `eye`. Takes back what the map has noted of
  /// changes; not while it is changed.
  std::vector<PublishedUnit> take(VoxelMap& map, const MeshRules& rules, const Eigen::Vector3d& eye,
                                  jobs::WorkerPool& pool);

  std::size_t told_count() const { return told_.size(); }

 private:
  /// What was told of a unit.
  struct Told {
    boost::unordered_flat_map<std::uint64_t, std::uint32_t> index_by_edge;
    std::vector<base::Vec3f> positions;
    std::vector<base::Rgb8> colours;
    std::vector<float> celsius;
    std::size_t triangle_count = 0;
  };

  bool has_changed(const Told& told, const UnitMesh& mesh, float voxel_m) const;
  void keep(std::int32_t unit, const UnitMesh& mesh);
  double median_celsius() const;

  boost::unordered_flat_map<std::int32_t, Told> told_;
};

}  // namespace spectra::mapping
