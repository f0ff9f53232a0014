#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "fusion/vertex_types.hpp"

namespace spectra::fusion {

/// Finds the nearest of many points (a k-d tree). 32 bytes a point; immutable, any number of threads may ask.
class NearestVertex {
 public:
  struct Hit {
    std::uint32_t index = 0;  ///< Among the points given to the constructor.
    double distance = 0;
  };

  /// Finite points; at most 2^32 - 1.
  explicit NearestVertex(std::span<const Vec3d> points);

  /// The nearest point not further than `max_distance` from `position`.
  std::optional<Hit> find(const Vec3d& position, double max_distance) const;

  /// The distance from a point to the nearest one at another place, as the median over a sample of the points; 0 when
  /// all are at one place.
  double median_spacing() const;

 private:
  struct Node {
    Vec3d position;
    std::uint32_t index = 0;
    std::uint8_t split_axis = 0;
  };
  struct Search;

  void build(std::size_t begin, std::size_t end);
  void search(std::size_t begin, std::size_t end, Search& search) const;

  std::vector<Node> nodes_;  ///< The middle of a range splits it; both halves are built alike.
};

}  // namespace spectra::fusion
