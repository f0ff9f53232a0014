#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fusion/base/vertex_types.hpp"

namespace spectra::mesh {

/// Cuts plane polygons into triangles that cover their inside and nothing else. Holds scratch memory, so that one cutter for
/// many polygons allocates little. Safe on any input.
class PolygonCutter {
 public:
  /// Polygons with more corners are cut only when a fan is right for them: the time grows with the square.
  static constexpr std::size_t kMostCorners = 1000;

  enum class Result {
    Fan,  ///< Triangles (0, i, i + 1) are right: the first corner sees all of it, as in every convex polygon; or it has no area.
    Ears,   ///< It is concave: triangles() cut it.
    Failed  ///< It crosses itself, or has too many corners: no triangles are right.
  };

  /// `corners`: three or more, in order, closed by the last; finite. Corners may stand on the line between others, or be there
  /// twice, as where a slit leads to a hole. What is not quite plane is judged as seen along its mean normal.
  Result cut(std::span<const base::Vec3f> corners);

  /// After Ears: two fewer than corners, each of three numbers of corners, turned as the polygon is. Ear clipping (Meisters,
  /// "Polygons have ears", 1975).
  std::span<const base::Triangle> triangles() const { return triangles_; }

 private:
  struct Point {
    double x = 0, y = 0;
  };

  bool flatten(std::span<const base::Vec3f> corners);
  bool is_fan_right() const;
  bool crosses_itself() const;
  bool clip_ears();
  bool is_ear(std::uint32_t corner) const;
  void find_ears();
  void cut_off(std::uint32_t corner);
  int side(std::uint32_t a, std::uint32_t b, std::uint32_t c) const;
  double turn(std::uint32_t a, std::uint32_t b, std::uint32_t c) const;

  std::vector<Point> points_;  ///< As seen along the normal, counter-clockwise.
  double rounding_ = 0;        ///< How far a corner may be from where it was meant.
  double tiny_area_ = 0;       ///< What rounding may make of none, doubled.
  std::vector<std::uint32_t> previous_, next_;
  std::vector<std::uint32_t> hollows_;  ///< Corners that are not convex.
  std::vector<bool> ears_;
  std::vector<base::Triangle> triangles_;
};

}  // namespace spectra::mesh
