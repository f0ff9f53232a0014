#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <sstream>
#include <string>
#include <string_view>

#include "fusion/files/ply_reader.hpp"
#include "fusion/files/ply_writer.hpp"
#include "fusion/mesh/topology.hpp"

namespace {

using namespace spectra;

void check(bool holds) {
  if (!holds) std::abort();
}

/// A file in memory that is filled again and again.
class MemoryFile {
 public:
  MemoryFile() : descriptor_(::memfd_create("fuzz.ply", MFD_CLOEXEC)) { check(descriptor_ >= 0); }
  void fill(std::string_view bytes) const {
    check(::ftruncate(descriptor_, 0) == 0);
    check(::pwrite(descriptor_, bytes.data(), bytes.size(), 0) == static_cast<ssize_t>(bytes.size()));
  }
  std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

std::string written(const mesh::MultispectralMesh& mesh) {
  std::ostringstream out;
  check(files::write_ply(out, mesh, mesh.visible()).has_value());
  return out.str();
}

void check_scene(const files::LoadedScene& scene) {
  const mesh::MultispectralMesh& mesh = scene.mesh;
  check(mesh.vertex_count() > 0);
  check(mesh.visible().size() == mesh.vertex_count());
  check(mesh.temperature_celsius().size() == mesh.vertex_count());
  for (const base::Vec3f& p : mesh.positions()) check(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
  for (const float celsius : mesh.temperature_celsius())
    check(std::isnan(celsius) || celsius > -273.15F || celsius < -3e38F);
  for (const auto& [a, b, c] : mesh.triangles()) {
    check(std::max({a, b, c}) < mesh.vertex_count() && a != b && b != c && c != a);
  }
  for (const files::Note& note : scene.notes) check(!note.id.empty() && note.count > 0 && !note.message.empty());
}

}  // namespace

/// Any bytes as a scene: what is accepted is sound, and comes back the same when it is written and read again.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const MemoryFile file;
  file.fill({reinterpret_cast<const char*>(data), size});
  const auto scene = files::read_ply(file.path());
  if (!scene) {
    check(!scene.error().message.empty() && !scene.error().field.empty());
    return 0;
  }
  check_scene(scene.value());
  const mesh::MultispectralMesh& mesh = scene.value().mesh;
  const mesh::TopologyFacts facts = mesh::topology_facts(mesh);
  check(facts.boundary_edge_count <= 3 * mesh.triangle_count() && facts.component_count <= mesh.triangle_count());

  const std::string bytes = written(mesh);
  file.fill(bytes);
  const auto again = files::read_ply(file.path());
  check(again.has_value());
  check_scene(again.value());
  const mesh::MultispectralMesh& second = again.value().mesh;
  // Doubles are rounded to the precision of the scene's extent: the origin may move, and vertices that stood apart may come to one
  // place, so that other ones are taken for holes.
  if (mesh.double_positions) return 0;
  check(second.triangles() == mesh.triangles());
  check(second.vertex_count() == mesh.vertex_count());
  check(written(second) == bytes);
  return 0;
}
