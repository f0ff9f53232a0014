#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "server/jobs/worker_pool.hpp"
#include "server/mapping/calibration.hpp"
#include "server/mapping/look_kernel.hpp"
#include "server/mapping/picture_file.hpp"
#include "server/mapping/surface_view.hpp"
#include "server/mapping/trajectory.hpp"
#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// The rules by which thermal pictures become temperatures; each can be left out, to see what it buys.
struct HeatRules {
  bool occlusion = true;     ///< What lies behind something else of the map is not seen.
  bool edges = true;         ///< Nothing within 3 pixels of a jump of depth.
  bool angle = true;         ///< Nothing seen at more than 75 degrees.
  bool weights = true;       ///< Off: every look counts the same.
  bool frame_offset = true;  ///< The overlap with what is known tells what the camera has drifted.
  bool shutter = true;       ///< Frozen pictures are no looks.
  double process_kelvin =
      0.05;  ///< Temperatures may change by so much in a second (standard deviation of a random walk).
  /// A gap of more than this is a reason to believe in a change only where the new look contradicts the old ones.
  double trusted_gap_s = 1;
};

/// What became of a thermal picture.
struct HeatReport {
  bool is_frozen = false;    ///< The same picture again: the shutter was closed.
  std::size_t observed = 0;  ///< Voxels that it told something of.
  std::size_t compared = 0;  ///< Of these, known before, so that they could tell the offset.
  double offset_kelvin = 0;  ///< That was subtracted.
  double offset_sigma_kelvin = 0;
  double spread_kelvin = 0;  ///< Of what it says about what is known; 0: nothing was.
};

/// Fuses thermal pictures into the temperatures of a map: a scalar Kalman filter a voxel. docs/mapping.md has the model.
class HeatFusion {
 public:
  HeatFusion(const ThermalCalibration& calibration, const HeatRules& rules)
      : calibration_(calibration), rules_(rules) {}

  /// Kelvin to subtract from each pixel; of the picture's size. Empty: none.
  void set_vignetting(PictureFloat picture) { vignetting_ = std::move(picture); }

  /// `moment_s`: when the picture was taken, after the map's first moment; later than the one before. `camera`: where it was and how it
  /// moved. Only voxels beside surfaces get temperatures. The same bytes for any number of threads.
  HeatReport fuse(VoxelMap& map, const Picture16& picture, const PoseAnswer& camera, double moment_s,
                  jobs::WorkerPool& pool);

 private:
  struct Prepared;

  Prepared prepare(const Picture16& picture, jobs::WorkerPool& pool) const;
  /// The median of the picture's temperatures.
  float middle_celsius(const Picture16& picture, const std::vector<float>& celsius) const;
  bool is_frozen(const Picture16& picture);
  void find_offset(const VoxelMap& map, double moment_s, jobs::WorkerPool& pool, HeatReport& report);

  const ThermalCalibration calibration_;
  const HeatRules rules_;
  PictureFloat vignetting_;
  SurfaceView view_;             ///< Of the last picture, as the following.
  std::vector<HeatSeen> looks_;  ///< As SurfaceView::voxels.
  std::vector<std::uint16_t> last_picture_;
  double last_frozen_s_ = -1e9;
  double last_offset_kelvin_ = 0, last_offset_sigma_kelvin_ = 0;
  std::optional<double> last_offset_s_;  ///< Moment of the last picture with an offset; absent: there was none.
};

}  // namespace spectra::mapping
