#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "fusion/base/progress.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"
#include "server/mapping/calibration.hpp"
#include "server/mapping/frame_folder.hpp"
#include "server/mapping/trajectory.hpp"

namespace spectra::mapping {

struct DriveOptions {
  double seconds = 60;
  double depth_hz = 10;  ///< Of depth and colour.
  double thermal_hz = 12.5;
  std::uint64_t seed = 1;  ///< Another number, other noise and another path through the same kind of office.
  int finer_than = 1;      ///< 2: half as many pixels each way.
  std::uint64_t vertex_count = 400'000;  ///< Of the true surfaces.
  double pose_drift_m =
      0;  ///< Random walk of the told poses, metres after a second; turns drift by as many radians a metre.
  double clock_offset_s = 0;  ///< By which the thermal camera's stamps are late, which the calibration does not say.
};

/// A robot that drives through the demo office with a depth, a colour and a thermal camera, and what they say. docs/mapping.md describes
/// their noise. The same options give the same frames; frames may be asked for in any order, from any thread.
class SimulatedDrive {
 public:
  explicit SimulatedDrive(const DriveOptions& options, const base::Progress& progress = {});
  ~SimulatedDrive();

  const Calibration& calibration() const { return calibration_; }
  /// As the robot knows it.
  const Trajectory& trajectory() const { return told_; }
  /// As it is: pose of the depth camera.
  Eigen::Isometry3d true_pose(double time_s) const;
  const mesh::MultispectralMesh& truth() const { return truth_; }

  std::size_t frame_count() const { return rows_.size(); }
  /// The stamp of a frame; frames are in its order.
  double stamp_s(std::size_t index) const;
  bool is_thermal(std::size_t index) const { return rows_[index].is_thermal; }
  Frame frame(std::size_t index) const;

 private:
  struct Row {
    double time_s;  ///< When it was taken.
    bool is_thermal;
    double offset_kelvin;  ///< Of the thermal camera at this moment.
    double since_shutter_s;
    std::size_t shown;  ///< The row whose picture is shown; another one while the shutter is closed.
  };

  void plan_rows();
  void tell_poses();
  void take_depth(const Row& row, std::size_t index, Frame& frame) const;
  void take_thermal(const Row& row, std::size_t index, Frame& frame) const;

  const DriveOptions options_;
  Calibration calibration_;
  Trajectory told_;
  mesh::MultispectralMesh truth_;
  std::vector<Row> rows_;
  std::vector<float> pattern_;  ///< Of the thermal sensor, without unit.
};

}  // namespace spectra::mapping
