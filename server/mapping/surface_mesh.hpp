#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "fusion/base/vertex_types.hpp"
#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// The surface within a unit of a map. One entry a vertex in each array.
struct UnitMesh {
  std::vector<base::Vec3f> positions;  ///< Metres, in the axes of the poses.
  std::vector<base::Rgb8> colours;
  std::vector<float> celsius;       ///< NaN: none.
  std::vector<float> sigma_kelvin;  ///< NaN: none.
  std::vector<float> seen_s;  ///< Of the last look with the thermal camera, after the map's first moment; NaN: none.
  /// Which edge of the grid of voxels each vertex lies on: the same for the same vertex of neighbouring units.
  std::vector<std::uint64_t> edges;
  std::vector<base::Triangle> triangles;
};

struct MeshRules {
  /// Voxels that weigh less are not known (kWeightOne = one look from near).
  float least_weight = 4;
  /// A temperature's sigma is at least this, whatever the number of looks.
  float least_sigma_kelvin = 0.03F;
};

/// Marching cubes over the cells whose lowest corner is in the unit. Vertices depend on the two voxels of their edge alone, so units that
/// share a face have the same vertices there, bit for bit. Temperature and variance between two voxels go by what each knows; sigma is that
/// of the last look.
UnitMesh mesh_of_unit(const VoxelMap& map, std::int32_t unit, const MeshRules& rules);

/// The same in room that is used again: holds until this thread meshes another unit.
const UnitMesh& passing_mesh_of_unit(const VoxelMap& map, std::int32_t unit, const MeshRules& rules);

/// Units joined into one mesh: vertices of the same edge become one.
UnitMesh joined(const std::vector<UnitMesh>& units);

}  // namespace spectra::mapping
