#include "server/mapping/heat_looks.hpp"

#include <algorithm>
#include <boost/unordered/unordered_flat_set.hpp>
#include <cmath>
#include <limits>
#include <utility>

#include "server/mapping/mapper.hpp"

namespace spectra::mapping {
namespace {

constexpr float kNearest = 0.1F, kLeastCosine = 0.2588F;
constexpr float kNothing = std::numeric_limits<float>::infinity();
constexpr FrameParts kThermalOnly{false, false, true};
constexpr int kEdgeReach = 2;  ///< Cells of the picture of nearness.
constexpr int kMargin = kEdgeReach + 1;

struct Seen {
  std::uint32_t point;
  float u, v, z, cosine;
};

/// The nearest points, in cells so large that the surface has no holes; a little beyond the picture, too.
class Nearness {
 public:
  Nearness(const CameraModel& camera, int cell)
      : cell_(cell),
        width_((camera.width + cell - 1) / cell + 2 * kMargin),
        height_((camera.height + cell - 1) / cell + 2 * kMargin),
        near_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), kNothing) {}

  void draw(const Seen& seen, float reach_pixels) {
    const int low_x = std::max(0, cell_of(seen.u - reach_pixels)),
              high_x = std::min(width_ - 1, cell_of(seen.u + reach_pixels)),
              low_y = std::max(0, cell_of(seen.v - reach_pixels)),
              high_y = std::min(height_ - 1, cell_of(seen.v + reach_pixels));
    for (int y = low_y; y <= high_y; ++y) {
      for (int x = low_x; x <= high_x; ++x) near_[at(x, y)] = std::min(near_[at(x, y)], seen.z);
    }
  }

  /// Whether all about a point is the same surface: nothing nearer beside it, and nothing missing or much farther.
  bool is_open(const Seen& seen, float slack_m) const {
    const int x = cell_of(seen.u), y = cell_of(seen.v);
    // Over a few cells a surface that is askew has more depth.
    const float tangent = std::sqrt(1 - seen.cosine * seen.cosine) / seen.cosine;
    const float most = slack_m + seen.z * per_cell_ * static_cast<float>(kEdgeReach + 1) * tangent;
    for (int j = -kEdgeReach; j <= kEdgeReach; ++j) {
      for (int i = -kEdgeReach; i <= kEdgeReach; ++i) {
        if (!(std::abs(near_[at(x + i, y + j)] - seen.z) < most)) return false;
      }
    }
    return true;
  }

  void set_focal(float focal) { per_cell_ = static_cast<float>(cell_) / focal; }

 private:
  int cell_of(float pixel) const {
    return static_cast<int>(std::floor((pixel + 0.5F) / static_cast<float>(cell_))) + kMargin;
  }
  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }

  int cell_, width_, height_;
  float per_cell_ = 0;
  std::vector<float> near_;
};

}  // namespace

SurfacePoints points_of(const UnitMesh& mesh, double spacing_m) {
  std::vector<Eigen::Vector3f> normals(mesh.positions.size(), Eigen::Vector3f::Zero());
  const auto position = [&](std::uint32_t i) {
    return Eigen::Vector3f(mesh.positions[i].x, mesh.positions[i].y, mesh.positions[i].z);
  };
  for (const base::Triangle& t : mesh.triangles) {
    const Eigen::Vector3f normal = (position(t[1]) - position(t[0])).cross(position(t[2]) - position(t[0]));
    for (const std::uint32_t corner : t) normals[corner] += normal;
  }
  SurfacePoints points;
  points.spacing_m = static_cast<float>(spacing_m);
  boost::unordered_flat_set<std::uint64_t> taken;
  for (std::uint32_t i = 0; i < normals.size(); ++i) {
    const float length = normals[i].norm();
    if (!(length > 0)) continue;
    const Eigen::Vector3f p = position(i);
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const auto cell = static_cast<std::int64_t>(std::floor(static_cast<double>(p[axis]) / spacing_m));
      key = key << 21 | (static_cast<std::uint64_t>(cell) & 0x1fffff);
    }
    if (!taken.insert(key).second) continue;
    points.positions.push_back(p);
    points.normals.push_back(normals[i] / length);
  }
  return points;
}

SurfacePoints surface_of(const FrameFolder& folder, double voxel_m, std::size_t most_frames, jobs::WorkerPool& pool,
                         FaultLog& faults, const base::Progress& progress) {
  MapperSettings settings;
  settings.voxel_m = voxel_m;
  settings.use_colour = settings.use_thermal = false;
  settings.mesh.least_weight = 1;
  Mapper mapper(folder.calibration(), settings, pool);
  std::vector<std::size_t> rows;
  for (std::size_t row = 0; row < folder.rows().size(); ++row) {
    if (!folder.rows()[row].depth.empty()) rows.push_back(row);
  }
  const std::size_t step = (rows.size() + most_frames - 1) / std::max<std::size_t>(1, most_frames);
  for (std::size_t i = 0; i < rows.size(); i += step) {
    mapper.fuse(folder.load(rows[i], faults, {true, false, false}), folder.trajectory(), faults);
    base::report(progress, kSurfacePhase, static_cast<double>(i) / static_cast<double>(rows.size()));
  }
  return points_of(mapper.whole_mesh(), voxel_m);
}

std::vector<HeatLook> looks_at(const SurfacePoints& points, const Picture16& picture, const CameraModel& camera,
                               const Eigen::Isometry3d& world_from_camera) {
  const Eigen::Isometry3d camera_from_world = world_from_camera.inverse();
  // Relative to the camera, so that single precision holds wherever the map is.
  const Eigen::Vector3d eye = world_from_camera.translation();
  const Eigen::Matrix3f turn = camera_from_world.linear().cast<float>();
  const Lens lens(camera);
  constexpr int kCell = 3;
  constexpr float kBeyond = kCell * kMargin;
  Nearness nearness(camera, kCell);
  nearness.set_focal(lens.fx);
  std::vector<Seen> seen;
  for (std::uint32_t i = 0; i < points.positions.size(); ++i) {
    const Eigen::Vector3f from_eye = (points.positions[i].cast<double>() - eye).cast<float>();
    const Eigen::Vector3f p = turn * from_eye;
    if (p.z() < kNearest) continue;
    const float cosine = -points.normals[i].dot(from_eye) / from_eye.norm();
    Seen at{i, 0, 0, p.z(), cosine};
    lens.project(p.x() / p.z(), p.y() / p.z(), at.u, at.v);
    const auto right = static_cast<float>(camera.width - 1), bottom = static_cast<float>(camera.height - 1);
    if (!(at.u > -kBeyond && at.v > -kBeyond && at.u < right + kBeyond && at.v < bottom + kBeyond)) continue;
    // What is seen from behind hides, too.
    nearness.draw(at, 0.75F * points.spacing_m * lens.fx / p.z());
    const bool is_inside = at.u >= 0 && at.v >= 0 && at.u < right && at.v < bottom;
    if (is_inside && cosine >= kLeastCosine) seen.push_back(at);
  }
  std::vector<HeatLook> looks;
  looks.reserve(seen.size());
  for (const Seen& at : seen) {
    if (!nearness.is_open(at, std::max(3 * points.spacing_m, 0.02F * at.z))) continue;
    const int x = static_cast<int>(at.u), y = static_cast<int>(at.v);
    const float a = at.u - static_cast<float>(x), b = at.v - static_cast<float>(y);
    const auto value = [&](int i, int j) { return static_cast<float>(picture.at(x + i, y + j)); };
    const float centikelvin =
        (1 - b) * ((1 - a) * value(0, 0) + a * value(1, 0)) + b * ((1 - a) * value(0, 1) + a * value(1, 1));
    looks.push_back({at.point, at.u, at.v, centikelvin * 0.01F - 273.15F});
  }
  return looks;
}

ThermalPictures thermal_pictures(const FrameFolder& folder, std::size_t most, FaultLog& faults,
                                 const base::Progress& progress) {
  std::vector<std::size_t> rows;
  for (std::size_t row = 0; row < folder.rows().size(); ++row) {
    if (!folder.rows()[row].thermal.empty()) rows.push_back(row);
  }
  ThermalPictures taken;
  const std::size_t step = (rows.size() + most - 1) / std::max<std::size_t>(1, most);
  for (std::size_t i = 0; i < rows.size(); i += step) {
    Picture16 picture = folder.load(rows[i], faults, kThermalOnly).thermal;
    base::report(progress, kThermalPhase, static_cast<double>(i) / static_cast<double>(rows.size()));
    if (picture.empty()) continue;
    // A closed shutter shows the picture before it, which may not be among those that were read.
    const bool is_shut = i > 0 && step > 1
                             ? folder.load(rows[i - 1], faults, kThermalOnly).thermal.pixels == picture.pixels
                             : !taken.pictures.empty() && taken.pictures.back().pixels == picture.pixels;
    if (is_shut) continue;
    taken.stamps_s.push_back(folder.rows()[rows[i]].time_s);
    taken.pictures.push_back(std::move(picture));
  }
  return taken;
}

}  // namespace spectra::mapping
