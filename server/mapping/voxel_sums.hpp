#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <memory>
#include <optional>

#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// A block made of others.
struct BakedBlock {
  bool is_empty = true;  ///< Nothing is known of any voxel, and of none was.
  BlockHead head;        ///< What it says of its voxels; not where it is, nor what has changed.
  VoxelBlock voxels;
  std::optional<HeatBlock> heat;
};

/// Puts it in the place of what is there, and notes by how much that differs, as fusing does.
void put(VoxelMap& map, GridPlace at, const BakedBlock& block);

/// Gathers what several maps know of the voxels of one block: distances by weight, colours by theirs, temperatures by variance.
class VoxelSums {
 public:
  explicit VoxelSums(double voxel_m) : voxel_m_(voxel_m) {}

  /// Of a map on the same grid: the block in the same place.
  void add(const VoxelMap& map, std::int32_t block);
  /// Of a map that stands elsewhere: linear between those of the eight voxels around each that were ever seen; nothing where they are less than half.
  void add(const VoxelMap& map, const Eigen::Isometry3d& grid_from_world, GridPlace block);

  /// One block alone on the same grid comes back as it was.
  BakedBlock take();

 private:
  /// What a map says of a voxel.
  struct Known {
    float weight = 0, distance = 0;
    float colour_weight = 0, red = 0, green = 0, blue = 0;
    float variance = 0, celsius = 0, seen_s = 0;  ///< Variance 0: no temperature.
  };
  struct Sum {
    float weight = 0, distance = 0;
    float colour_weight = 0, red = 0, green = 0, blue = 0;
    double information = 0, celsius = 0;
    float seen_s = 0;
  };
  void add(std::size_t voxel, const Known& known);
  void add_single();

  const double voxel_m_;
  const VoxelMap* single_map_ = nullptr;  ///< The only one so far, not added yet.
  std::int32_t single_block_ = -1;
  std::unique_ptr<std::array<Sum, kBlockVoxels>> sums_;  ///< Made when there is more.
};

}  // namespace spectra::mapping
