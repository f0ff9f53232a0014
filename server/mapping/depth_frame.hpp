#pragma once

#include <cstdint>
#include <vector>

#include "server/jobs/worker_pool.hpp"
#include "server/mapping/calibration.hpp"
#include "server/mapping/picture_file.hpp"

namespace spectra::mapping {

/// A depth picture made ready: metres, and how much each pixel is to be believed.
struct DepthFrame {
  int width = 0;
  int height = 0;
  std::vector<float> depth_m;
  std::vector<float> weight;  ///< Whole numbers, kWeightOne from near; 0: left out.
  /// Both at once: steps of unit_m in the upper 16 bits, the weight in the others. One more than there are pixels; the last, for what lies
  /// outside of the picture, is 0.
  std::vector<std::uint32_t> packed;
  float unit_m = 0;
  /// Of tiles of 16 x 16 pixels, row after row: the farthest pixel that counts; 0: none.
  int tiles_across = 0, tiles_down = 0;
  std::vector<float> farthest_m;
  std::size_t counted = 0;  ///< Pixels that are not left out.

  static constexpr int kTile = 16;
};

/// Directions of a camera's pixels with z = 1.
struct RayTable {
  explicit RayTable(const CameraModel& camera);
  int width, height;
  std::vector<float> x, y;
};

/// Weighs the pixels of a depth picture: (2 sigma_0 / sigma_z)^2 cos(angle to the surface), at most 1, with sigma of the sensor's noise. Left
/// out are pixels within 2 of a jump of depth and those beside nothing (what a sensor says there lies between near and far), those seen
/// at more than 80 degrees, and those whose noise is more than `truncation_m`. `frame`: an earlier one, whose memory is used again.
DepthFrame prepared_depth(const Picture16& picture, const DepthCalibration& calibration, const RayTable& rays,
                          double truncation_m, jobs::WorkerPool& pool, DepthFrame frame = {});

}  // namespace spectra::mapping
