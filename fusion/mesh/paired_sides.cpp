#include "fusion/mesh/paired_sides.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <utility>

namespace spectra::mesh {

namespace {

constexpr std::uint32_t kNone = PairedSides::kNone;

/// Side `side` of face f runs from its corner `side` to the next; sides are numbered 3 f + side.
std::uint32_t next_side(std::uint32_t side) {
  return side % 3 == 2 ? side - 2 : side + 1;
}
std::uint32_t previous_side(std::uint32_t side) {
  return side % 3 == 0 ? side + 2 : side - 1;
}

/// Which side lies against which, kNone where there is none, or the edge is cut.
std::vector<std::uint32_t> opposite_sides(std::size_t vertex_count, const std::vector<base::Triangle>& faces,
                                          PairedSides& result) {
  const auto from = [&faces](std::uint32_t side) { return faces[side / 3][side % 3]; };
  const auto to = [&](std::uint32_t side) { return from(next_side(side)); };
  const auto side_count = static_cast<std::uint32_t>(3 * faces.size());

  // Counting sort by the lower end; few sides share one, so the rest of the order costs next to nothing.
  std::vector<std::uint32_t> begins(vertex_count + 1, 0);
  for (std::uint32_t side = 0; side < side_count; ++side) ++begins[std::min(from(side), to(side)) + 1];
  for (std::size_t v = 0; v < vertex_count; ++v) begins[v + 1] += begins[v];
  struct Entry {
    std::uint32_t upper_end;
    std::uint32_t side;
  };
  std::vector<Entry> entries(side_count);
  std::vector<std::uint32_t> fill(begins.begin(), begins.end() - 1);
  for (std::uint32_t side = 0; side < side_count; ++side) {
    entries[fill[std::min(from(side), to(side))]++] = {std::max(from(side), to(side)), side};
  }

  std::vector<std::uint32_t> opposite(side_count, kNone);
  for (std::size_t v = 0; v < vertex_count; ++v) {
    Entry* group = entries.data() + begins[v];
    Entry* const end = entries.data() + begins[v + 1];
    std::sort(group, end, [](const Entry& a, const Entry& b) {
      return std::pair(a.upper_end, a.side) < std::pair(b.upper_end, b.side);
    });
    while (group != end) {
      Entry* const group_end =
          std::find_if(group, end, [group](const Entry& entry) { return entry.upper_end != group->upper_end; });
      const std::ptrdiff_t count = group_end - group;
      if (count == 2 && from(group[0].side) != from(group[1].side)) {
        opposite[group[0].side] = group[1].side;
        opposite[group[1].side] = group[0].side;
      } else if (count > 1) {
        ++(count == 2 ? result.flipped_edge_count : result.non_manifold_edge_count);
        result.cut_edge_side_count += static_cast<std::uint64_t>(count);
        for (const Entry* entry = group + 1; entry != group_end; ++entry) {
          result.cut_neighbours.emplace_back(group->side / 3, entry->side / 3);
        }
      }
      group = group_end;
    }
  }
  return opposite;
}

/// Gives every fan of a vertex but the first a vertex of its own, in `faces`.
void cut_vertices(std::size_t vertex_count, const std::vector<std::uint32_t>& opposite,
                  std::vector<base::Triangle>& faces, PairedSides& result) {
  std::vector<bool> is_done(opposite.size(), false);
  std::vector<bool> is_seen(vertex_count, false);
  for (std::uint32_t start = 0; start < opposite.size(); ++start) {
    if (is_done[start]) continue;
    const std::uint32_t vertex = faces[start / 3][start % 3];
    std::uint32_t target = vertex;
    if (is_seen[vertex]) {
      target = static_cast<std::uint32_t>(vertex_count + result.source_vertex.size());
      result.source_vertex.push_back(vertex);
    }
    is_seen[vertex] = true;
    const auto assign = [&](std::uint32_t side) {
      is_done[side] = true;
      faces[side / 3][side % 3] = target;
    };
    // Corners are named by the side that leaves the vertex there: all round, or to both ends of an open fan.
    std::uint32_t side = start;
    do {
      assign(side);
      side = opposite[previous_side(side)];
    } while (side != kNone && side != start);
    if (side == start) continue;
    for (std::uint32_t across = opposite[start]; across != kNone; across = opposite[side]) {
      side = next_side(across);
      assign(side);
    }
  }
}

}  // namespace

PairedSides paired_sides(std::size_t vertex_count, std::span<const base::Triangle> triangles,
                         const base::Progress& progress) {
  base::report(progress, base::kTopologyPhase, 0);
  PairedSides result;
  const auto takes_part = [vertex_count](const base::Triangle& triangle) {
    const auto& [a, b, c] = triangle;
    return a != b && b != c && c != a && std::max({a, b, c}) < vertex_count;
  };
  result.faces.reserve(static_cast<std::size_t>(std::count_if(triangles.begin(), triangles.end(), takes_part)));
  std::copy_if(triangles.begin(), triangles.end(), std::back_inserter(result.faces), takes_part);
  result.opposite = opposite_sides(vertex_count, result.faces, result);
  base::report(progress, base::kTopologyPhase, 0.4);
  cut_vertices(vertex_count, result.opposite, result.faces, result);
  base::report(progress, base::kTopologyPhase, 0.5);
  return result;
}

}  // namespace spectra::mesh
