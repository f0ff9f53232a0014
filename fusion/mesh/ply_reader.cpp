#include "fusion/mesh/ply_reader.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "fusion/mesh/nearest_vertex.hpp"
#include "fusion/mesh/ply_stream.hpp"
#include "fusion/mesh/ply_values.hpp"
#include "fusion/mesh/scene_origin.hpp"

namespace spectra::fusion {

namespace {

/// What a thermal file is read for.
struct ThermalVertices {
  std::vector<Vec3d> positions;
  std::vector<float> temperature_celsius;
  std::vector<Note> notes;
};

bool is_about_temperature(const Note& note) {
  return note.id.ends_with("_temperatures") || note.id == "no_temperature" || note.id == "temperature_property";
}

Result<ThermalVertices> read_thermal_vertices(const std::filesystem::path& path, const ReadOptions& options) {
  BOOST_OUTCOME_TRY(PlyStream stream, PlyStream::open(path, options));
  const std::string name = path.filename().string();
  if (!stream.has_temperature()) {
    return failure(
        ErrorCode::Unsupported,
        name + ": the thermal file has no property that says temperature; --temperature-property NAME takes another",
        name);
  }
  ThermalVertices thermal;
  thermal.positions.reserve(static_cast<std::size_t>(stream.vertex_count()));
  thermal.temperature_celsius.reserve(static_cast<std::size_t>(stream.vertex_count()));
  PlyHandlers handlers;
  handlers.vertices = [&thermal](const PlyVertexBlock& block) -> Result<void> {
    auto hole = block.left_out.begin();
    for (std::size_t i = 0; i < block.positions.size(); ++i) {
      if (hole != block.left_out.end() && *hole == i) {
        ++hole;
        continue;
      }
      thermal.positions.push_back(block.positions[i]);
      thermal.temperature_celsius.push_back(block.temperature_celsius[i]);
    }
    return success();
  };
  BOOST_OUTCOME_TRY(const PlyBodyFacts facts, stream.read(handlers));
  for (Note& note : stream.notes(facts)) {
    // Its faces and colours are not asked for, and the gaps are counted again after the join.
    const bool is_asked_for = is_about_temperature(note) && note.id != "missing_temperatures";
    if (note.id != "skipped_vertex_properties" && note.id != "trailing_bytes" && note.id != "left_out_vertices" &&
        !is_asked_for) {
      continue;
    }
    thermal.notes.push_back({"thermal_" + note.id, note.count, name + ": " + note.message});
  }
  return thermal;
}

std::string in_metres(double distance) {
  return number_text(distance) + " m";
}

Vec3d absolute_position(const MultispectralMesh& mesh, std::size_t vertex) {
  const Vec3f& p = mesh.positions()[vertex];
  return {mesh.origin.x + static_cast<double>(p.x), mesh.origin.y + static_cast<double>(p.y),
          mesh.origin.z + static_cast<double>(p.z)};
}

/// The temperature of vertex i of the thermal file for vertex i; says so when they are not where the others are.
void join_in_order(const ThermalVertices& thermal, LoadedScene& scene) {
  MultispectralMesh& mesh = scene.mesh;
  const std::size_t count = mesh.vertex_count();
  std::copy(thermal.temperature_celsius.begin(), thermal.temperature_celsius.end(), mesh.temperature_celsius().begin());
  scene.notes.push_back(
      {"thermal_joined_in_order", count,
       "Temperatures of the thermal file taken in order: it has the same " + std::to_string(count) + " vertices"});
  Vec3d min = thermal.positions[0];
  Vec3d max = min;
  for (const Vec3d& p : thermal.positions) {
    min = {std::min(min.x, p.x), std::min(min.y, p.y), std::min(min.z, p.z)};
    max = {std::max(max.x, p.x), std::max(max.y, p.y), std::max(max.z, p.z)};
  }
  constexpr double kSamePlace = 1e-3;
  const double tolerance = kSamePlace * std::max({max.x - min.x, max.y - min.y, max.z - min.z});
  std::uint64_t moved_count = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d p = absolute_position(mesh, i);
    const Vec3d& q = thermal.positions[i];
    const double distance = std::max({std::abs(p.x - q.x), std::abs(p.y - q.y), std::abs(p.z - q.z)});
    moved_count += distance > tolerance ? 1U : 0U;
  }
  if (moved_count > 0) {
    scene.notes.push_back(
        {"thermal_positions_differ", moved_count,
         std::to_string(moved_count) + " vertices are elsewhere in the thermal file, although it has as many"});
  }
}

void join_nearest(const ThermalVertices& thermal, double join_distance_m, LoadedScene& scene) {
  MultispectralMesh& mesh = scene.mesh;
  const NearestVertex nearest(thermal.positions);
  constexpr double kSpacings = 3;
  const double distance = join_distance_m > 0 ? join_distance_m : kSpacings * nearest.median_spacing();
  const std::span<float> temperatures = mesh.temperature_celsius();
  std::uint64_t joined_count = 0;
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    const auto hit = nearest.find(absolute_position(mesh, i), distance);
    temperatures[i] = hit ? thermal.temperature_celsius[hit->index] : std::numeric_limits<float>::quiet_NaN();
    joined_count += hit ? 1U : 0U;
  }
  scene.notes.push_back({"thermal_joined_nearest", joined_count,
                         std::to_string(joined_count) + " of " + std::to_string(mesh.vertex_count()) +
                             " vertices have the temperature of the nearest thermal vertex within " +
                             in_metres(distance)});
  if (joined_count < mesh.vertex_count()) {
    scene.notes.push_back({"thermal_not_reached", mesh.vertex_count() - joined_count,
                           std::to_string(mesh.vertex_count() - joined_count) +
                               " vertices have no thermal vertex within " + in_metres(distance)});
  }
}

LeftOutVertex left_out_vertex(const PlyVertexBlock& block, std::uint32_t index) {
  LeftOutVertex vertex;
  vertex.input_index = static_cast<std::uint32_t>(block.first_vertex) + index;
  vertex.position = block.positions[index];
  vertex.visible = block.visible.empty() ? MultispectralMesh::kNoColour : block.visible[index];
  vertex.temperature_celsius =
      block.temperature_celsius.empty() ? std::numeric_limits<float>::quiet_NaN() : block.temperature_celsius[index];
  return vertex;
}

/// Where the vertices of the file are in the mesh, which still has room for all of them.
std::vector<std::uint32_t> mesh_indices(const MultispectralMesh& mesh) {
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

Result<LoadedScene> read_ply(const std::filesystem::path& path, const ReadOptions& options) {
  BOOST_OUTCOME_TRY(PlyStream stream, PlyStream::open(path, options));
  LoadedScene scene;
  MultispectralMesh& mesh = scene.mesh;
  mesh.resize_vertices(static_cast<std::size_t>(stream.vertex_count()));
  mesh.triangles().reserve(static_cast<std::size_t>(stream.triangle_count_limit()));
  mesh.has_visible = stream.has_visible();
  mesh.has_temperature = stream.has_temperature();
  mesh.double_positions = stream.has_double_positions();
  mesh.name = path.filename().string();

  // Doubles wait for the origin, which is known when all are read; floats can move there without loss, unless they are
  // scaled.
  const bool is_exact = mesh.double_positions || options.metres_per_unit != 1;
  std::vector<Vec3d> exact_positions(is_exact ? mesh.vertex_count() : 0);
  std::size_t kept_count = 0;
  const auto keep = [&](const PlyVertexBlock& block, std::size_t begin, std::size_t end) {
    const auto positions = block.positions.subspan(begin, end - begin);
    const auto out = static_cast<std::ptrdiff_t>(kept_count);
    if (is_exact) {
      std::copy(positions.begin(), positions.end(), exact_positions.begin() + out);
    } else {
      std::transform(positions.begin(), positions.end(), mesh.positions().begin() + out,
                     [](const Vec3d& position) { return relative_to({}, position); });
    }
    if (!block.visible.empty()) {
      const auto visible = block.visible.subspan(begin, end - begin);
      std::copy(visible.begin(), visible.end(), mesh.visible().begin() + out);
    }
    if (!block.temperature_celsius.empty()) {
      const auto temperatures = block.temperature_celsius.subspan(begin, end - begin);
      std::copy(temperatures.begin(), temperatures.end(), mesh.temperature_celsius().begin() + out);
    }
    kept_count += end - begin;
  };
  std::vector<std::uint32_t> mesh_index;  // By the file's index, when that is not the same.
  PlyHandlers handlers;
  handlers.vertices = [&](const PlyVertexBlock& block) -> Result<void> {
    std::size_t begin = 0;
    for (const std::uint32_t hole : block.left_out) {
      keep(block, begin, hole);
      mesh.left_out.push_back(left_out_vertex(block, hole));
      begin = hole + 1;
    }
    keep(block, begin, block.positions.size());
    return success();
  };
  handlers.triangles = [&](std::span<const Triangle> triangles) -> Result<void> {
    if (!mesh.left_out.empty() && mesh_index.empty()) mesh_index = mesh_indices(mesh);
    mesh.triangles().insert(mesh.triangles().end(), triangles.begin(), triangles.end());
    if (!mesh_index.empty()) {
      for (Triangle& triangle : std::span(mesh.triangles()).last(triangles.size())) {
        for (std::uint32_t& corner : triangle) corner = mesh_index[corner];
      }
    }
    return success();
  };
  BOOST_OUTCOME_TRY(const PlyBodyFacts facts, stream.read(handlers));
  if (kept_count < mesh.vertex_count()) mesh.resize_vertices(kept_count);
  exact_positions.resize(is_exact ? kept_count : 0);

  mesh.origin = scene_origin(facts.min, facts.max);
  if (is_exact) {
    std::transform(exact_positions.begin(), exact_positions.end(), mesh.positions().begin(),
                   [&](const Vec3d& position) { return relative_to(mesh.origin, position); });
  } else if (mesh.origin != Vec3d{}) {
    for (Vec3f& p : mesh.positions()) {
      p = relative_to(mesh.origin, {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)});
    }
  }
  scene.notes = stream.notes(facts);
  scene.comments = stream.header().comments;
  return scene;
}

Result<LoadedScene> read_ply_with_thermal(const std::filesystem::path& path, const std::filesystem::path& thermal_path,
                                          const ReadOptions& options, double join_distance_m) {
  if (!std::isfinite(join_distance_m) || join_distance_m < 0) {
    return failure(ErrorCode::OutOfRange, "join_distance_m is a finite distance of 0 (automatic) or more",
                   "join_distance_m");
  }
  BOOST_OUTCOME_TRY(ThermalVertices thermal, read_thermal_vertices(thermal_path, options));
  ReadOptions visible_options;
  visible_options.metres_per_unit = options.metres_per_unit;
  BOOST_OUTCOME_TRY(LoadedScene scene, read_ply(path, visible_options));
  // What stands in for them is told of below.
  std::erase_if(scene.notes, [](const Note& note) { return is_about_temperature(note); });
  if (scene.mesh.has_temperature) {
    scene.notes.push_back({"replaced_temperatures", scene.mesh.vertex_count(),
                           "The file's own temperatures replaced by those of the thermal file"});
  }
  scene.mesh.has_temperature = true;
  if (thermal.positions.size() == scene.mesh.vertex_count()) {
    join_in_order(thermal, scene);
  } else {
    join_nearest(thermal, join_distance_m, scene);
  }
  const auto missing_count = static_cast<std::uint64_t>(
      std::count_if(scene.mesh.temperature_celsius().begin(), scene.mesh.temperature_celsius().end(),
                    [](float celsius) { return std::isnan(celsius); }));
  if (missing_count > 0) {
    scene.notes.push_back(
        {"missing_temperatures", missing_count, std::to_string(missing_count) + " vertices without a temperature"});
  }
  scene.notes.insert(scene.notes.end(), thermal.notes.begin(), thermal.notes.end());
  return scene;
}

}  // namespace spectra::fusion
