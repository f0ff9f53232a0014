#include "server/mapping/map_ply.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "fusion/files/output_file.hpp"
#include "fusion/files/ply_encoder.hpp"

namespace spectra::mapping {
namespace {

files::PlyLayout layout_of(const UnitMesh& mesh) {
  files::PlyLayout layout;
  layout.comment = "positions in metres";
  layout.vertex_count = mesh.positions.size();
  layout.triangle_count = mesh.triangles.size();
  layout.has_temperature =
      std::any_of(mesh.celsius.begin(), mesh.celsius.end(), [](float t) { return !std::isnan(t); });
  layout.has_confidence = layout.has_temperature;
  return layout;
}

/// Hands on the vertices in parts, with their times on another clock.
template <class Report>
base::Result<void> encode_vertices(const UnitMesh& mesh, double begin_s, files::PlyEncoder& encoder,
                                   const Report& report) {
  constexpr std::size_t kStep = 65'536;
  const std::size_t vertices = mesh.positions.size();
  std::vector<double> seen;
  for (std::size_t first = 0; first < vertices; first += kStep) {
    const std::size_t count = std::min(kStep, vertices - first);
    // Of too few values it is too short, which the encoder refuses.
    const auto part = [&](const auto& values) {
      const std::size_t begin = std::min(first, values.size());
      return std::span(values).subspan(begin, std::min(count, values.size() - begin));
    };
    seen.clear();
    for (const float s : part(mesh.seen_s)) seen.push_back(begin_s + static_cast<double>(s));
    BOOST_OUTCOME_TRYV(encoder.vertices(part(mesh.positions), part(mesh.colours), part(mesh.celsius),
                                        {part(mesh.sigma_kelvin), seen}));
    report(static_cast<double>(first) / static_cast<double>(vertices));
  }
  return base::success();
}

}  // namespace

base::Result<void> write_map_ply(const std::filesystem::path& file, const UnitMesh& mesh, double begin_s,
                                 const base::Progress& progress) {
  const files::PlyLayout layout = layout_of(mesh);
  BOOST_OUTCOME_TRY(auto out, files::OutputFile::create(file));
  files::PlyEncoder encoder(layout, [&out](std::span<const std::byte> bytes) { return out.write(bytes); });
  BOOST_OUTCOME_TRYV(encode_vertices(mesh, begin_s, encoder,
                                     [&](double share) { base::report(progress, base::kWritingPhase, 0.6 * share); }));
  BOOST_OUTCOME_TRYV(encoder.triangles(mesh.triangles));
  BOOST_OUTCOME_TRYV(encoder.finish());
  return out.commit();
}

base::Result<std::string> block_ply(const UnitMesh& mesh, double begin_unix_s) {
  std::string text;
  // A little more than it takes, so that it need not grow.
  constexpr std::size_t kHead = 1024, kBytesAVertex = 40, kBytesATriangle = 16;
  text.reserve(kHead + kBytesAVertex * mesh.positions.size() + kBytesATriangle * mesh.triangles.size());
  files::PlyEncoder encoder(layout_of(mesh), [&text](std::span<const std::byte> bytes) -> base::Result<void> {
    text.append(std::bit_cast<const char*>(bytes.data()), bytes.size());
    return base::success();
  });
  BOOST_OUTCOME_TRYV(encode_vertices(mesh, begin_unix_s, encoder, [](double) {}));
  BOOST_OUTCOME_TRYV(encoder.triangles(mesh.triangles));
  BOOST_OUTCOME_TRYV(encoder.finish());
  return text;
}

std::vector<base::Result<std::string>> block_plys(std::span<const PublishedUnit> units, double begin_unix_s,
                                                  jobs::WorkerPool& pool) {
  std::vector<base::Result<std::string>> blocks(units.size(), std::string());
  pool.for_each(units.size(), [&](std::size_t i) {
    if (!units[i].mesh.triangles.empty()) blocks[i] = block_ply(units[i].mesh, begin_unix_s);
  });
  return blocks;
}

double unix_begin_s(double begin_s, double newest_s, double now_unix_s) {
  constexpr double kEarliest = 1e8;  // A clock that shows less does not count from 1970.
  return begin_s > kEarliest ? begin_s : now_unix_s - (newest_s - begin_s);
}

}  // namespace spectra::mapping
