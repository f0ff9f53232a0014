#include "fusion/mesh/ply_writer.hpp"

#include <ostream>

#include "fusion/mesh/output_file.hpp"
#include "fusion/mesh/ply_encoder.hpp"

namespace spectra::fusion {

namespace {

Result<void> encode(const MultispectralMesh& mesh, std::span<const Rgb8> colours, PlyEncoder::Sink sink) {
  PlyLayout layout;
  layout.vertex_count = mesh.vertex_count();
  layout.triangle_count = mesh.triangle_count();
  layout.origin = mesh.origin;
  layout.double_positions = mesh.double_positions;
  layout.has_temperature = mesh.has_temperature;
  PlyEncoder encoder(layout, std::move(sink));
  BOOST_OUTCOME_TRY(encoder.vertices(mesh.positions(), colours, mesh.temperature_celsius()));
  BOOST_OUTCOME_TRY(encoder.triangles(mesh.triangles()));
  return encoder.finish();
}

}  // namespace

Result<void> write_ply(std::ostream& out, const MultispectralMesh& mesh, std::span<const Rgb8> colours) {
  BOOST_OUTCOME_TRY(encode(mesh, colours, [&out](std::span<const std::byte> bytes) -> Result<void> {
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (!out) return failure(ErrorCode::FileUnwritable, "the PLY stream cannot be written");
    return success();
  }));
  if (!out.flush()) return failure(ErrorCode::FileUnwritable, "the PLY stream cannot be written");
  return success();
}

Result<void> write_ply(const std::filesystem::path& path, const MultispectralMesh& mesh,
                       std::span<const Rgb8> colours) {
  BOOST_OUTCOME_TRY(OutputFile file, OutputFile::create(path));
  BOOST_OUTCOME_TRY(encode(mesh, colours, [&file](std::span<const std::byte> bytes) { return file.write(bytes); }));
  return file.commit();
}

}  // namespace spectra::fusion
