#include "server/exports/fused_file.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <sstream>
#include <utility>

#include "fusion/base/box.hpp"
#include "fusion/files/glb_file.hpp"
#include "fusion/files/output_file.hpp"
#include "fusion/files/ply_writer.hpp"
#include "server/stream/lattice.hpp"

namespace spectra::exports {
namespace {

/// As the streams' default: near the smallest size at a fraction of its time.
constexpr int kDracoFileSpeed = 7;

std::string counted(std::uint64_t count, std::string_view one, std::string_view many) {
  return std::to_string(count) + " " + std::string(count == 1 ? one : many);
}

/// What a Draco file has lost, for people.
std::vector<files::Note> losses_of(const protocol::codec::DracoFile& file, const SceneFileOptions& options) {
  std::vector<files::Note> losses;
  const auto add = [&losses](const char* id, std::uint64_t count, std::string message) {
    if (count > 0) losses.push_back({id, count, std::move(message)});
  };
  add("added_triangles", file.added_triangle_count,
      counted(file.added_triangle_count, "triangle", "triangles") +
          " of one vertex added after the others: programs open no mesh of more vertices than three for each triangle");
  if (options.keeping == protocol::codec::DracoKeeping::Everything) return losses;
  std::string rounded;
  const float coarsest_m = std::max(file.position_step_m, options.largest_position_step_m);
  if (coarsest_m > 0) {
    std::string_view elsewhere;
    if (coarsest_m > file.position_step_m)
      elsewhere = file.position_step_m > 0 ? ", finer where the form is finer" : " or finer";
    rounded = fmt::format("positions are rounded to {:.4g} mm{}", 1000 * static_cast<double>(coarsest_m), elsewhere);
  }
  if (file.temperature_step_celsius > 0) {
    rounded += fmt::format("{}temperatures {}to {:g} degC", rounded.empty() ? "" : ", ",
                           rounded.empty() ? "are rounded " : "", file.temperature_step_celsius);
  }
  add("rounded_values", rounded.empty() ? 0 : 1, "In the file " + rounded + "; --lossless keeps every value as it is");
  add("no_lattice", file.position_step_m > 0 ? 0 : 1,
      "No lattice as fine as the scene needs reaches all of it: positions are written as floats, which makes the file "
      "larger");
  add("over_range_written", file.over_range_count,
      fmt::format("In the file {} over range {} {:g} degC", counted(file.over_range_count, "vertex", "vertices"),
                  file.over_range_count == 1 ? "has" : "have", file.over_range_celsius));
  add("under_range_written", file.under_range_count,
      fmt::format("In the file {} under range {} {:g} degC", counted(file.under_range_count, "vertex", "vertices"),
                  file.under_range_count == 1 ? "has" : "have", file.under_range_celsius));
  if (file.kept == protocol::codec::DracoKeeping::Order) return losses;
  losses.push_back({"vertex_order", 0,
                    "In the file vertices and triangles have an order of their own; --keep-order keeps the scene's"});
  add("left_out_vertices", file.left_out_vertex_count,
      "In the file " + counted(file.left_out_vertex_count, "vertex", "vertices") + " of no triangle " +
          (file.left_out_vertex_count == 1 ? "is" : "are") + " left out" +
          (file.temperature_step_celsius > 0 ? ", though their temperatures count" : "") + "; --keep-order keeps them");
  add("merged_vertices", file.merged_vertex_count,
      counted(file.merged_vertex_count, "vertex", "vertices") +
          " merged with others of the same place and values, which triangles share; --keep-order keeps them");
  add("left_out_triangles", file.left_out_triangle_count,
      counted(file.left_out_triangle_count, "triangle", "triangles") +
          " with the same vertex twice left out; --keep-order keeps them");
  add("split_vertices", file.split_vertex_count,
      counted(file.split_vertex_count, "vertex", "vertices") +
          " added: where surfaces touch in a vertex each has its own; --keep-order keeps the number");
  return losses;
}

base::Result<SceneFile> draco_file(const mesh::MultispectralMesh& mesh, std::span<const base::Rgb8> colours,
                                   const SceneFileOptions& options) {
  static_assert(sizeof(base::Vec3f) == sizeof(std::array<float, 3>));
  static_assert(sizeof(base::Rgb8) == sizeof(protocol::codec::ColourBytes));
  std::vector<std::array<float, 3>> positions;
  positions.reserve(mesh.vertex_count());
  for (const auto& p : mesh.positions()) positions.push_back({p.x, p.y, p.z});
  std::vector<protocol::codec::ColourBytes> colour_bytes;
  colour_bytes.reserve(colours.size());
  for (const auto& c : colours) colour_bytes.push_back({c.r, c.g, c.b});
  protocol::codec::DracoFileInput input;
  input.positions_m = positions;
  input.colours = colour_bytes;
  if (mesh.has_temperature) input.temperature_celsius = mesh.temperature_celsius();
  input.triangles = mesh.triangles();
  input.origin_m = {mesh.origin.x, mesh.origin.y, mesh.origin.z};
  if (options.keeping != protocol::codec::DracoKeeping::Everything) input.position_step_m = options.position_step_m;
  const auto file = protocol::codec::draco_file(input, options.keeping, kDracoFileSpeed);
  if (!file) return base::failure(base::ErrorCode::Unsupported, file.error().message);
  const auto& bytes = file.value().bytes;
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  return SceneFile{std::string(text, bytes.size()), losses_of(file.value(), options)};
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

fusion::SceneTemperature temperature_of(const mesh::MultispectralMesh& mesh) {
  fusion::TemperatureAccumulator accumulator;
  accumulator.add(mesh.temperature_celsius());
  fusion::SceneTemperature scene;
  scene.summary = accumulator.summary();
  scene.histogram = [&mesh, summary = scene.summary](std::uint32_t bins) {
    fusion::Histogram histogram{summary.minimum, summary.maximum, std::vector<std::uint64_t>(bins)};
    fusion::add_to_histogram(mesh.temperature_celsius(), histogram);
    return histogram;
  };
  scene.hues = [&mesh] {
    fusion::Hues hues;
    fusion::add_to_hues(mesh.visible(), hues);
    return hues;
  };
  return scene;
}

std::vector<base::Rgb8> fused_colours(const mesh::MultispectralMesh& mesh, const fusion::FusionPlan& plan,
                                      std::span<const float> baseline_celsius) {
  std::vector<base::Rgb8> fused(mesh.vertex_count());
  plan.fuse({mesh.temperature_celsius(), mesh.visible(), baseline_celsius}, fused);
  return fused;
}

base::Result<SceneFile> scene_file(const mesh::MultispectralMesh& mesh, std::span<const base::Rgb8> colours,
                                   const SceneFileOptions& options) {
  if (options.format == SceneFileFormat::Draco) return draco_file(mesh, colours, options);
  if (options.format == SceneFileFormat::Glb) {
    BOOST_OUTCOME_TRY(auto bytes, files::glb_file(mesh, colours, base::direction_of(mesh.up)));
    return SceneFile{std::move(bytes), {}};
  }
  std::ostringstream out;
  BOOST_OUTCOME_TRYV(files::write_ply(out, mesh, colours));
  return SceneFile{std::move(out).str(), {}};
}

base::Result<std::vector<files::Note>> write_scene_file(const std::filesystem::path& path,
                                                        const mesh::MultispectralMesh& mesh,
                                                        std::span<const base::Rgb8> colours,
                                                        const SceneFileOptions& options,
                                                        const base::Progress& progress) {
  if (options.format == SceneFileFormat::Ply) {
    BOOST_OUTCOME_TRYV(files::write_ply(path, mesh, colours, {}, progress));
    return std::vector<files::Note>{};
  }
  base::report(progress, base::kWritingPhase, 0);
  BOOST_OUTCOME_TRY(auto output, files::OutputFile::create(path));
  BOOST_OUTCOME_TRY(auto file, scene_file(mesh, colours, options));
  base::report(progress, base::kWritingPhase, 0.9);
  BOOST_OUTCOME_TRYV(output.write(std::as_bytes(std::span(file.bytes))));
  BOOST_OUTCOME_TRYV(output.commit());
  base::report(progress, base::kWritingPhase, 1);
  return std::move(file.losses);
}

base::Result<void> round_for_file(const map::SceneSnapshot& scene, mesh::MultispectralMesh& mesh,
                                  SceneFileOptions& options) {
  const float usual_step_m = stream::position_step_in_force(0, scene.suggested_position_step_m());
  float finest_m = usual_step_m;
  const std::span<base::Vec3f> positions = mesh.positions();
  for (const auto& tile : scene.tiles()) {
    if (tile->child_mask != 0) continue;
    const auto lattice = stream::tile_lattice(*tile, usual_step_m);
    if (!lattice) return base::failure(base::ErrorCode::Unsupported, lattice.error().message);
    const auto& [origin_m, step_m, coarsest_step_m, points] = lattice.value();
    // It reaches too far for any lattice of that step, and the file will have none: floats tell more.
    if (coarsest_step_m > usual_step_m) continue;
    finest_m = std::min(finest_m, step_m);
    options.largest_position_step_m = std::max(options.largest_position_step_m, coarsest_step_m);
    const auto round = [&, &origin = origin_m, &step = step_m, &lattice_points = points](std::uint32_t v) {
      const auto at = [&](std::size_t axis) {
        return static_cast<float>(static_cast<double>(origin[axis]) +
                                  static_cast<double>(step) * static_cast<double>(lattice_points[v][axis]));
      };
      positions[scene.vertex_index(*tile, v)] = {at(0), at(1), at(2)};
    };
    if (tile->triangles.empty()) {
      for (std::uint32_t v = 0; v < tile->positions.size(); ++v) round(v);
    }
    for (const base::Triangle& triangle : tile->triangles) {
      for (const std::uint32_t v : triangle) round(v);
    }
  }
  base::Bounds written = base::empty_bounds();
  if (options.keeping == protocol::codec::DracoKeeping::Shape && !mesh.triangles().empty()) {
    for (const auto& [a, b, c] : mesh.triangles()) {
      if (a == b || b == c || c == a) continue;
      for (const std::uint32_t v : {a, b, c}) base::include(written, positions[v]);
    }
  } else {
    written = base::bounds_of(positions);
  }
  const float step_m = stream::one_step_for_all(finest_m, written);
  options.position_step_m = step_m <= usual_step_m ? step_m : 0;
  options.largest_position_step_m = std::max(options.largest_position_step_m, options.position_step_m);
  return base::success();
}

}  // namespace spectra::exports
