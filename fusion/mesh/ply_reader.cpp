#include "fusion/mesh/ply_reader.hpp"

#include <algorithm>
#include <utility>

#include "fusion/mesh/ply_stream.hpp"
#include "fusion/mesh/scene_origin.hpp"

namespace spectra::fusion {

Result<LoadedScene> read_ply(const std::filesystem::path& path) {
  BOOST_OUTCOME_TRY(PlyStream stream, PlyStream::open(path));
  LoadedScene scene;
  MultispectralMesh& mesh = scene.mesh;
  mesh.resize_vertices(static_cast<std::size_t>(stream.vertex_count()));
  mesh.triangles().reserve(static_cast<std::size_t>(stream.triangle_count_limit()));
  mesh.has_visible = stream.has_visible();
  mesh.has_temperature = stream.has_temperature();
  mesh.double_positions = stream.has_double_positions();
  mesh.name = path.filename().string();

  // Doubles wait for the origin, which is known when all are read; floats can move there without loss.
  std::vector<Vec3d> exact_positions(mesh.double_positions ? mesh.vertex_count() : 0);
  PlyHandlers handlers;
  handlers.vertices = [&](const PlyVertexBlock& block) -> Result<void> {
    const auto first = static_cast<std::ptrdiff_t>(block.first_vertex);
    if (mesh.double_positions) {
      std::copy(block.positions.begin(), block.positions.end(), exact_positions.begin() + first);
    } else {
      std::transform(block.positions.begin(), block.positions.end(), mesh.positions().begin() + first,
                     [](const Vec3d& position) { return relative_to({}, position); });
    }
    std::copy(block.visible.begin(), block.visible.end(), mesh.visible().begin() + first);
    std::copy(block.temperature_celsius.begin(), block.temperature_celsius.end(),
              mesh.temperature_celsius().begin() + first);
    return success();
  };
  handlers.triangles = [&](std::span<const Triangle> triangles) -> Result<void> {
    mesh.triangles().insert(mesh.triangles().end(), triangles.begin(), triangles.end());
    return success();
  };
  BOOST_OUTCOME_TRY(const PlyBodyFacts facts, stream.read(handlers));

  mesh.origin = scene_origin(facts.min, facts.max);
  if (mesh.double_positions) {
    std::transform(exact_positions.begin(), exact_positions.end(), mesh.positions().begin(),
                   [&](const Vec3d& position) { return relative_to(mesh.origin, position); });
  } else if (mesh.origin != Vec3d{}) {
    for (Vec3f& p : mesh.positions()) {
      p = relative_to(mesh.origin, {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)});
    }
  }
  scene.notes = stream.notes(facts);
  return scene;
}

}  // namespace spectra::fusion
