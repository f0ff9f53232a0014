#include "server/mapping/frame_folder.hpp"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <utility>

namespace spectra::mapping {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

/// A path inside the folder, or nothing for what leads out of it.
std::optional<fs::path> inside(const std::string& word) {
  if (word == "-") return fs::path();
  const fs::path path = fs::path(word).lexically_normal();
  if (path.is_absolute() || path.empty() || *path.begin() == "..") return std::nullopt;
  return path;
}

void note_faults(const TrajectoryNotes& notes, const fs::path& file, FaultLog& faults) {
  if (notes.unreadable > 0) {
    faults.add(FaultKind::UnreadablePose,
               file.string() + ": lines without a time, a place and a rotation, or 1,000 km or more from 0",
               notes.unreadable);
  }
  if (notes.backwards > 0) {
    faults.add(FaultKind::BackwardPose, file.string() + ": poses that are not later than the one before",
               notes.backwards);
  }
}

}  // namespace

void FaultLog::add(FaultKind kind, const std::string& what, std::size_t count) {
  FrameFault& fault = faults_[static_cast<std::size_t>(kind)];
  if (fault.count == 0) fault.what = what;
  fault.count += count;
}

void FaultLog::add(const FaultLog& other) {
  for (std::size_t i = 0; i < kFaultKinds; ++i) {
    if (other.faults_[i].count > 0) add(static_cast<FaultKind>(i), other.faults_[i].what, other.faults_[i].count);
  }
}

Result<Trajectory> FrameFolder::read_poses(const fs::path& file, FaultLog& faults) const {
  BOOST_OUTCOME_TRY(auto poses, Trajectory::read(file));
  poses.change_to(calibration_.is_world_to_camera, calibration_.depth_from_pose);
  note_faults(poses.notes(), file, faults);
  return poses;
}

Result<FrameFolder> FrameFolder::open(const fs::path& folder, const std::optional<fs::path>& poses, bool needs_poses) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    return base::failure(ErrorCode::FileNotFound,
                         folder.string() + ": is no folder of frames (frames.txt, poses.txt, calibration.json)");
  }
  BOOST_OUTCOME_TRY(auto calibration, read_calibration(folder / "calibration.json"));
  const fs::path pose_file = poses.value_or(folder / "poses.txt");
  Trajectory trajectory;
  if (needs_poses || poses || fs::exists(pose_file, error)) {
    BOOST_OUTCOME_TRY(auto read, Trajectory::read(pose_file));
    trajectory = std::move(read);
  }
  std::ifstream in(folder / "frames.txt", std::ios::binary);
  if (!in) return base::failure(ErrorCode::FileNotFound, (folder / "frames.txt").string() + ": cannot be read");
  const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  trajectory.change_to(calibration.is_world_to_camera, calibration.depth_from_pose);
  FrameFolder frames(folder, std::move(calibration), std::move(trajectory));
  note_faults(frames.trajectory_.notes(), pose_file, frames.faults_);
  frames.read_rows(text);
  if (frames.rows_.empty()) {
    return base::failure(
        ErrorCode::BadValue,
        (folder / "frames.txt").string() +
            ": there is no frame in it; lines of timestamp, depth, color and thermal picture are wanted");
  }
  return frames;
}

void FrameFolder::read_rows(const std::string& text) {
  std::istringstream lines(text);
  std::string line;
  std::size_t number = 0;
  while (std::getline(lines, line)) {
    ++number;
    const auto first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    const std::string where = (folder_ / "frames.txt").string() + " line " + std::to_string(number) + ": ";
    std::istringstream words(line);
    std::string time, depth, colour, thermal;
    words >> time >> depth >> colour >> thermal;
    char* end = nullptr;
    const double seconds = std::strtod(time.c_str(), &end);
    const auto depth_path = inside(depth), colour_path = inside(colour), thermal_path = inside(thermal);
    if (*end != '\0' || !std::isfinite(seconds) || thermal.empty() || !depth_path || !colour_path || !thermal_path) {
      faults_.add(FaultKind::UnreadableLine, where + "is not a timestamp and three pictures inside of the folder");
      continue;
    }
    if (!rows_.empty() && !(seconds > rows_.back().time_s)) {
      faults_.add(FaultKind::BackwardClock, where + "the time is not later than that of the frame before");
      continue;
    }
    rows_.push_back({seconds, *depth_path, *colour_path, *thermal_path});
  }
}

template <class Pixel, class Read>
Picture<Pixel> FrameFolder::load_picture(const fs::path& name, const CameraModel* camera, Read read, const char* sensor,
                                         FaultLog& faults) const {
  if (name.empty()) return {};
  const fs::path file = folder_ / name;
  if (camera == nullptr) {
    faults.add(FaultKind::NoCalibration, file.string() + ": calibration.json has no " + sensor + " camera");
    return {};
  }
  auto picture = read(file);
  if (!picture) {
    const bool is_missing = picture.error().code == ErrorCode::FileNotFound;
    faults.add(is_missing ? FaultKind::MissingFile : FaultKind::DamagedFile, picture.error().message);
    return {};
  }
  const auto& got = picture.value();
  if (got.width != camera->width || got.height != camera->height) {
    const auto size = [](int width, int height) { return std::to_string(width) + " x " + std::to_string(height); };
    faults.add(FaultKind::WrongSize, file.string() + ": is " + size(got.width, got.height) + " pixels, and the " +
                                         sensor + " camera of calibration.json has " +
                                         size(camera->width, camera->height));
    return {};
  }
  return std::move(picture).value();
}

Frame FrameFolder::load(std::size_t row, FaultLog& faults, FrameParts parts) const {
  const FrameRow& from = rows_[row];
  Frame frame;
  frame.time_s = from.time_s;
  if (parts.depth) {
    frame.depth = load_picture<std::uint16_t>(from.depth, &calibration_.depth.camera, read_png16, "depth", faults);
  }
  if (parts.colour) {
    frame.colour = load_picture<base::Rgb8>(from.colour, calibration_.colour ? &calibration_.colour->camera : nullptr,
                                            read_colour, "color", faults);
  }
  if (parts.thermal) {
    frame.thermal = load_picture<std::uint16_t>(
        from.thermal, calibration_.thermal ? &calibration_.thermal->camera : nullptr, read_png16, "thermal", faults);
  }
  return frame;
}

}  // namespace spectra::mapping
