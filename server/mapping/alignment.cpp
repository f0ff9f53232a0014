#include "server/mapping/alignment.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "server/mapping/depth_fusion.hpp"
#include "server/mapping/map_sampler.hpp"

namespace spectra::mapping {
namespace {

constexpr std::size_t kChunk = 512;
constexpr float kSurfaceVoxels = 0.3F;                       ///< Of the map's own error, beside the sensor's.
constexpr float kLumaSigma = 15, kHeatSigma = 0.2F;          ///< Levels; kelvin.
constexpr float kLeastLumaStep = 3, kLeastHeatStep = 0.06F;  ///< A voxel; less may be noise of the map.
constexpr float kMostHeatSigma = 1;
constexpr float kHuber = 1.5F;
constexpr float kMatchingSigmas = 3;
/// Errors of neighbours are alike: so many points count as one when it comes to how certain the pose is.
constexpr double kPointsAlike = 10;
constexpr double kGuessMetres = 0.05, kGuessRadians = 0.05;  ///< What a guess may be off by.
constexpr int kCoarseRounds = 6, kFineRounds = 6;
/// Of motion_between(): the farthest that a plane may be, in its first and its last round; pixels between which its direction is taken.
constexpr float kFarthestFirst = 0.3F, kFarthestLast = 0.1F;
constexpr int kMotionRounds = 12, kPlaneReach = 4;
constexpr float kPlaneBend = 0.1F;   ///< Of z: pixels of one plane do not differ by more.
constexpr float kLeastAlike = 0.9F;  ///< Cosine between the directions of planes that may be one.
constexpr std::size_t kLeastPaired = 200;
constexpr double kLastMetres = 1e-4, kLastRadians = 1e-4;  ///< A smaller step ends it.

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// Squares summed over points, the upper triangle row after row.
struct Sums {
  std::array<double, 21> normal{};
  std::array<double, 6> right{};
  std::size_t known = 0, matching = 0;
  double trust = 0;                                                     ///< 1 / sigma^2 of all that are known.
  double squares = 0;                                                   ///< m^2, of those that match.
  double luma_off = 0, luma_weight = 0, heat_off = 0, heat_weight = 0;  ///< Of the change that all have in common.

  void add_row(const Eigen::Vector3f& arm, const Eigen::Vector3f& direction, float residual, float weight) {
    const Eigen::Vector3f turn = arm.cross(direction);
    const std::array<double, 6> row{turn.x(), turn.y(), turn.z(), direction.x(), direction.y(), direction.z()};
    const auto w = static_cast<double>(weight), r = static_cast<double>(residual);
    std::size_t k = 0;
    for (std::size_t i = 0; i < 6; ++i) {
      const double scaled = w * row[i];
      right[i] -= scaled * r;
      for (std::size_t j = i; j < 6; ++j) normal[k++] += scaled * row[j];
    }
  }

  void add(const Sums& other) {
    for (std::size_t i = 0; i < normal.size(); ++i) normal[i] += other.normal[i];
    for (std::size_t i = 0; i < right.size(); ++i) right[i] += other.right[i];
    known += other.known;
    matching += other.matching;
    trust += other.trust;
    squares += other.squares;
    luma_off += other.luma_off;
    luma_weight += other.luma_weight;
    heat_off += other.heat_off;
    heat_weight += other.heat_weight;
  }

  Matrix6 matrix() const {
    Matrix6 m;
    std::size_t k = 0;
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) m(i, j) = m(j, i) = normal[k++];
    }
    return m;
  }
};

/// Huber's weight of a residual in standard deviations.
float huber(float deviations) {
  const float size = std::abs(deviations);
  return size > kHuber ? kHuber / size : 1;
}

struct Common {
  float luma = 0, heat = 0;
};

struct Work {
  const VoxelMap& map;
  const SeenPoints& seen;
  std::size_t count;
  AlignmentTerms terms;
  bool has_normal;  ///< Else only counted.
  /// Of each point, of the round before: most points are in the same one in the next.
  std::vector<SampledCell>& cells;

  Sums sums(const Eigen::Isometry3d& pose, const Common& common, jobs::WorkerPool& pool) const {
    std::vector<Sums> parts((count + kChunk - 1) / kChunk);
    pool.for_each(parts.size(), [&](std::size_t part) {
      MapSampler sampler(map);
      const std::size_t end = std::min(count, (part + 1) * kChunk);
      for (std::size_t i = part * kChunk; i < end; ++i) add(sampler, pose, common, i, parts[part]);
    });
    Sums all;
    for (const Sums& part : parts) all.add(part);
    return all;
  }

  void add(MapSampler& sampler, const Eigen::Isometry3d& pose, const Common& common, std::size_t i, Sums& sums) const {
    const SeenPoint& point = seen.points[i];
    const Eigen::Vector3d arm = pose.linear() * point.place.cast<double>();
    sampler.seek(pose.translation() + arm, cells[i]);
    const auto truncation = static_cast<float>(kTruncationVoxels * map.voxel_m());
    const auto voxel = static_cast<float>(map.voxel_m());
    Sampled field;
    if (!sampler.distance(field)) return;
    // Along lines of sight distances are longer than those to the surface, as the gradient is larger.
    const float steepness = field.gradient.norm() * truncation;
    if (steepness < 0.3F) return;
    ++sums.known;
    const Eigen::Vector3f normal = field.gradient * (truncation / steepness);
    const float off = field.value * truncation / steepness;
    const float surface = kSurfaceVoxels * voxel;
    const float sigma = std::sqrt(point.sigma_m * point.sigma_m + surface * surface);
    if (std::abs(off) < kMatchingSigmas * sigma) {
      ++sums.matching;
      sums.squares += static_cast<double>(off) * static_cast<double>(off);
    }
    if (!has_normal) return;
    sums.trust += 1 / static_cast<double>(sigma * sigma);
    const Eigen::Vector3f lever = arm.cast<float>();
    sums.add_row(lever, normal, off, huber(off / sigma) / (sigma * sigma));
    if (std::abs(off) > 2 * voxel) return;  // another surface than the one that is seen
    if (terms.colour && !std::isnan(point.luma)) {
      Sampled luma;
      if (sampler.luma(luma)) {
        add_value(lever, normal, luma, point.luma, common.luma, kLumaSigma, kLeastLumaStep / voxel, sums, sums.luma_off,
                  sums.luma_weight);
      }
    }
    if (terms.thermal && !std::isnan(point.celsius)) {
      Sampled heat;
      if (sampler.celsius(kMostHeatSigma, heat)) {
        add_value(lever, normal, heat, point.celsius, common.heat, kHeatSigma, kLeastHeatStep / voxel, sums,
                  sums.heat_off, sums.heat_weight);
      }
    }
  }

  static void add_value(const Eigen::Vector3f& lever, const Eigen::Vector3f& normal, const Sampled& known, float seen,
                        float common, float sigma, float least_gradient, Sums& sums, double& off, double& weight) {
    const float difference = known.value - seen;
    const float residual = difference - common;
    const float w = huber(residual / sigma);
    off += static_cast<double>(w * difference);
    weight += static_cast<double>(w);
    const Eigen::Vector3f along = known.gradient - normal * normal.dot(known.gradient);
    if (along.squaredNorm() < least_gradient * least_gradient) return;
    sums.add_row(lever, along, residual, w / (sigma * sigma));
  }
};

/// Cells that know nothing, in memory that is used again: until the next call of this thread.
std::vector<SampledCell>& fresh_cells(std::size_t count) {
  thread_local std::vector<SampledCell> cells;
  cells.clear();
  cells.resize(count);
  return cells;
}

void count_into(const Sums& sums, std::size_t count, Alignment& found) {
  found.point_count = count;
  found.known_count = sums.known;
  found.matching_count = sums.matching;
  found.residual_m = sums.matching > 0 ? std::sqrt(sums.squares / static_cast<double>(sums.matching)) : 0;
}

void move(Eigen::Isometry3d& pose, const Vector6& step) {
  const Eigen::Vector3d turn = step.head<3>();
  const double angle = turn.norm();
  if (angle > 0) {
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
    pose.linear() = Eigen::Quaterniond(rotation * pose.linear()).normalized().toRotationMatrix();
  }
  pose.translation() += step.tail<3>();
}

/// From the pose that was guessed to another: turn and way, in the world.
Vector6 difference(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to) {
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(to.linear() * from.linear().transpose()));
  Vector6 d;
  d << turn.axis() * turn.angle(), to.translation() - from.translation();
  return d;
}

/// What a guess weighs beside points.
Vector6 expectation() {
  Vector6 expected;
  expected << Eigen::Vector3d::Constant(kPointsAlike / (kGuessRadians * kGuessRadians)),
      Eigen::Vector3d::Constant(kPointsAlike / (kGuessMetres * kGuessMetres));
  return expected;
}

/// A pixel of a depth picture and the plane through it, in the axes of its camera.
struct SeenPlane {
  Eigen::Vector3f place, normal;
};

/// A plane that was looked for at a pixel.
struct PlaneAtPixel {
  std::size_t pixel = std::numeric_limits<std::size_t>::max();
  bool is_plane = false;
  SeenPlane plane;
};

/// Pixels of a depth picture that count, metres; 0: it does not.
struct CountedDepth {
  const std::vector<float>& depth_m;
  const RayTable& rays;
  Lens lens;

  /// The plane where a camera sees a place; `last`: one that was found before. Null where one of the pixels about it does not count, or where
  /// there is no plane.
  const SeenPlane* plane_at(const Eigen::Vector3f& seen_at, PlaneAtPixel& last) const {
    if (seen_at.z() < 0.1F) return nullptr;
    float u = 0, v = 0;
    lens.project(seen_at.x() / seen_at.z(), seen_at.y() / seen_at.z(), u, v);
    constexpr auto kMargin = static_cast<float>(kPlaneReach);
    if (!(u >= kMargin && v >= kMargin && u < static_cast<float>(rays.width) - kMargin - 1 &&
          v < static_cast<float>(rays.height) - kMargin - 1))
      return nullptr;
    const auto x = static_cast<std::size_t>(u + 0.5F), y = static_cast<std::size_t>(v + 0.5F);
    const std::size_t pixel = y * static_cast<std::size_t>(rays.width) + x;
    if (pixel != last.pixel) {
      last.pixel = pixel;
      last.is_plane = find_plane(pixel, last.plane);
    }
    return last.is_plane ? &last.plane : nullptr;
  }

  bool find_plane(std::size_t pixel, SeenPlane& plane) const {
    const auto place_at = [&](std::size_t at, Eigen::Vector3f& place) {
      const float z = depth_m[at];
      place = {rays.x[at] * z, rays.y[at] * z, z};
      return z > 0;
    };
    constexpr auto kReach = static_cast<std::size_t>(kPlaneReach);
    const std::size_t down = kReach * static_cast<std::size_t>(rays.width);
    Eigen::Vector3f left, right, above, below;
    if (!place_at(pixel, plane.place) || !place_at(pixel - kReach, left) || !place_at(pixel + kReach, right) ||
        !place_at(pixel - down, above) || !place_at(pixel + down, below))
      return false;
    const float most = kPlaneBend * plane.place.z();
    if (std::abs(right.z() - left.z()) > most || std::abs(below.z() - above.z()) > most) return false;
    plane.normal = (right - left).cross(below - above).normalized();
    return true;
  }
};

/// What planes of an earlier picture say of the motion since.
struct MotionWork {
  CountedDepth before;
  std::vector<SeenPlane> planes;  ///< Of the later picture.
  std::vector<float> sigma_m;
  std::vector<PlaneAtPixel> pairs;  ///< Of the earlier one, of the round before: most are the same in the next.

  Sums sums(const Eigen::Isometry3d& pose, float farthest, jobs::WorkerPool& pool) {
    std::vector<Sums> parts((planes.size() + kChunk - 1) / kChunk);
    pool.for_each(parts.size(), [&](std::size_t part) {
      const std::size_t end = std::min(planes.size(), (part + 1) * kChunk);
      for (std::size_t i = part * kChunk; i < end; ++i) add(pose.cast<float>(), farthest, i, parts[part]);
    });
    Sums all;
    for (const Sums& part : parts) all.add(part);
    return all;
  }

  void add(const Eigen::Isometry3f& pose, float farthest, std::size_t i, Sums& sums) {
    const Eigen::Vector3f arm = pose.linear() * planes[i].place, place = arm + pose.translation();
    const SeenPlane* plane = before.plane_at(place, pairs[i]);
    if (plane == nullptr) return;
    const Eigen::Vector3f apart = place - plane->place;
    if (!(apart.norm() < farthest && plane->normal.dot(pose.linear() * planes[i].normal) > kLeastAlike)) return;
    ++sums.known;
    // What is far from its plane is so by the motion first, and by chance or another surface in the end.
    const float off = plane->normal.dot(apart), slack = (farthest - kFarthestLast) / 3;
    sums.add_row(arm, plane->normal, off, huber(off / (sigma_m[i] + slack)) / (sigma_m[i] * sigma_m[i]));
  }
};

}  // namespace

std::vector<float> counted_depth(const DepthFrame& frame, std::vector<float> depth_m) {
  depth_m.resize(frame.depth_m.size());
  for (std::size_t i = 0; i < depth_m.size(); ++i) depth_m[i] = frame.weight[i] > 0 ? frame.depth_m[i] : 0;
  return depth_m;
}

Eigen::Isometry3d motion_between(const std::vector<float>& before_m, const std::vector<float>& now_m,
                                 const RayTable& rays, const CameraModel& camera, const SeenPoints& seen,
                                 const Eigen::Isometry3d& guess, jobs::WorkerPool& pool) {
  const Lens lens(camera);
  MotionWork work{{before_m, rays, lens}, {}, {}, {}};
  const CountedDepth now{now_m, rays, lens};
  for (std::size_t i = 0; i < seen.coarse_count; ++i) {
    PlaneAtPixel own;
    if (now.plane_at(seen.points[i].place, own) == nullptr) continue;
    work.planes.push_back(own.plane);
    work.sigma_m.push_back(seen.points[i].sigma_m);
  }
  work.pairs.resize(work.planes.size());
  const Matrix6 expected = expectation().asDiagonal();
  Eigen::Isometry3d motion = guess;
  for (int round = 0; round < kMotionRounds; ++round) {
    const float share = static_cast<float>(round) / (kMotionRounds - 1);
    const Sums sums = work.sums(motion, kFarthestFirst + share * (kFarthestLast - kFarthestFirst), pool);
    if (sums.known < kLeastPaired) return guess;
    const Vector6 right = Eigen::Map<const Vector6>(sums.right.data()) - expected * difference(guess, motion);
    const Vector6 step = (sums.matrix() + expected).ldlt().solve(right);
    if (!step.allFinite()) return guess;
    move(motion, step);
  }
  return motion;
}

Alignment fit_at(const VoxelMap& map, const SeenPoints& seen, std::size_t count,
                 const Eigen::Isometry3d& world_from_camera, jobs::WorkerPool& pool) {
  Alignment found;
  found.world_from_camera = world_from_camera;
  count = std::min(count, seen.points.size());
  std::vector<SampledCell>& cells = fresh_cells(count);
  const Work work{map, seen, count, {}, false, cells};
  count_into(work.sums(world_from_camera, {}, pool), work.count, found);
  return found;
}

Alignment align(const VoxelMap& map, const SeenPoints& seen, const Eigen::Isometry3d& guess,
                const AlignmentTerms& terms, jobs::WorkerPool& pool) {
  Alignment found;
  found.world_from_camera = guess;
  const Vector6 expected = expectation();
  Common common;
  Sums last;
  std::vector<SampledCell>& cells = fresh_cells(seen.points.size());
  for (const bool is_coarse : {true, false}) {
    const std::size_t count = is_coarse ? seen.coarse_count : seen.points.size();
    const Work work{map, seen, count, terms, true, cells};
    for (int round = 0; round < (is_coarse ? kCoarseRounds : kFineRounds); ++round) {
      last = work.sums(found.world_from_camera, common, pool);
      ++found.rounds;
      if (last.luma_weight > 0) common.luma = static_cast<float>(last.luma_off / last.luma_weight);
      if (last.heat_weight > 0) common.heat = static_cast<float>(last.heat_off / last.heat_weight);
      const Vector6 moved = difference(guess, found.world_from_camera);
      // The guess counts as it would beside all points.
      const double share = static_cast<double>(count) / static_cast<double>(seen.points.size());
      const Matrix6 normal = last.matrix() + Matrix6((share * expected).asDiagonal());
      const Vector6 right = Eigen::Map<const Vector6>(last.right.data()) - share * expected.cwiseProduct(moved);
      const Vector6 step = normal.ldlt().solve(right);
      if (!step.allFinite()) break;
      move(found.world_from_camera, step);
      const double slack = is_coarse ? 10 : 1;
      if (step.head<3>().norm() < slack * kLastRadians && step.tail<3>().norm() < slack * kLastMetres) break;
    }
  }
  count_into(last, seen.points.size(), found);
  const Matrix6 information = last.matrix() / kPointsAlike;
  const Eigen::SelfAdjointEigenSolver<Matrix6> whole(information, Eigen::EigenvaluesOnly);
  if (whole.eigenvalues()[0] > 1e-6 * whole.eigenvalues()[5] && whole.eigenvalues()[0] > 0) {
    const Matrix6 covariance = information.inverse();
    const auto largest = [&](int at) {
      const Eigen::Matrix3d part = covariance.block<3, 3>(at, at);
      return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(part, Eigen::EigenvaluesOnly).eigenvalues()[2]);
    };
    found.sigma_rad = largest(0);
    found.sigma_m = largest(3);
    found.told = kPointsAlike / (found.sigma_m * found.sigma_m * last.trust);
  } else {
    found.sigma_rad = found.sigma_m = std::numeric_limits<double>::infinity();
  }
  return found;
}

}  // namespace spectra::mapping
