#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "fusion/base/vertex_types.hpp"
#include "fusion/mesh/nearest_surface.hpp"

namespace spectra::tradeoff {

/// The point of a surface that is nearest to some place.
struct SurfacePoint {
  std::uint32_t triangle = 0;           ///< Index of the triangle (of the point, for a point cloud).
  std::array<double, 3> barycentric{};  ///< Weights of the three corners, sum 1.
  double distance_m = 0;
};

/// Finds nearest points on a triangle mesh or point cloud (no triangles). Keeps its own copy. Immutable after construction.
class SurfaceIndex {
 public:
  SurfaceIndex(std::vector<base::Vec3f> positions, std::vector<base::Triangle> triangles);
  ~SurfaceIndex();

  bool empty() const;
  /// Must not be called on an empty surface.
  SurfacePoint nearest(base::Vec3f place) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

using mesh::nearest_on_triangle;

}  // namespace spectra::tradeoff
