#include "server/map/map_version.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace spectra::map {

MeshFacts facts_of(const mesh::MultispectralMesh& mesh) {
  return {.name = mesh.name,
          .origin = mesh.origin,
          .has_visible = mesh.has_visible,
          .has_temperature = mesh.has_temperature,
          .double_positions = mesh.double_positions,
          .left_out = mesh.left_out,
          .up = mesh.up,
          .is_metric = mesh.is_metric,
          .told = mesh.told,
          .vertex_count = mesh.vertex_count(),
          .triangle_count = mesh.triangle_count()};
}

mesh::MultispectralMesh mesh_of_blocks(std::span<const std::shared_ptr<const MapNode>> leaves,
                                       const BlockPlaces& blocks, const MeshFacts& facts) {
  mesh::MultispectralMesh mesh;
  mesh.name = facts.name;
  mesh.origin = facts.origin;
  mesh.has_visible = facts.has_visible;
  mesh.has_temperature = facts.has_temperature;
  mesh.double_positions = facts.double_positions;
  mesh.left_out = facts.left_out;
  mesh.up = facts.up;
  mesh.is_metric = facts.is_metric;
  mesh.told = facts.told;
  mesh.resize_vertices(static_cast<std::size_t>(facts.vertex_count));
  mesh.triangles().resize(static_cast<std::size_t>(facts.triangle_count));
  const std::span<base::Vec3f> positions = mesh.positions();
  const std::span<base::Rgb8> visible = mesh.visible();
  const std::span<float> temperature = mesh.temperature_celsius();
  auto& [sigmas, times] = mesh.confidence;
  for (const auto& node : leaves) {
    const bool has_any = std::any_of(node->blocks.begin(), node->blocks.end(),
                                     [&](BlockNumber number) { return blocks.contains(number); });
    if (!has_any) continue;
    const Tile& leaf = *node->tile;
    for (std::size_t v = 0; v < leaf.owned_count; ++v) {
      const auto block = blocks.find(block_of(leaf, v));
      if (block == blocks.end()) continue;
      const auto place = static_cast<std::size_t>(block->second.first_vertex + leaf.source_vertex[v]);
      positions[place] = leaf.positions[v];
      visible[place] = leaf.visible[v];
      temperature[place] = leaf.temperature_celsius[v];
      if (leaf.sigma_kelvin.empty() || std::isnan(leaf.sigma_kelvin[v])) continue;
      if (sigmas.empty()) {
        sigmas.resize(mesh.vertex_count(), std::numeric_limits<float>::quiet_NaN());
        times.resize(mesh.vertex_count(), kUnknownTime);
      }
      sigmas[place] = leaf.sigma_kelvin[v];
      times[place] = leaf.looked_at.at(v);
    }
    for (std::size_t t = 0; t < leaf.triangles.size(); ++t) {
      // All corners of a triangle are of its block.
      const auto block = blocks.find(block_of(leaf, leaf.triangles[t][0]));
      if (block == blocks.end()) continue;
      base::Triangle& triangle =
          mesh.triangles()[static_cast<std::size_t>(block->second.first_triangle + leaf.source_triangle[t])];
      for (unsigned corner = 0; corner < 3; ++corner) {
        triangle[corner] =
            static_cast<std::uint32_t>(block->second.first_vertex + leaf.source_vertex[leaf.triangles[t][corner]]);
      }
    }
  }
  return mesh;
}

std::vector<float> baseline_of_blocks(std::span<const std::shared_ptr<const MapNode>> leaves, const BlockPlaces& blocks,
                                      std::uint64_t vertex_count, std::uint32_t baseline_mark) {
  std::vector<float> result(static_cast<std::size_t>(vertex_count));
  for (const auto& node : leaves) {
    const Tile& leaf = *node->tile;
    const std::span<const float> baseline = baseline_of(leaf, baseline_mark);
    for (std::size_t v = 0; v < leaf.owned_count; ++v) {
      const auto block = blocks.find(block_of(leaf, v));
      if (block == blocks.end()) continue;
      result[static_cast<std::size_t>(block->second.first_vertex + leaf.source_vertex[v])] = baseline[v];
    }
  }
  return result;
}

}  // namespace spectra::map
