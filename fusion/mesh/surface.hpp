#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fusion/base/box.hpp"
#include "fusion/base/vertex_types.hpp"

namespace spectra::mesh {

double squared_distance(const base::Vec3f& a, const base::Vec3f& b);

/// Zero inside.
double squared_distance_to_box(const base::Vec3f& p, const base::Bounds& box);

/// To the triangle with its inside, degenerate or not. Exact to double rounding for any finite floats.
double squared_distance_to_triangle(const base::Vec3f& p, const base::Vec3f& a, const base::Vec3f& b,
                                    const base::Vec3f& c);

double triangle_area(const base::Vec3f& a, const base::Vec3f& b, const base::Vec3f& c);

/// What each corner counts for at the point of a triangle that is nearest to `p`; they are not negative and their sum is 1.
std::array<double, 3> nearest_weights(const base::Vec3f& p, const base::Vec3f& a, const base::Vec3f& b,
                                      const base::Vec3f& c);

/// A triangle of a surface, and how far it is.
struct NearTriangle {
  std::uint32_t triangle = 0xffffffffu;
  double squared_distance = 0;
};

/// Triangles over shared vertices, with the triangles around each vertex. Keeps references to what it is made of.
class Surface {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  Surface(std::span<const base::Vec3f> positions, std::span<const base::Triangle> triangles);

  std::span<const base::Vec3f> positions() const { return positions_; }
  std::span<const base::Triangle> triangles() const { return triangles_; }
  std::span<const std::uint32_t> triangles_around(std::uint32_t vertex) const {
    return std::span(around_).subspan(offsets_[vertex], offsets_[vertex + 1] - offsets_[vertex]);
  }

  /// An upper bound of the squared distance of `p`: walks from `start` along edges towards `p` and looks at the triangles
  /// around the vertices there, until that does not help any more or the bound is not above `enough`.
  double squared_distance_near(const base::Vec3f& p, std::uint32_t start, double enough) const;

  /// The triangle found on that walk; `start` has one.
  NearTriangle triangle_near(const base::Vec3f& p, std::uint32_t start, double enough) const;

  /// The squared distance of `p` itself, or some bound that is not above `enough`. `at_most` is a bound that is known.
  double squared_distance_anywhere(const base::Vec3f& p, double enough, double at_most) const;

  /// For every vertex the seed that is fewest edges away (of several the nearest in space); kNone where no edges lead to one.
  std::vector<std::uint32_t> nearest_seeds(const std::vector<bool>& is_seed) const;

  /// Marks the vertices of edges that do not have as many triangles on one side as on the other.
  std::vector<bool> open_vertices() const;

 private:
  static constexpr std::size_t kBlockSize = 32;
  static constexpr std::size_t kMostTriangles =
      64;  ///< Looked at around a vertex: a hub of thousands would cost squares.

  /// From vertex to vertex as long as they come nearer, and none is near enough (squared).
  std::uint32_t nearest_vertex_near(const base::Vec3f& p, std::uint32_t start, double enough) const;

  std::span<const base::Vec3f> positions_;
  std::span<const base::Triangle> triangles_;
  std::vector<std::uint32_t> offsets_;
  std::vector<std::uint32_t> around_;
  std::vector<base::Bounds>
      block_bounds_;  ///< Of kBlockSize triangles each: neighbours in the list are near each other.
};

/// The largest distance (metres) of points of one surface from the other, both ways, measured at the vertices and at
/// points of the triangles as dense as the fine vertices. `coarse_of_fine` names a coarse vertex near each fine one, `fine_of_coarse` the fine vertex that
/// each coarse one is.
double two_sided_distance(const Surface& fine, const Surface& coarse, std::span<const std::uint32_t> coarse_of_fine,
                          std::span<const std::uint32_t> fine_of_coarse);

}  // namespace spectra::mesh
