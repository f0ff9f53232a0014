#include "fusion/files/ply_writer.hpp"

#include <algorithm>
#include <ostream>
#include <vector>

#include "fusion/files/output_file.hpp"
#include "fusion/files/ply_encoder.hpp"
#include "fusion/files/told_coordinates.hpp"

namespace spectra::files {

namespace {

/// The triangles in the input's numbers, in which the vertices that were left out count.
std::vector<base::Triangle> input_triangles(const mesh::MultispectralMesh& mesh) {
  std::vector<std::uint32_t> input_index;
  input_index.reserve(mesh.vertex_count());
  auto hole = mesh.left_out.begin();
  for (std::uint32_t v = 0; input_index.size() < mesh.vertex_count(); ++v) {
    if (hole != mesh.left_out.end() && hole->input_index == v) {
      ++hole;
    } else {
      input_index.push_back(v);
    }
  }
  std::vector<base::Triangle> triangles = mesh.triangles();
  for (base::Triangle& triangle : triangles) {
    for (std::uint32_t& corner : triangle) corner = input_index[corner];
  }
  return triangles;
}

base::Result<void> encode(const mesh::MultispectralMesh& mesh, std::span<const base::Rgb8> colours,
                          const std::string& comment, PlyEncoder::Sink sink) {
  PlyLayout layout;
  layout.vertex_count = mesh.vertex_count() + mesh.left_out.size();
  layout.triangle_count = mesh.triangle_count();
  layout.origin = mesh.origin;
  layout.double_positions = mesh.double_positions;
  layout.has_temperature = mesh.has_temperature;
  layout.has_confidence = mesh.has_temperature && !mesh.confidence.empty();
  layout.comment = comment.empty() ? comment_of(mesh.told) : comment;
  PlyEncoder encoder(layout, std::move(sink));
  if (colours.size() != mesh.vertex_count()) {
    return base::failure(base::ErrorCode::Inconsistent, "a mesh of " + std::to_string(mesh.vertex_count()) +
                                                            " vertices cannot be written with " +
                                                            std::to_string(colours.size()) + " colours");
  }
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= mesh.left_out.size(); ++i) {
    const std::size_t end = i < mesh.left_out.size() ? mesh.left_out[i].input_index - i : mesh.vertex_count();
    const std::size_t count = end - begin;
    PlyConfidence confidence;
    if (layout.has_confidence) {
      confidence = {std::span(mesh.confidence.sigma_kelvin).subspan(begin, count),
                    std::span(mesh.confidence.looked_at).subspan(begin, count)};
    }
    BOOST_OUTCOME_TRY(encoder.vertices(mesh.positions().subspan(begin, count), colours.subspan(begin, count),
                                       mesh.temperature_celsius().subspan(begin, count), confidence));
    begin = end;
    if (i == mesh.left_out.size()) break;
    const mesh::LeftOutVertex& hole = mesh.left_out[i];
    BOOST_OUTCOME_TRY(encoder.left_out_vertex(hole.position, hole.visible, hole.temperature_celsius));
  }
  BOOST_OUTCOME_TRY(encoder.triangles(mesh.left_out.empty() ? mesh.triangles() : input_triangles(mesh)));
  return encoder.finish();
}

}  // namespace

base::Result<void> write_ply(std::ostream& out, const mesh::MultispectralMesh& mesh,
                             std::span<const base::Rgb8> colours) {
  BOOST_OUTCOME_TRY(encode(mesh, colours, {}, [&out](std::span<const std::byte> bytes) -> base::Result<void> {
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (!out) return base::failure(base::ErrorCode::FileUnwritable, "the PLY stream cannot be written");
    return base::success();
  }));
  if (!out.flush()) return base::failure(base::ErrorCode::FileUnwritable, "the PLY stream cannot be written");
  return base::success();
}

base::Result<void> write_ply(const std::filesystem::path& path, const mesh::MultispectralMesh& mesh,
                             std::span<const base::Rgb8> colours, const std::string& comment,
                             const base::Progress& progress) {
  base::report(progress, base::kWritingPhase, 0);
  BOOST_OUTCOME_TRY(OutputFile file, OutputFile::create(path));
  const std::size_t vertex_bytes = (mesh.double_positions ? 24U : 12U) + 3U + (mesh.has_temperature ? 4U : 0U) +
                                   (mesh.confidence.empty() ? 0U : 12U);
  const std::size_t whole_bytes =
      (mesh.vertex_count() + mesh.left_out.size()) * vertex_bytes + mesh.triangle_count() * 13 + 1;
  std::size_t written_bytes = 0;
  BOOST_OUTCOME_TRY(encode(mesh, colours, comment, [&](std::span<const std::byte> bytes) {
    written_bytes += bytes.size();
    // The header comes on top, so a small file would be told to be more than whole.
    base::report(progress, base::kWritingPhase,
                 std::min(1.0, static_cast<double>(written_bytes) / static_cast<double>(whole_bytes)));
    return file.write(bytes);
  }));
  return file.commit();
}

}  // namespace spectra::files
