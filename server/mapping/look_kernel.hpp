#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/mapping/camera.hpp"
#include "server/mapping/surface_kernel.hpp"

namespace spectra::mapping {

/// What a thermal picture says of voxels, block after block; the first `count` of each array.
struct HeatSeen {
  std::vector<SeenVoxels::Block> blocks;  ///< Those of which it says something.
  std::size_t count = 0;
  std::vector<std::uint16_t> voxel;
  std::vector<float> celsius;
  std::vector<float> scale;  ///< z^2 / cos and everything else that the variance is multiplied by.
  std::vector<float> own;    ///< K^2, without the part that the whole picture has in common.
};

/// What the kernel of looks needs.
struct LookKernel {
  Lens lens;
  std::int32_t width, height;
  const float* celsius;   ///< Of each pixel, as the following.
  const float* gradient;  ///< Kelvin a pixel; below 0: there is no look.
  const float* depth_m;   ///< Of the map; null: what lies behind something else is seen, too.
  float voxel_m;
  float least_cosine;
  bool is_weighed;                       ///< Else all looks count the same, `noise`.
  std::array<float, 3> linear, angular;  ///< Motion within the time of a pixel.
  float noise, reflected_celsius, after_shutter;
  float most_variance;  ///< A look that knows less says nothing.
};

/// What a picture says of voxels that were seen, in place of what was there. Every instruction set gives the same.
void find_looks(const LookKernel& kernel, const SeenVoxels& seen, HeatSeen& out);

}  // namespace spectra::mapping
