#pragma once

#include <cstddef>

#include "server/mapping/heat_looks.hpp"
#include "server/mapping/trajectory.hpp"

namespace spectra::mapping {

struct DelaySearch {
  double reach_s = 0.5;  ///< As far before and after `middle_s` it is looked for.
  double middle_s = 0;
};

/// The delay of a thermal camera, and how it was found.
struct ThermalDelay {
  double delay_s = 0;  ///< To be added to a picture's timestamp: when it was taken.
  double sigma_s = 0;  ///< Standard error, by leaving out one part of the drive after the other.
  /// Root mean square of what pictures say about points, less the mean of each point and one offset a picture: at the delay, and in the middle
  /// over all that was tried; robust.
  double residual_kelvin = 0, typical_residual_kelvin = 0;
  std::size_t picture_count = 0, point_count = 0, look_count = 0;
};

/// Finds the delay at which the pictures contradict each other least about the temperatures of the surface: the least residual variance. A
/// microbolometer's lag, about its time constant, is part of it. `trajectory` is of the depth camera. Fails, and says why, where it cannot be told:
/// too few pictures with poses all around, nothing that moves, nothing warm or cold to see, the least at an end of what was tried, parts of the drive
/// that contradict each other. The same for any number of threads.
base::Result<ThermalDelay> find_thermal_delay(const SurfacePoints& points, const ThermalPictures& pictures,
                                              const ThermalCalibration& calibration, const Trajectory& trajectory,
                                              const DelaySearch& search, jobs::WorkerPool& pool,
                                              const base::Progress& progress = {});
inline constexpr std::string_view kDelayPhase = "trying delays";

}  // namespace spectra::mapping
