#include "fusion/files/ply_reader.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fusion/files/ply_notes.hpp"
#include "fusion/files/ply_stream.hpp"
#include "fusion/files/ply_values.hpp"
#include "fusion/files/scene_origin.hpp"
#include "fusion/files/thermal_join.hpp"
#include "fusion/files/told_coordinates.hpp"

namespace spectra::files {

namespace {

bool is_about_temperature(const Note& note) {
  return note.id.ends_with("_temperatures") || note.id == "no_temperature" || note.id == "temperature_property" ||
         note.id == "unused_options";
}

/// A scene and the thermal file that shall lie on it.
struct ScenePair {
  LoadedScene scene;
  LoadedScene thermal;
};

base::Result<ScenePair> read_pair(const std::filesystem::path& path, const std::filesystem::path& thermal_path,
                                  const ReadOptions& options) {
  ReadOptions scene_options;  // those about temperature belong to the thermal file
  scene_options.metres_per_unit = options.metres_per_unit;
  scene_options.colour_properties = options.colour_properties;
  scene_options.colour_white = options.colour_white;
  scene_options.origin = options.origin;
  scene_options.progress = options.progress;
  ReadOptions thermal_options = options;
  thermal_options.colour_properties.clear();
  thermal_options.colour_white.reset();
  if (options.progress) {
    thermal_options.progress = [&options](std::string_view, double share) {
      options.progress(base::kReadingThermalPhase, share);
    };
  }
  BOOST_OUTCOME_TRY(LoadedScene thermal, read_ply(thermal_path, thermal_options));
  if (!thermal.mesh.has_temperature) {
    const auto note = std::find_if(thermal.notes.begin(), thermal.notes.end(),
                                   [](const Note& one) { return one.id == "no_temperature"; });
    return base::failure(base::ErrorCode::Unsupported,
                         thermal.mesh.name + ": the thermal file has no temperature: " +
                             (note == thermal.notes.end() ? "none of its properties can be one" : note->message),
                         thermal.mesh.name);
  }
  const auto celsius = thermal.mesh.temperature_celsius();
  if (std::all_of(celsius.begin(), celsius.end(), [](float t) { return std::isnan(t); })) {
    return base::failure(base::ErrorCode::Unsupported,
                         thermal.mesh.name + ": the thermal file has no temperature in it: none of its " +
                             std::to_string(celsius.size()) + " vertices has one",
                         thermal.mesh.name);
  }
  BOOST_OUTCOME_TRY(LoadedScene scene, read_ply(path, scene_options));
  base::Result<void> overlap = check_overlap(scene, thermal);
  if (!overlap && options.scale() != 1) {
    const auto tell = [&options](LoadedScene& told, const std::string& scaled, const std::string& as_it_is) {
      told.notes.push_back({"scaled_one_file", 1,
                            "--scale " + number_text(options.scale()) + " taken for " + scaled + " alone: " + as_it_is +
                                " is in metres already"});
    };
    ReadOptions unscaled = thermal_options;
    unscaled.progress = options.progress;
    unscaled.metres_per_unit = 1;
    BOOST_OUTCOME_TRY(LoadedScene thermal_as_it_is, read_ply(thermal_path, unscaled));
    if (check_overlap(scene, thermal_as_it_is) && sizes_agree(scene, thermal_as_it_is)) {
      tell(scene, scene.mesh.name, thermal.mesh.name);
      return ScenePair{std::move(scene), std::move(thermal_as_it_is)};
    }
    scene_options.metres_per_unit = 1;
    BOOST_OUTCOME_TRY(LoadedScene scene_as_it_is, read_ply(path, scene_options));
    if (check_overlap(scene_as_it_is, thermal) && sizes_agree(scene_as_it_is, thermal)) {
      tell(scene_as_it_is, thermal.mesh.name, scene.mesh.name);
      return ScenePair{std::move(scene_as_it_is), std::move(thermal)};
    }
  }
  BOOST_OUTCOME_TRYV(overlap);
  return ScenePair{std::move(scene), std::move(thermal)};
}

mesh::LeftOutVertex left_out_vertex(const PlyVertexBlock& block, std::uint32_t index) {
  mesh::LeftOutVertex vertex;
  vertex.input_index = static_cast<std::uint32_t>(block.first_vertex) + index;
  vertex.position = block.positions[index];
  vertex.visible = block.visible.empty() ? mesh::MultispectralMesh::kNoColour : block.visible[index];
  vertex.temperature_celsius =
      block.temperature_celsius.empty() ? std::numeric_limits<float>::quiet_NaN() : block.temperature_celsius[index];
  return vertex;
}

/// Where the vertices of the file are in the mesh, which still has room for all of them.
std::vector<std::uint32_t> mesh_indices(const mesh::MultispectralMesh& mesh) {
  std::vector<std::uint32_t> indices(mesh.vertex_count());
  std::uint32_t next = 0;
  auto hole = mesh.left_out.begin();
  for (std::uint32_t v = 0; v < indices.size(); ++v) {
    if (hole != mesh.left_out.end() && hole->input_index == v) {
      ++hole;
    } else {
      indices[v] = next++;
    }
  }
  return indices;
}

}  // namespace

base::Result<LoadedScene> read_ply(const std::filesystem::path& path, const ReadOptions& options) {
  BOOST_OUTCOME_TRY(PlyStream stream, PlyStream::open(path, options));
  LoadedScene scene;
  mesh::MultispectralMesh& mesh = scene.mesh;
  mesh.resize_vertices(static_cast<std::size_t>(stream.vertex_count()));
  mesh.triangles().reserve(static_cast<std::size_t>(stream.triangle_count_limit()));
  mesh.has_visible = stream.has_visible();
  mesh.has_temperature = stream.has_temperature();
  mesh.name = path.filename().string();

  // Doubles, and text, wait for the origin, which is known when all are read; floats can move there without loss, unless
  // they are scaled.
  const bool is_exact = stream.has_double_positions() || stream.is_text() || options.scale() != 1;
  std::vector<base::Vec3d> exact_positions(is_exact ? mesh.vertex_count() : 0);
  std::size_t kept_count = 0;
  const auto keep = [&](const PlyVertexBlock& block, std::size_t begin, std::size_t end) {
    const auto positions = block.positions.subspan(begin, end - begin);
    const auto out = static_cast<std::ptrdiff_t>(kept_count);
    if (is_exact) {
      std::copy(positions.begin(), positions.end(), exact_positions.begin() + out);
    } else {
      std::transform(positions.begin(), positions.end(), mesh.positions().begin() + out,
                     [](const base::Vec3d& position) { return relative_to({}, position); });
    }
    if (!block.visible.empty()) {
      const auto visible = block.visible.subspan(begin, end - begin);
      std::copy(visible.begin(), visible.end(), mesh.visible().begin() + out);
    }
    if (!block.temperature_celsius.empty()) {
      const auto temperatures = block.temperature_celsius.subspan(begin, end - begin);
      std::copy(temperatures.begin(), temperatures.end(), mesh.temperature_celsius().begin() + out);
    }
    if (!block.sigma_kelvin.empty()) {
      const auto first = static_cast<std::ptrdiff_t>(begin), last = static_cast<std::ptrdiff_t>(end);
      auto& [sigmas, times] = mesh.confidence;
      sigmas.insert(sigmas.end(), block.sigma_kelvin.begin() + first, block.sigma_kelvin.begin() + last);
      times.insert(times.end(), block.looked_at.begin() + first, block.looked_at.begin() + last);
    }
    kept_count += end - begin;
  };
  std::vector<std::uint32_t> mesh_index;  // By the file's index, when that is not the same.
  PlyHandlers handlers;
  handlers.vertices = [&](const PlyVertexBlock& block) -> base::Result<void> {
    std::size_t begin = 0;
    for (const std::uint32_t hole : block.left_out) {
      keep(block, begin, hole);
      mesh.left_out.push_back(left_out_vertex(block, hole));
      begin = hole + 1;
    }
    keep(block, begin, block.positions.size());
    return base::success();
  };
  handlers.triangles = [&](std::span<const base::Triangle> triangles) -> base::Result<void> {
    if (!mesh.left_out.empty() && mesh_index.empty()) mesh_index = mesh_indices(mesh);
    mesh.triangles().insert(mesh.triangles().end(), triangles.begin(), triangles.end());
    if (!mesh_index.empty()) {
      for (base::Triangle& triangle : std::span(mesh.triangles()).last(triangles.size())) {
        for (std::uint32_t& corner : triangle) corner = mesh_index[corner];
      }
    }
    return base::success();
  };
  BOOST_OUTCOME_TRY(PlyBodyFacts facts, stream.read(handlers));
  if (stream.leave_out_holes(facts)) {
    kept_count = 0;
    mesh.confidence = {};
    mesh.left_out.clear();
    mesh.triangles().clear();
    mesh_index.clear();
    BOOST_OUTCOME_TRY(facts, stream.read(handlers));
  }
  if (kept_count < mesh.vertex_count()) mesh.resize_vertices(kept_count);
  const auto& sigmas = mesh.confidence.sigma_kelvin;
  if (std::all_of(sigmas.begin(), sigmas.end(), [](float kelvin) { return std::isnan(kelvin); })) mesh.confidence = {};
  exact_positions.resize(is_exact ? kept_count : 0);

  mesh.origin = facts.origin;
  mesh.double_positions = stream.has_double_positions(facts);
  if (is_exact) {
    std::transform(exact_positions.begin(), exact_positions.end(), mesh.positions().begin(),
                   [&](const base::Vec3d& position) { return relative_to(mesh.origin, position); });
  } else if (mesh.origin != base::Vec3d{}) {
    for (base::Vec3f& p : mesh.positions()) {
      p = relative_to(mesh.origin, {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)});
    }
  }
  scene.notes = stream.notes(facts);
  scene.comments = stream.header().comments;
  mesh.told = told_coordinates(scene.comments, options);
  return scene;
}

base::Result<LoadedScene> read_ply_with_thermal(const std::filesystem::path& path,
                                                const std::filesystem::path& thermal_path, const ReadOptions& options,
                                                double join_distance_m) {
  if (!std::isfinite(join_distance_m) || join_distance_m < 0) {
    return base::failure(base::ErrorCode::OutOfRange, "join_distance_m is a finite distance of 0 (automatic) or more",
                         "join_distance_m");
  }
  BOOST_OUTCOME_TRY(auto pair, read_pair(path, thermal_path, options));
  LoadedScene scene = std::move(pair.scene);
  const LoadedScene& thermal = pair.thermal;
  // What stands in for them is told of below.
  std::erase_if(scene.notes, [](const Note& note) { return is_about_temperature(note); });
  if (scene.mesh.has_temperature) {
    scene.notes.push_back({"replaced_temperatures", scene.mesh.vertex_count(),
                           "The file's own temperatures replaced by those of the thermal file"});
  }
  scene.mesh.has_temperature = true;
  scene.mesh.confidence = {};
  base::report(options.progress, base::kJoiningPhase, 0);
  BOOST_OUTCOME_TRYV(join_thermal(thermal, join_distance_m, scene, options.progress));
  const auto missing_count = static_cast<std::uint64_t>(
      std::count_if(scene.mesh.temperature_celsius().begin(), scene.mesh.temperature_celsius().end(),
                    [](float celsius) { return std::isnan(celsius); }));
  if (missing_count > 0) {
    scene.notes.push_back({"missing_temperatures", missing_count,
                           counted(missing_count, "vertex", "vertices") + " without a temperature"});
  }
  for (const Note& note : thermal.notes) {
    // Its faces and colours are not asked for, and the gaps are counted again after the join.
    const bool is_asked_for = is_about_temperature(note) && note.id != "missing_temperatures";
    if (note.id != "skipped_vertex_properties" && note.id != "trailing_bytes" && note.id != "left_out_vertices" &&
        note.id != "hole_vertices" && !is_asked_for) {
      continue;
    }
    scene.notes.push_back({"thermal_" + note.id, note.count, thermal.mesh.name + ": " + note.message});
  }
  return scene;
}

}  // namespace spectra::files
