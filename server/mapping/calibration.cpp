#include "server/mapping/calibration.hpp"

#include <Eigen/LU>
#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

namespace spectra::mapping {
namespace {

using base::ErrorCode;
using base::Result;
using nlohmann::json;

constexpr std::size_t kMostBytes = 1 << 20;
constexpr int kMostPixels = 8192;

/// Reads members of one object and remembers the first thing that is wrong.
class Reader {
 public:
  Reader(const json& object, std::string path, std::string& problem)
      : object_(object), path_(std::move(path)), problem_(problem) {}

  const json* member(const char* key, bool is_needed) const {
    const auto found = object_.find(key);
    if (found != object_.end() && !found->is_null()) return &*found;
    if (is_needed) wrong(key, "is missing");
    return nullptr;
  }

  void number(const char* key, double& value, double low, double high, bool is_needed = false) const {
    const json* found = member(key, is_needed);
    if (found == nullptr) return;
    const double read = found->is_number() ? found->get<double>() : std::nan("");
    if (!(read >= low && read <= high)) {
      return wrong(key,
                   "must be a number from " + text(low) + " to " + text(high) + ", not " + found->dump().substr(0, 40));
    }
    value = read;
  }

  void camera(CameraModel& camera) const {
    double width = 0, height = 0;
    number("width", width, 8, kMostPixels, true);
    number("height", height, 8, kMostPixels, true);
    camera.width = static_cast<int>(width);
    camera.height = static_cast<int>(height);
    number("fx", camera.fx, 1, 1e5, true);
    number("fy", camera.fy, 1, 1e5, true);
    number("cx", camera.cx, -1e5, 1e5, true);
    number("cy", camera.cy, -1e5, 1e5, true);
    const json* lens = member("distortion", false);
    if (lens == nullptr) return;
    if (!lens->is_array() || lens->size() > 4) return wrong("distortion", "must be up to four numbers k1, k2, p1, p2");
    for (std::size_t i = 0; i < lens->size(); ++i) {
      const double k = (*lens)[i].is_number() ? (*lens)[i].get<double>() : std::nan("");
      if (!(std::abs(k) < 10)) return wrong("distortion", "must be numbers between -10 and 10");
      camera.distortion[i] = k;
    }
  }

  void transform(const char* key, Eigen::Isometry3d& transform) const {
    const json* rows = member(key, true);
    if (rows == nullptr) return;
    Eigen::Matrix4d matrix;
    bool is_matrix = rows->is_array() && rows->size() == 4;
    for (std::size_t r = 0; is_matrix && r < 4; ++r) {
      is_matrix = (*rows)[r].is_array() && (*rows)[r].size() == 4;
      for (std::size_t c = 0; is_matrix && c < 4; ++c) {
        const json& value = (*rows)[r][c];
        is_matrix = value.is_number() && std::isfinite(value.get<double>());
        if (is_matrix) matrix(static_cast<int>(r), static_cast<int>(c)) = value.get<double>();
      }
    }
    if (!is_matrix) return wrong(key, "must be four rows of four numbers");
    const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
    const bool is_rigid =
        (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 0.01 &&
        rotation.determinant() > 0 && matrix.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), 1e-6);
    if (!is_rigid) return wrong(key, "is no rotation and translation");
    if (matrix.topRightCorner<3, 1>().norm() > 10) return wrong(key, "puts the cameras more than 10 m apart");
    // Rounded digits make it almost a rotation; the nearest one is meant.
    transform.linear() = Eigen::Quaterniond(rotation).normalized().toRotationMatrix();
    transform.translation() = matrix.topRightCorner<3, 1>();
  }

  void wrong(const char* key, const std::string& what) const {
    if (problem_.empty()) problem_ = path_ + key + " " + what;
  }

 private:
  static std::string text(double value) {
    std::string digits = std::to_string(value);
    digits.erase(digits.find_last_not_of('0') + 1);
    return digits.back() == '.' ? digits.substr(0, digits.size() - 1) : digits;
  }

  const json& object_;
  const std::string path_;
  std::string& problem_;
};

void read_depth(const Reader& reader, DepthCalibration& depth) {
  double invalid = depth.invalid;
  reader.camera(depth.camera);
  reader.number("unit_m", depth.unit_m, 1e-6, 1);
  reader.number("invalid", invalid, 0, 65535);
  reader.number("delay_s", depth.delay_s, -10, 10);
  reader.number("noise_base_m", depth.noise.base_m, 1e-5, 1);
  reader.number("noise_growth_per_m", depth.noise.growth_per_m, 0, 1);
  reader.number("noise_from_m", depth.noise.from_m, 0, 100);
  depth.invalid = static_cast<std::uint16_t>(invalid);
}

void read_thermal(const Reader& reader, ThermalCalibration& thermal) {
  reader.camera(thermal.camera);
  reader.transform("from_depth", thermal.from_depth);
  reader.number("delay_s", thermal.delay_s, -10, 10);
  reader.number("netd_kelvin", thermal.netd_kelvin, 1e-4, 10);
  reader.number("emissivity", thermal.emissivity, 0.1, 1);
  if (reader.member("reflected_celsius", false) != nullptr) {
    double reflected = 0;
    reader.number("reflected_celsius", reflected, -273, 2000);
    thermal.reflected_celsius = reflected;
  }
  if (const json* file = reader.member("vignetting", false)) {
    const std::filesystem::path path = file->is_string() ? file->get<std::string>() : std::string();
    if (path.empty() || path.has_parent_path() || path.filename() == "..")
      reader.wrong("vignetting", "must be the name of a PFM picture in the same folder");
    thermal.vignetting_file = path.string();
  }
  const json* unit = reader.member("unit", false);
  if (unit != nullptr && *unit != "centikelvin")
    reader.wrong("unit", "must be \"centikelvin\", which is all that is read");
}

void read_poses(const Reader& reader, Calibration& calibration) {
  const json* of = reader.member("of", false);
  if (of != nullptr && *of == "color" && calibration.colour) {
    calibration.depth_from_pose = calibration.colour->from_depth.inverse();
  } else if (of != nullptr && *of == "thermal" && calibration.thermal) {
    calibration.depth_from_pose = calibration.thermal->from_depth.inverse();
  } else if (of != nullptr && *of != "depth") {
    reader.wrong("of", "must be the depth, color or thermal camera");
  }
  const json* sense = reader.member("sense", false);
  calibration.is_world_to_camera = sense != nullptr && *sense == "world_to_camera";
  if (sense != nullptr && *sense != "world_to_camera" && *sense != "camera_to_world") {
    reader.wrong("sense", "must be camera_to_world or world_to_camera");
  }
}

}  // namespace

Result<Calibration> calibration_from_text(const std::string& text, const std::string& name) {
  const auto failed = [&](const std::string& what) {
    return base::failure(ErrorCode::BadValue, name + ": " + what + "; it describes the cameras as docs/mapping.md says",
                         "calibration");
  };
  const json document = json::parse(text, nullptr, false);
  if (!document.is_object()) return failed("this is no JSON object");
  Calibration calibration;
  std::string problem;
  const auto part = [&](const char* key) -> const json* {
    const auto found = document.find(key);
    if (found == document.end() || found->is_null()) return nullptr;
    if (!found->is_object() && problem.empty()) problem = std::string(key) + " must be an object";
    return found->is_object() ? &*found : nullptr;
  };
  const json* depth = part("depth");
  if (depth == nullptr) return failed(problem.empty() ? "depth is missing" : problem);
  read_depth(Reader(*depth, "depth.", problem), calibration.depth);
  if (const json* colour = part("color")) {
    calibration.colour.emplace();
    const Reader reader(*colour, "color.", problem);
    reader.camera(calibration.colour->camera);
    reader.transform("from_depth", calibration.colour->from_depth);
    reader.number("delay_s", calibration.colour->delay_s, -10, 10);
  }
  if (const json* thermal = part("thermal")) {
    read_thermal(Reader(*thermal, "thermal.", problem), calibration.thermal.emplace());
  }
  if (const json* poses = part("poses")) read_poses(Reader(*poses, "poses.", problem), calibration);
  if (!problem.empty()) return failed(problem);
  return calibration;
}

Result<Calibration> read_calibration(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in)
    return base::failure(ErrorCode::FileNotFound, file.string() + ": the calibration of the cameras cannot be read");
  std::string text;
  text.resize(kMostBytes);
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(in.gcount()));
  BOOST_OUTCOME_TRY(auto calibration, calibration_from_text(text, file.string()));
  if (calibration.thermal && !calibration.thermal->vignetting_file.empty()) {
    ThermalCalibration& thermal = *calibration.thermal;
    BOOST_OUTCOME_TRY(auto picture, read_pfm(file.parent_path() / thermal.vignetting_file));
    if (picture.width != thermal.camera.width || picture.height != thermal.camera.height) {
      return base::failure(
          ErrorCode::BadValue,
          file.string() + ": thermal.vignetting names a picture that is not of the size of the thermal camera",
          "calibration");
    }
    thermal.vignetting = std::move(picture);
  }
  return calibration;
}

}  // namespace spectra::mapping
