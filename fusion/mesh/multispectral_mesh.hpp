#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fusion/base/up_axis.hpp"
#include "fusion/base/vertex_types.hpp"

namespace spectra::mesh {

/// A vertex of the input without a position (not finite, or a hole): no part of the scene, but kept for an output that has the input's
/// vertices in their order.
struct LeftOutVertex {
  std::uint32_t input_index = 0;
  base::Vec3d position;  ///< As it was.
  base::Rgb8 visible;
  float temperature_celsius = 0;
};

/// How sure the temperatures of a mesh are, and when the thermal camera last looked; one a vertex, or none where nobody says so.
struct TemperatureConfidence {
  std::vector<float> sigma_kelvin;  ///< Standard deviation; NaN = not known.
  std::vector<double> looked_at;    ///< Seconds of the source's clock; NaN = not known. As long as sigma_kelvin.

  bool empty() const { return sigma_kelvin.empty(); }
};

/// What somebody has said of a scene's coordinates: its file, or who had it read.
struct ToldCoordinates {
  std::optional<base::UpAxis> up;
  std::string unit;  ///< "metres", "millimetres" ...; empty: nobody has named one.
};

/// A scene in memory: per vertex a position, a visible colour and a temperature, and triangles (none: a point cloud).
/// The vertex data live in the property arrays of an OpenMesh mesh, in the order of the input, and are seen here as
/// flat spans; half-edge connectivity is built only when topology() is asked for, because serving does not need it.
/// Movable, not copyable. Not thread-safe while it is changed.
class MultispectralMesh {
 public:
  /// The visible colour where there is none.
  static constexpr base::Rgb8 kNoColour{128, 128, 128};

  MultispectralMesh();
  ~MultispectralMesh();
  MultispectralMesh(MultispectralMesh&&) noexcept;
  MultispectralMesh& operator=(MultispectralMesh&&) noexcept;

  std::size_t vertex_count() const;
  std::size_t triangle_count() const { return triangles_.size(); }
  bool is_point_cloud() const { return triangles_.empty(); }

  /// Sets the number of vertices; new ones are at the origin, mid grey, without temperature.
  void resize_vertices(std::size_t count);

  /// Positions in metres relative to origin().
  std::span<const base::Vec3f> positions() const;
  std::span<base::Vec3f> positions();
  std::span<const base::Rgb8> visible() const;
  std::span<base::Rgb8> visible();
  /// degC; NaN = missing.
  std::span<const float> temperature_celsius() const;
  std::span<float> temperature_celsius();

  const std::vector<base::Triangle>& triangles() const { return triangles_; }
  std::vector<base::Triangle>& triangles() { return triangles_; }

  TemperatureConfidence confidence;

  /// What positions are relative to, in the coordinates of the input (metres, double: a map in UTM keeps its millimetres).
  base::Vec3d origin;
  std::vector<LeftOutVertex> left_out;  ///< Rising; vertex i of the mesh is the i-th of the others.
  base::UpAxis up = base::UpAxis::Z;
  ToldCoordinates told;           ///< A PLY file that is written says it again.
  bool is_metric = false;         ///< Somebody has said that positions are in metres; otherwise they are taken for it.
  bool has_visible = false;       ///< The input had colours; otherwise visible() is mid grey.
  bool has_temperature = false;   ///< The input had a temperature property, or a thermal file was joined.
  bool double_positions = false;  ///< The input had double positions; output keeps them.
  std::string name;               ///< For people: the file's name without folder, or "demo".

 private:
  struct Storage;
  std::unique_ptr<Storage> storage_;
  std::vector<base::Triangle> triangles_;
};

}  // namespace spectra::mesh
