#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

#include "fusion/mesh/topology.hpp"
#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/interruption.hpp"
#include "server/app/progress_line.hpp"
#include "server/exports/fused_file.hpp"
#include "server/session/conversions.hpp"

namespace spectra::app {
namespace {

/// Whether the metres of its size are known to be some.
std::string_view about_unit(const files::LoadedScene& loaded) {
  if (loaded.mesh.is_metric) return "";
  const bool is_another_told = std::any_of(loaded.notes.begin(), loaded.notes.end(),
                                           [](const files::Note& note) { return note.id == "unit_told"; });
  return is_another_told ? " if one unit were a metre; the file names another (see the note)"
                         : " (the file names no unit, metres are assumed; --scale gives another)";
}

protocol::Bounds bounds_of(std::span<const base::Vec3f> positions) {
  protocol::Bounds bounds;
  bool is_first = true;
  for (const auto& p : positions) {
    const std::array<double, 3> position{double{p.x}, double{p.y}, double{p.z}};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      bounds.min[axis] = is_first ? position[axis] : std::min(bounds.min[axis], position[axis]);
      bounds.max[axis] = is_first ? position[axis] : std::max(bounds.max[axis], position[axis]);
    }
    is_first = false;
  }
  return bounds;
}

/// Without strays.
protocol::Bounds core_bounds_of(const files::LoadedScene& loaded) {
  const auto& [low, high] = *loaded.core_bounds;
  return {{double{low.x}, double{low.y}, double{low.z}}, {double{high.x}, double{high.y}, double{high.z}}};
}

std::array<double, 3> size_of(const protocol::Bounds& bounds) {
  return {bounds.max[0] - bounds.min[0], bounds.max[1] - bounds.min[1], bounds.max[2] - bounds.min[2]};
}

nlohmann::json info_json(const files::LoadedScene& loaded, const fusion::TemperatureSummary& temperature,
                         const protocol::Bounds& bounds, const mesh::TopologyFacts& topology) {
  const auto& mesh = loaded.mesh;
  const auto core = core_bounds_of(loaded);
  const auto size = size_of(core);
  auto notes = nlohmann::json::array();
  for (const auto& note : loaded.notes) {
    notes.push_back({{"id", note.id}, {"count", note.count}, {"message", note.message}});
  }
  return {{"name", mesh.name},
          {"vertex_count", mesh.vertex_count()},
          {"triangle_count", mesh.triangle_count()},
          {"point_cloud", mesh.is_point_cloud()},
          {"has_visible", mesh.has_visible},
          {"has_temperature", mesh.has_temperature},
          {"double_positions", mesh.double_positions},
          {"origin", {mesh.origin.x, mesh.origin.y, mesh.origin.z}},
          {"bounds", protocol::to_json(bounds)},
          {"core_bounds", protocol::to_json(core)},
          {"size_m", {size[0], size[1], size[2]}},
          {"metric", mesh.is_metric},
          {"up", to_string(mesh.up)},
          {"temperature", protocol::to_json(session::to_message(temperature))},
          {"topology",
           {{"boundary_edge_count", topology.boundary_edge_count},
            {"non_manifold_edge_count", topology.non_manifold_edge_count},
            {"flipped_edge_count", topology.flipped_edge_count},
            {"non_manifold_vertex_count", topology.non_manifold_vertex_count},
            {"unreferenced_vertex_count", topology.unreferenced_vertex_count},
            {"component_count", topology.component_count}}},
          {"notes", notes}};
}

void print_info(const files::LoadedScene& loaded, const fusion::TemperatureSummary& temperature,
                const protocol::Bounds& bounds, const mesh::TopologyFacts& topology) {
  const auto& mesh = loaded.mesh;
  fmt::print("name         {}\n", mesh.name);
  fmt::print("vertices     {}\n", mesh.vertex_count());
  fmt::print("triangles    {}{}\n", mesh.triangle_count(), mesh.is_point_cloud() ? " (a point cloud)" : "");
  fmt::print("positions    {}\n", mesh.double_positions ? "double" : "float");
  fmt::print("origin       {} {} {} m\n", mesh.origin.x, mesh.origin.y, mesh.origin.z);
  fmt::print("bounds       {} {} {} to {} {} {} m from the origin\n", bounds.min[0], bounds.min[1], bounds.min[2],
             bounds.max[0], bounds.max[1], bounds.max[2]);
  const auto size = size_of(core_bounds_of(loaded));
  fmt::print("size         {:.6g} x {:.6g} x {:.6g} m{}\n", size[0], size[1], size[2], about_unit(loaded));
  fmt::print("up           {}\n", to_string(mesh.up));
  fmt::print("colours      {}\n", mesh.has_visible ? "yes" : "none (shown as mid grey)");
  if (temperature.has_temperature()) {
    fmt::print("temperature  {} to {} degC, mean {:.3f}, sigma {:.3f}\n", temperature.minimum, temperature.maximum,
               temperature.mean, temperature.sigma);
    fmt::print("missing      {} of {} vertices have no temperature\n", temperature.missing_count, mesh.vertex_count());
  } else {
    fmt::print("temperature  none\n");
  }
  if (temperature.over_range_count + temperature.under_range_count > 0) {
    fmt::print("out of range {} vertices above and {} below what the sensor could tell\n", temperature.over_range_count,
               temperature.under_range_count);
  }
  if (!mesh.is_point_cloud()) {
    fmt::print(
        "topology     {} pieces, {} boundary edges, {} non-manifold edges, {} flipped edges, "
        "{} non-manifold vertices, {} vertices of no triangle\n",
        topology.component_count, topology.boundary_edge_count, topology.non_manifold_edge_count,
        topology.flipped_edge_count, topology.non_manifold_vertex_count, topology.unreferenced_vertex_count);
  }
  for (const auto& note : loaded.notes) fmt::print("note         {}\n", note.message);
}

}  // namespace

int run_info(const InfoOptions& options) {
  const Interruption interruption;
  ProgressLine line(
      with_loading(options.input, options.thermal, {{base::kTopologyPhase, "examining the topology", 12}}));
  const auto loaded = load_scene(options.input, options.thermal, watched(options.read, line));
  if (!loaded) return fail(loaded.error());
  const auto& mesh = loaded.value().mesh;
  const auto temperature = exports::temperature_of(mesh).summary;
  const auto bounds = bounds_of(mesh.positions());
  const auto topology = mesh::topology_facts(mesh, line.sink());
  line.end();
  if (options.as_json) {
    const auto json = info_json(loaded.value(), temperature, bounds, topology);
    fmt::print("{}\n", json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
  } else {
    print_info(loaded.value(), temperature, bounds, topology);
  }
  return kDone;
}

}  // namespace spectra::app
