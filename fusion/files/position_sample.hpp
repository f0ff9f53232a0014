#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "fusion/base/vertex_types.hpp"
#include "fusion/files/coordinate_hole.hpp"

namespace spectra::files {

/// Where nearly all of a scene is: not its strays, nor the place that stands for "no position".
struct Bulk {
  base::Vec3d min, max;

  double extent() const;
};

/// A place that may stand for "no position", as files without nan write the holes of an organised cloud.
struct HolePlace {
  base::Vec3d place;
  std::vector<std::uint64_t> vertices;  ///< Some of those that are there.
  bool is_used = false;                 ///< By triangles.
  /// It is farther from the bulk than that is large, and more tells that nothing is there (stands_for_none()); or is 0 0 0,
  /// and no triangle uses it. Elsewhere in the scene it is what was measured again and again.
  bool is_certain = false;
  /// It is worth a word where it is not certain: the only one, of no triangle, or with numbers that are written for none.
  bool is_suspect = false;
};

/// Up to 16,384 positions, evenly spread over a file in a fixed but irregular order (a regular one may meet one column of a
/// grid alone). Tells what a few strays cannot disturb.
class PositionSample {
 public:
  explicit PositionSample(std::uint64_t vertex_count);

  /// The vertices that come next in the file; positions that are not finite are passed over.
  void add(std::uint64_t first_vertex, std::span<const base::Vec3d> positions);

  /// Looks for holes and bulk, in time and memory of the sample. `metres` in one unit of the file.
  void conclude(double metres, const IsUsed& is_used);
  /// Up to four places that have each a dozen vertices of the sample and eight times as many as any place that is none of them, when
  /// the others are a dozen too.
  const std::vector<HolePlace>& holes() const { return holes_; }
  /// Coordinates that stand for "not measured" (find_coordinate_holes), up to four.
  const std::vector<Hole>& coordinate_holes() const { return coordinate_holes_; }
  /// Those that may be such a number, but are not certain.
  const std::vector<SharedCoordinate>& shared_coordinates() const { return shared_coordinates_; }
  /// Around the medians of the coordinates, 32 times as far as half of the vertices are; nullopt when that is one place.
  const std::optional<Bulk>& bulk() const { return bulk_; }

 private:
  void choose_next();
  void find_holes();
  void find_bulk();

  std::uint64_t bucket_size_;
  std::uint64_t bucket_ = 0;
  std::uint64_t next_vertex_ = 0;
  std::vector<SampledVertex> entries_;
  std::vector<HolePlace> holes_;
  std::vector<Hole> coordinate_holes_;
  std::vector<SharedCoordinate> shared_coordinates_;
  std::optional<Bulk> bulk_;
};

}  // namespace spectra::files
