#include "server/app/fused_file.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <sstream>
#include <utility>

#include "fusion/mesh/output_file.hpp"
#include "fusion/mesh/ply_writer.hpp"
#include "protocol/draco_codec.hpp"
#include "server/app/glb_file.hpp"

namespace spectra::server {
namespace {

/// As the streams' default: near the smallest size at a fraction of its time.
constexpr int kDracoFileSpeed = 7;

fusion::Result<std::string> draco_file(const fusion::MultispectralMesh& mesh, std::span<const fusion::Rgb8> colours) {
  static_assert(sizeof(fusion::Vec3f) == sizeof(std::array<float, 3>));
  static_assert(sizeof(fusion::Rgb8) == sizeof(protocol::ColourBytes));
  std::vector<std::array<float, 3>> positions;
  positions.reserve(mesh.vertex_count());
  for (const auto& p : mesh.positions()) positions.push_back({p.x, p.y, p.z});
  std::vector<protocol::ColourBytes> colour_bytes;
  colour_bytes.reserve(colours.size());
  for (const auto& c : colours) colour_bytes.push_back({c.r, c.g, c.b});
  protocol::DracoFileInput input;
  input.positions_m = positions;
  input.colours = colour_bytes;
  if (mesh.has_temperature) input.temperature_celsius = mesh.temperature_celsius();
  input.triangles = mesh.triangles();
  auto bytes = protocol::draco_file(input, kDracoFileSpeed);
  if (!bytes) return fusion::failure(fusion::ErrorCode::Unsupported, bytes.error().message);
  std::string text;
  text.reserve(bytes.value().size());
  for (const std::byte b : bytes.value()) text.push_back(static_cast<char>(b));
  return text;
}

}  // namespace

std::optional<SceneFileFormat> scene_file_format(std::string_view name) {
  if (name.size() < 4) return std::nullopt;
  std::string ending(name.substr(name.size() - 4));
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (ending == ".ply") return SceneFileFormat::Ply;
  if (ending == ".glb") return SceneFileFormat::Glb;
  if (ending == ".drc") return SceneFileFormat::Draco;
  return std::nullopt;
}

std::string_view content_type_of(SceneFileFormat format) {
  return format == SceneFileFormat::Glb ? "model/gltf-binary" : "application/octet-stream";
}

fusion::SceneTemperature temperature_of(const fusion::MultispectralMesh& mesh) {
  fusion::TemperatureAccumulator accumulator;
  accumulator.add(mesh.temperature_celsius());
  fusion::SceneTemperature scene;
  scene.summary = accumulator.summary();
  scene.histogram = [&mesh, summary = scene.summary](std::uint32_t bins) {
    fusion::Histogram histogram{summary.minimum, summary.maximum, std::vector<std::uint64_t>(bins)};
    fusion::add_to_histogram(mesh.temperature_celsius(), histogram);
    return histogram;
  };
  return scene;
}

std::vector<fusion::Rgb8> fused_colours(const fusion::MultispectralMesh& mesh, const fusion::FusionPlan& plan) {
  std::vector<fusion::Rgb8> fused(mesh.vertex_count());
  plan.fuse(mesh.temperature_celsius(), mesh.visible(), fused);
  return fused;
}

fusion::Result<std::string> scene_file(const fusion::MultispectralMesh& mesh, std::span<const fusion::Rgb8> colours,
                                       SceneFileFormat format) {
  if (format == SceneFileFormat::Glb) return glb_file(mesh, colours);
  if (format == SceneFileFormat::Draco) return draco_file(mesh, colours);
  std::ostringstream out;
  BOOST_OUTCOME_TRYV(fusion::write_ply(out, mesh, colours));
  return std::move(out).str();
}

fusion::Result<void> write_scene_file(const std::filesystem::path& path, const fusion::MultispectralMesh& mesh,
                                      std::span<const fusion::Rgb8> colours, SceneFileFormat format) {
  if (format == SceneFileFormat::Ply) return fusion::write_ply(path, mesh, colours);
  BOOST_OUTCOME_TRY(auto file, fusion::OutputFile::create(path));
  BOOST_OUTCOME_TRY(const auto bytes, scene_file(mesh, colours, format));
  BOOST_OUTCOME_TRYV(file.write(std::as_bytes(std::span(bytes))));
  return file.commit();
}

}  // namespace spectra::server
