#pragma once

#include <Eigen/Geometry>

#include "server/mapping/alignment.hpp"
#include "server/mapping/calibration.hpp"
#include "server/mapping/depth_frame.hpp"
#include "server/mapping/picture_file.hpp"

namespace spectra::mapping {

/// Brightness of a picture, in levels, smoothed to pixels of 1, 2, 4 and 8: what voxels of that size see.
class LumaPictures {
 public:
  LumaPictures(const PictureRgb& picture, jobs::WorkerPool& pool);
  /// At a place of the picture, pixels; `pixel_size`: over how many of them. NaN outside.
  float at(float u, float v, float pixel_size) const;

 private:
  std::vector<Picture<float>> levels_;
};

/// A picture of another camera, and where points of the depth camera are in its axes.
template <class P>
struct BesideLook {
  const P* picture = nullptr;  ///< Null: none.
  const CameraModel* camera = nullptr;
  Eigen::Isometry3d from_depth = Eigen::Isometry3d::Identity();
};

/// Some 20,000 pixels of a depth picture, on a grid, as far as they count; every second one each way comes first. Thermal pixels are centikelvin; `vignetting` may be empty.
SeenPoints seen_points(const DepthFrame& frame, const RayTable& rays, const DepthNoise& noise, double voxel_m,
                       const BesideLook<LumaPictures>& colour, const BesideLook<Picture16>& thermal,
                       const PictureFloat& vignetting);

}  // namespace spectra::mapping
