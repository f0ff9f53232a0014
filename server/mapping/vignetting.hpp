#pragma once

#include <cstddef>

#include "server/mapping/heat_looks.hpp"
#include "server/mapping/trajectory.hpp"

namespace spectra::mapping {

/// What a thermal camera reads too much, by place in its picture.
struct Vignetting {
  PictureFloat picture;      ///< Kelvin to subtract from each pixel; its mean over what was looked at is 0.
  double sigma_kelvin = 0;   ///< Standard error in the middle over the picture, from what its halves differ by.
  double spread_kelvin = 0;  ///< Root mean square over the picture.
  /// Root mean square of what pictures say about points, less the mean of each point and one offset a picture, without it and with it; robust.
  double residual_before_kelvin = 0, residual_after_kelvin = 0;
  double covered = 0;  ///< Share of the picture in which points were looked at.
  std::size_t picture_count = 0, point_count = 0, look_count = 0;
};

/// Estimates it from points that were seen at different places of several pictures: looks are the temperature of the point + an offset of the
/// picture + a smooth function of the place in it, all found at once by robust least squares. A ramp over the picture that ramps of the scene and
/// offsets could explain as well is held small. `trajectory` is of the depth camera; stamps plus the calibration's delay are when pictures were taken.
/// Fails, and says why, when too few pictures share points, or when what is found is not more than its error. The same for any number of threads.
base::Result<Vignetting> find_vignetting(const SurfacePoints& points, const ThermalPictures& pictures,
                                         const ThermalCalibration& calibration, const Trajectory& trajectory,
                                         jobs::WorkerPool& pool, const base::Progress& progress = {});
inline constexpr std::string_view kVignettingPhase = "comparing pictures";

}  // namespace spectra::mapping
