#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "fusion/base/error.hpp"
#include "server/mapping/calibration.hpp"
#include "server/mapping/picture_file.hpp"
#include "server/mapping/trajectory.hpp"

namespace spectra::mapping {

/// What the sensors saw at one time; any of the pictures may be missing.
struct Frame {
  double time_s = 0;
  Picture16 depth;  ///< In units of the calibration.
  PictureRgb colour;
  Picture16 thermal;  ///< Centikelvin.
  /// Of the colour picture, where it was taken at another time.
  std::optional<double> colour_time_s;
};

/// Something that is wrong with a source or a frame, and how often it was.
struct FrameFault {
  std::string what;  ///< For a person, of the first time.
  std::size_t count = 0;
};

/// Why something of a source was not taken. Each is told once and counted.
enum class FaultKind {
  UnreadableLine,  ///< Of frames.txt.
  BackwardClock,
  NoPose,
  JumpingPose,
  UnfittingPose,  ///< The picture contradicts the map where the pose puts it.
  LostTrack,      ///< Tracking does not find where the picture was taken.
  MissingFile,
  DamagedFile,
  WrongSize,
  NoCalibration,  ///< A picture of a camera that the calibration does not have.
  UnreadablePose,
  BackwardPose,
  MapFull,         ///< Something new was not mapped: the map takes all the memory that it may.
  FarStamp,        ///< A stamp of a stream that cannot be meant.
  ClockBegunAnew,  ///< The clock of a stream was set back.
};
inline constexpr std::size_t kFaultKinds = 15;

/// The account of what was wrong.
class FaultLog {
 public:
  void add(FaultKind kind, const std::string& what, std::size_t count = 1);
  void add(const FaultLog& other);
  const FrameFault& of(FaultKind kind) const { return faults_[static_cast<std::size_t>(kind)]; }
  const std::array<FrameFault, kFaultKinds>& all() const { return faults_; }

 private:
  std::array<FrameFault, kFaultKinds> faults_;
};

/// A line of frames.txt; empty paths: that sensor saw nothing then.
struct FrameRow {
  double time_s = 0;
  std::filesystem::path depth, colour, thermal;
};

/// Which pictures of a row are wanted.
struct FrameParts {
  bool depth = true, colour = true, thermal = true;
};

/// A folder of frames: frames.txt (timestamp, then depth, color and thermal picture, - for none), poses.txt, calibration.json.
class FrameFolder {
 public:
  /// Fails when the folder, its calibration or its poses cannot be read, or no line of frames.txt can; single lines that are wrong are in
  /// faults(). `poses`: another file than the folder's. Unless poses are needed, a folder may have no poses.txt.
  static base::Result<FrameFolder> open(const std::filesystem::path& folder,
                                        const std::optional<std::filesystem::path>& poses = std::nullopt,
                                        bool needs_poses = true);

  /// Other poses of the same drive, in the sense and of the camera that the calibration says; lines that are none are left out and stand in `faults`.
  base::Result<Trajectory> read_poses(const std::filesystem::path& file, FaultLog& faults) const;

  const Calibration& calibration() const { return calibration_; }
  /// Of the depth camera, whatever camera the poses were given for.
  const Trajectory& trajectory() const { return trajectory_; }
  const std::vector<FrameRow>& rows() const { return rows_; }
  const FaultLog& faults() const { return faults_; }

  /// The pictures of a row; those that cannot be used are missing and stand in `faults`. From any thread.
  Frame load(std::size_t row, FaultLog& faults, FrameParts parts = {}) const;

 private:
  FrameFolder(std::filesystem::path folder, Calibration calibration, Trajectory trajectory)
      : folder_(std::move(folder)), calibration_(std::move(calibration)), trajectory_(std::move(trajectory)) {}
  void read_rows(const std::string& text);
  template <class Pixel, class Read>
  Picture<Pixel> load_picture(const std::filesystem::path& name, const CameraModel* camera, Read read,
                              const char* sensor, FaultLog& faults) const;

  std::filesystem::path folder_;
  Calibration calibration_;
  Trajectory trajectory_;
  std::vector<FrameRow> rows_;
  FaultLog faults_;
};

}  // namespace spectra::mapping
