#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "fusion/base/error.hpp"
#include "server/mapping/camera.hpp"
#include "server/mapping/picture_file.hpp"

namespace spectra::mapping {

/// The standard deviation of a measured distance z: base + growth (z - from)^2, metres. The defaults are those of structured light
/// (Nguyen, Izadi and Lovell, 3DIMPVT 2012, axial noise of the Kinect).
struct DepthNoise {
  double base_m = 0.0012;
  double growth_per_m = 0.0019;
  double from_m = 0.4;

  double sigma_m(double z) const {
    const double beyond = z > from_m ? z - from_m : 0;
    return base_m + growth_per_m * beyond * beyond;
  }
};

struct DepthCalibration {
  CameraModel camera;
  double unit_m = 0.001;      ///< Metres in one step of the picture.
  std::uint16_t invalid = 0;  ///< The value that stands for nothing measured.
  double delay_s = 0;         ///< Added to the timestamp of a picture gives the moment at which it was taken.
  DepthNoise noise;
};

struct ColourCalibration {
  CameraModel camera;
  Eigen::Isometry3d from_depth = Eigen::Isometry3d::Identity();  ///< Takes points of the depth camera to this one.
  double delay_s = 0;
};

struct ThermalCalibration {
  CameraModel camera;
  Eigen::Isometry3d from_depth = Eigen::Isometry3d::Identity();
  double delay_s = 0;
  double netd_kelvin = 0.05;  ///< White noise of a pixel.
  double emissivity = 1;      ///< That the camera has not taken into account itself; 1: it has, or is not to be.
  /// What the surfaces reflect; absent: the median of each picture.
  std::optional<double> reflected_celsius;
  std::string vignetting_file;  ///< Beside the calibration, PFM; empty: none.
  PictureFloat vignetting;      ///< Kelvin to subtract from each pixel; empty: nothing. read_calibration() fills it.
};

/// Three cameras rigidly together.
struct Calibration {
  DepthCalibration depth;
  std::optional<ColourCalibration> colour;
  std::optional<ThermalCalibration> thermal;
  Eigen::Isometry3d depth_from_pose =
      Eigen::Isometry3d::Identity();  ///< From the camera whose poses are given to the depth camera.
  bool is_world_to_camera = false;    ///< The sense of the poses.
};

/// Reads calibration.json and the picture that it names. Errors name the key: what is missing, no number, not finite, no rotation, or absurd. Safe on untrusted input.
base::Result<Calibration> read_calibration(const std::filesystem::path& file);
/// The same of its text alone, without the picture.
base::Result<Calibration> calibration_from_text(const std::string& text, const std::string& name);

}  // namespace spectra::mapping
