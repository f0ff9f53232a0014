#include "server/mapping/frame_folder_writer.hpp"

#include <atomic>
#include <cstdio>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>

#include "fusion/files/output_file.hpp"
#include "fusion/files/ply_writer.hpp"

namespace spectra::mapping {
namespace {

namespace fs = std::filesystem;
using base::Result;
using nlohmann::json;

Result<void> write_text(const fs::path& file, const std::string& text) {
  BOOST_OUTCOME_TRY(auto out, files::OutputFile::create(file));
  BOOST_OUTCOME_TRYV(out.write(std::as_bytes(std::span(text))));
  return out.commit();
}

json camera_json(const CameraModel& camera) {
  return {{"width", camera.width},
          {"height", camera.height},
          {"fx", camera.fx},
          {"fy", camera.fy},
          {"cx", camera.cx},
          {"cy", camera.cy},
          {"distortion", camera.distortion}};
}

json transform_json(const Eigen::Isometry3d& transform) {
  json rows = json::array();
  for (int r = 0; r < 4; ++r) {
    rows.push_back(
        {transform.matrix()(r, 0), transform.matrix()(r, 1), transform.matrix()(r, 2), transform.matrix()(r, 3)});
  }
  return rows;
}

std::string calibration_text(const Calibration& calibration) {
  json depth = camera_json(calibration.depth.camera);
  depth["unit_m"] = calibration.depth.unit_m;
  depth["invalid"] = calibration.depth.invalid;
  json colour = camera_json(calibration.colour->camera);
  colour["from_depth"] = transform_json(calibration.colour->from_depth);
  json thermal = camera_json(calibration.thermal->camera);
  thermal["from_depth"] = transform_json(calibration.thermal->from_depth);
  thermal["unit"] = "centikelvin";
  thermal["netd_kelvin"] = calibration.thermal->netd_kelvin;
  thermal["emissivity"] = calibration.thermal->emissivity;
  if (calibration.thermal->reflected_celsius) thermal["reflected_celsius"] = *calibration.thermal->reflected_celsius;
  const json all = {{"depth", depth},
                    {"color", colour},
                    {"thermal", thermal},
                    {"poses", {{"of", "depth"}, {"sense", "camera_to_world"}}}};
  return all.dump(1) + "\n";
}

std::string name_of(const char* folder, std::size_t index, const char* ending) {
  char name[40];
  std::snprintf(name, sizeof name, "%s/%06zu.%s", folder, index, ending);
  return name;
}

/// A line a moment: what has the same stamp shares one.
std::string row_lines(const SimulatedDrive& drive) {
  std::string lines;
  for (std::size_t i = 0; i < drive.frame_count(); ++i) {
    char stamp[40], next[40] = "";
    std::snprintf(stamp, sizeof stamp, "%.6f ", drive.stamp_s(i));
    if (i + 1 < drive.frame_count()) std::snprintf(next, sizeof next, "%.6f ", drive.stamp_s(i + 1));
    const bool is_shared = std::string(stamp) == next;
    std::string depth = "- - ", thermal = "-";
    for (const std::size_t k : {i, is_shared ? i + 1 : i}) {
      if (drive.is_thermal(k)) {
        thermal = name_of("thermal", k, "png");
      } else {
        depth = name_of("depth", k, "png") + " " + name_of("color", k, "jpg") + " ";
      }
    }
    lines += stamp + depth + thermal + "\n";
    if (is_shared) ++i;
  }
  return lines;
}

Result<void> write_frame(const fs::path& folder, const SimulatedDrive& drive, std::size_t index) {
  const Frame frame = drive.frame(index);
  if (drive.is_thermal(index)) return write_png16(folder / name_of("thermal", index, "png"), frame.thermal);
  BOOST_OUTCOME_TRYV(write_png16(folder / name_of("depth", index, "png"), frame.depth));
  return write_jpeg(folder / name_of("color", index, "jpg"), frame.colour, 92);
}

}  // namespace

Result<void> write_drive(const fs::path& folder, const SimulatedDrive& drive, jobs::WorkerPool& pool,
                         const base::Progress& progress) {
  std::error_code error;
  if (fs::exists(folder / "frames.txt", error)) {
    return base::failure(base::ErrorCode::FileUnwritable,
                         folder.string() + ": holds frames already; name another folder");
  }
  for (const char* part : {"depth", "color", "thermal"}) {
    fs::create_directories(folder / part, error);
    if (error) return base::failure(base::ErrorCode::FileUnwritable, (folder / part).string() + ": " + error.message());
  }
  BOOST_OUTCOME_TRYV(write_text(folder / "calibration.json", calibration_text(drive.calibration())));
  const std::string rows = "# timestamp depth color thermal\n";
  Trajectory told, truth;
  for (double time = drive.trajectory().begin_s(); time <= drive.trajectory().end_s(); time += 0.02) {
    const PoseAnswer answer = drive.trajectory().at(time);
    if (answer.state == PoseState::Known) told.add(time, answer.pose);
    truth.add(time, drive.true_pose(time));
  }
  BOOST_OUTCOME_TRYV(write_text(folder / "poses.txt", told.to_text()));
  BOOST_OUTCOME_TRYV(write_text(folder / "true_poses.txt", truth.to_text()));
  BOOST_OUTCOME_TRYV(
      files::write_ply(folder / "truth.ply", drive.truth(), drive.truth().visible(), "up y; positions in metres"));

  std::atomic<std::size_t> done{0};
  std::mutex mutex;
  std::optional<base::Error> problem;
  pool.for_each(drive.frame_count(), [&](std::size_t index) {
    {
      const std::lock_guard lock(mutex);
      if (problem) return;
    }
    const auto written = write_frame(folder, drive, index);
    if (!written) {
      const std::lock_guard lock(mutex);
      if (!problem) problem = written.error();
    }
    base::report(progress, base::kWritingPhase, static_cast<double>(++done) / static_cast<double>(drive.frame_count()));
  });
  if (problem) return BOOST_OUTCOME_V2_NAMESPACE::failure(*problem);
  return write_text(folder / "frames.txt", rows + row_lines(drive));
}

}  // namespace spectra::mapping
