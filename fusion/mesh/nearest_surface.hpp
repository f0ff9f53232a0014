#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "fusion/base/bounds.hpp"
#include "fusion/base/vertex_types.hpp"

namespace spectra::mesh {

/// The point of the triangle a, b, c nearest to p, as barycentric weights; total for degenerate triangles.
std::array<double, 3> nearest_on_triangle(const base::Vec3f& p, const base::Vec3f& a, const base::Vec3f& b,
                                          const base::Vec3f& c);

/// The median length of the edges of the triangles, over a sample; 0 without any.
double median_edge(std::span<const base::Vec3f> positions, std::span<const base::Triangle> triangles);

/// Finds the nearest point of a surface: of its triangles with their inside, and of vertices of no triangle. A tree of boxes,
/// about 45 bytes a triangle; keeps references to what it is made of. Immutable, any number of threads may ask.
class NearestSurface {
 public:
  struct Hit {
    base::Triangle corners{};         ///< Vertex indices; three times the same for a vertex of no triangle.
    std::array<double, 3> weights{};  ///< Of the corners, sum 1.
    double distance = 0;
  };

  /// Finite positions, indices in range.
  NearestSurface(std::span<const base::Vec3f> positions, std::span<const base::Triangle> triangles);

  /// The nearest point not further than `max_distance` from `position`.
  std::optional<Hit> find(const base::Vec3f& position, double max_distance) const;

  /// Calls `found(index, hit)` for each of the positions that find() finds something for, from any thread, in any order, and `done(count)` for
  /// every few thousand that have been looked at; both must bear being called at once. As fast where triangles are so long that their boxes
  /// tell nothing: positions are then looked for in groups, which costs about triangles times positions to the power of two thirds. Of several
  /// nearest points any may be told, but the same for any number of threads.
  void find_all(std::span<const base::Vec3f> from, double max_distance,
                const std::function<void(std::size_t index, const Hit& hit)>& found,
                const std::function<void(std::size_t count)>& done = {}) const;

  /// How far apart neighbours are: the median length of edges, or, without triangles, of the distance from a vertex to the
  /// nearest one at another place; over a sample. 0 when all are at one place.
  double median_spacing() const;

 private:
  /// A box and what is in it: elements, or two nodes, of which the first stands behind this one.
  struct Node {
    base::Bounds box;
    std::uint32_t first = 0;  ///< Element, or second node.
    std::uint32_t count = 0;  ///< Of elements; 0: two nodes.
  };
  struct Search {
    std::array<double, 3> position{};
    double best_squared = 0;
    bool elsewhere_only = false;    ///< What is at the very position does not count.
    std::uint32_t most_leaves = 0;  ///< That may be looked at; 0: any number.
    bool has_hit = false;
    std::uint32_t element = 0;
    std::array<double, 3> weights{};
  };
  class Groups;

  base::Triangle corners(std::uint32_t element) const;
  std::uint32_t build(std::span<const base::Vec3f> centres, std::size_t begin, std::size_t end);
  /// False when it has given up.
  bool search(Search& search) const;
  /// Finds and takes out the indices of what lies at a corner, where nothing can be nearer.
  void find_at_corners(std::span<const base::Vec3f> from, std::vector<std::uint32_t>& indices,
                       const std::function<void(std::size_t index, const Hit& hit)>& found) const;
  Hit hit_of(const Search& search) const;
  void offer(std::uint32_t element, Search& search) const;

  std::span<const base::Vec3f> positions_;
  std::span<const base::Triangle> triangles_;
  std::vector<std::uint32_t>
      elements_;  ///< Triangles by number, then vertices of no triangle by triangle count + number.
  std::vector<Node> nodes_;
};

}  // namespace spectra::mesh
