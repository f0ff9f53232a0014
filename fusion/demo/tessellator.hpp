#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "fusion/base/vertex_types.hpp"
#include "fusion/demo/vector.hpp"

namespace spectra::demo {

/// What a part of the scene is at one point of its surface.
struct SurfacePoint {
  Vec position;
  Colour colour;        ///< Before light and dust.
  double celsius = 18;  ///< True surface temperature.
  double dust = 0.5;    ///< 0 clean .. 1 where up-facing parts are covered.
  double glow = 0;      ///< Share of the colour that shines by itself, 0..1.
  bool is_skin = false;
};

/// The surfaces of the scene before light and camera: flat arrays over all vertices.
struct SurfaceMesh {
  std::vector<base::Vec3f> positions;
  std::vector<base::Rgb8> colours;
  std::vector<float> celsius;
  std::vector<std::uint8_t> dust, glow;  ///< Of 255.
  std::vector<std::uint8_t> is_skin;     ///< 1 where the person is bare.
  std::vector<base::Triangle> triangles;
};

/// Cuts parametric surfaces into triangles at a given distance between vertices; or, without a mesh, only counts what
/// it would make, so that the distance for a wanted number of vertices can be found by bisection.
class Tessellator {
 public:
  /// From (u, v) in 0..1 to the surface.
  using SheetFunction = std::function<SurfacePoint(double u, double v)>;
  /// From a point of a bevelled box and its normal, both in the box's own axes, to the surface.
  using BoxFunction = std::function<SurfacePoint(Vec local, Vec normal)>;

  Tessellator(double spacing_m, SurfaceMesh* mesh) : spacing_(spacing_m), mesh_(mesh) {}

  double spacing(double relative) const { return spacing_ * relative; }
  std::uint64_t vertex_count() const { return vertex_count_; }

  /// A grid of about `width` x `height` metres; its front is where u x v points. `relative` < 1: finer than the scene.
  void sheet(double width, double height, double relative, const SheetFunction& surface);

  /// A sheet whose u = 1 is joined to u = 0. A closed end is drawn together into one vertex (the surface at u = 0 there).
  /// Its front is where u x v points.
  void tube(double around, double along, double relative, bool close_start, bool close_end,
            const SheetFunction& surface);

  /// The surface of a box of half sizes `half` with rounded edges of radius `bevel`, closed or without its bottom (-y).
  void box(Vec half, double bevel, double relative, bool has_bottom, const BoxFunction& surface);

 private:
  std::uint64_t cells(double length, double relative, std::uint64_t least) const;
  std::uint32_t add(const SurfacePoint& point);
  void quad(std::uint64_t a, std::uint64_t b, std::uint64_t c, std::uint64_t d, bool other_diagonal);

  double spacing_;
  SurfaceMesh* mesh_;
  std::uint64_t vertex_count_ = 0;
};

}  // namespace spectra::demo
