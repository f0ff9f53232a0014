#include "server/scene/octree_cut.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>

#include "server/scene/vertex_index_map.hpp"

namespace spectra::server {
namespace {

using fusion::Vec3f;

constexpr std::size_t kChunkSize = 1 << 16;

std::array<double, 3> coordinates(const Vec3f& v) {
  return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
}

std::uint32_t owned_vertex_count(const CutElement& element) {
  return static_cast<std::uint32_t>(std::popcount(element.owned_corners));  // a lone vertex has one bit too
}

Bounds empty_bounds() {
  constexpr float infinity = std::numeric_limits<float>::infinity();
  return {{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
}

void include(Bounds& bounds, const Vec3f& p) {
  bounds.min = {std::min(bounds.min.x, p.x), std::min(bounds.min.y, p.y), std::min(bounds.min.z, p.z)};
  bounds.max = {std::max(bounds.max.x, p.x), std::max(bounds.max.y, p.y), std::max(bounds.max.z, p.z)};
}

std::vector<CutElement> cut_elements(const fusion::MultispectralMesh& mesh, WorkerPool& pool) {
  const std::span<const Vec3f> positions = mesh.positions();
  const std::vector<fusion::Triangle>& triangles = mesh.triangles();
  std::vector<CutElement> elements(triangles.size());
  std::vector<bool> is_used(positions.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (unsigned corner = 0; corner < 3; ++corner) {
      auto used = is_used[triangles[t][corner]];
      if (!used) elements[t].owned_corners |= static_cast<std::uint8_t>(1u << corner);
      used = true;
    }
  }
  pool.for_each((triangles.size() + kChunkSize - 1) / kChunkSize, [&](std::size_t chunk) {
    const std::size_t end = std::min(triangles.size(), (chunk + 1) * kChunkSize);
    for (std::size_t t = chunk * kChunkSize; t < end; ++t) {
      const auto a = coordinates(positions[triangles[t][0]]);
      const auto b = coordinates(positions[triangles[t][1]]);
      const auto c = coordinates(positions[triangles[t][2]]);
      elements[t].index = static_cast<std::uint32_t>(t);
      elements[t].place = {static_cast<float>((a[0] + b[0] + c[0]) / 3), static_cast<float>((a[1] + b[1] + c[1]) / 3),
                           static_cast<float>((a[2] + b[2] + c[2]) / 3)};
    }
  });
  for (std::size_t v = 0; v < positions.size(); ++v) {
    if (!is_used[v]) {
      elements.push_back({positions[v], static_cast<std::uint32_t>(v), CutElement::kLoneVertex});
    }
  }
  return elements;
}

/// A cell that is being cut: a range of the current element buffer.
struct Cell {
  protocol::TileId id;
  std::size_t begin = 0, end = 0;
  std::uint64_t owned_count = 0;
};

/// Where a cell is halved; an axis along which it is thin is not.
struct Halving {
  std::array<double, 3> centre{};
  std::array<bool, 3> is_halved{};

  unsigned octant(const Vec3f& place) const {
    const auto p = coordinates(place);
    unsigned result = 0;
    for (unsigned axis = 0; axis < 3; ++axis) {
      if (is_halved[axis] && p[axis] >= centre[axis]) result |= 1u << axis;
    }
    return result;
  }
};

/// Halves the axes that are at least half as long as the longest: a thin axis would only make ragged borders.
Halving halving(const std::array<double, 3>& centre, const std::array<double, 3>& extent) {
  const double longest = std::max({extent[0], extent[1], extent[2]});
  Halving result{centre, {}};
  for (unsigned axis = 0; axis < 3; ++axis) {
    result.is_halved[axis] = extent[axis] > 0 && extent[axis] >= longest / 2;
  }
  return result;
}

Halving halving_in_the_middle(const Bounds& bounds) {
  const auto low = coordinates(bounds.min), high = coordinates(bounds.max);
  return halving({low[0] + (high[0] - low[0]) / 2, low[1] + (high[1] - low[1]) / 2, low[2] + (high[2] - low[2]) / 2},
                 {high[0] - low[0], high[1] - low[1], high[2] - low[2]});
}

Halving halving_at_the_medians(std::span<const CutElement> elements) {
  constexpr std::size_t kSampleSize = 4096;
  const std::size_t stride = std::max<std::size_t>(1, elements.size() / kSampleSize);
  std::array<std::vector<double>, 3> sample;
  for (std::size_t i = 0; i < elements.size(); i += stride) {
    const auto p = coordinates(elements[i].place);
    for (unsigned axis = 0; axis < 3; ++axis) sample[axis].push_back(p[axis]);
  }
  std::array<double, 3> median{}, spread{};
  for (unsigned axis = 0; axis < 3; ++axis) {
    std::vector<double>& values = sample[axis];
    std::sort(values.begin(), values.end());
    median[axis] = values[values.size() / 2];
    spread[axis] = values[values.size() * 9 / 10] - values[values.size() / 10];
  }
  return halving(median, spread);
}

struct OctantCount {
  std::uint64_t element_count = 0;
  std::uint64_t triangle_count = 0;
  std::uint64_t owned_count = 0;
};
using OctantCounts = std::array<OctantCount, 8>;

/// Octants that become one child.
struct OctantGroup {
  unsigned octants = 0;  ///< Bit mask.
  OctantCount count;
  unsigned heaviest = 0;  ///< Names the child.
};

int distance(const OctantGroup& a, const OctantGroup& b) {
  int smallest = 3;
  for (unsigned i = 0; i < 8; ++i) {
    for (unsigned j = 0; j < 8; ++j) {
      if ((a.octants >> i & 1) != 0 && (b.octants >> j & 1) != 0) smallest = std::min(smallest, std::popcount(i ^ j));
    }
  }
  return smallest;
}

/// Joins octants until none is small beside the leaf size. `keeps_two`: stops at two for the sake of getting on.
std::vector<OctantGroup> octant_groups(const OctantCounts& counts, std::uint64_t leaf_vertex_count, bool has_triangles,
                                       bool keeps_two) {
  std::vector<OctantGroup> groups;
  for (unsigned i = 0; i < 8; ++i) {
    if (counts[i].element_count > 0) groups.push_back({1u << i, counts[i], i});
  }
  const auto join = [&](std::size_t a, std::size_t b) {
    OctantGroup& into = groups[std::min(a, b)];
    const OctantGroup& from = groups[std::max(a, b)];
    if (counts[from.heaviest].owned_count > counts[into.heaviest].owned_count) into.heaviest = from.heaviest;
    into.octants |= from.octants;
    into.count.element_count += from.count.element_count;
    into.count.triangle_count += from.count.triangle_count;
    into.count.owned_count += from.count.owned_count;
    groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(std::max(a, b)));
  };
  while (groups.size() > 1) {
    // Neighbours that fit into one leaf together, the lightest pair first.
    std::optional<std::tuple<std::uint64_t, std::size_t, std::size_t>> best;
    for (std::size_t a = 0; a < groups.size(); ++a) {
      for (std::size_t b = a + 1; b < groups.size(); ++b) {
        const std::uint64_t sum = groups[a].count.owned_count + groups[b].count.owned_count;
        if (sum > leaf_vertex_count || distance(groups[a], groups[b]) > 1) continue;
        if (!best || std::tuple(sum, a, b) < *best) best = {sum, a, b};
      }
    }
    if (best) {
      join(std::get<1>(*best), std::get<2>(*best));
      continue;
    }
    // A small one, with the nearest other.
    std::optional<std::pair<std::uint64_t, std::size_t>> smallest;
    for (std::size_t a = 0; a < groups.size(); ++a) {
      const bool is_bare = has_triangles && groups[a].count.triangle_count == 0;
      const bool is_small = 4 * groups[a].count.owned_count < leaf_vertex_count && !(keeps_two && groups.size() == 2);
      if (!is_bare && !is_small) continue;
      const std::pair candidate(groups[a].count.owned_count, a);
      if (!smallest || candidate < *smallest) smallest = candidate;
    }
    if (!smallest) break;
    const std::size_t a = smallest->second;
    std::optional<std::tuple<int, std::uint64_t, std::size_t>> nearest;
    for (std::size_t b = 0; b < groups.size(); ++b) {
      if (b == a) continue;
      const std::tuple candidate(distance(groups[a], groups[b]), groups[b].count.owned_count, b);
      if (!nearest || candidate < *nearest) nearest = candidate;
    }
    join(a, std::get<2>(*nearest));
  }
  return groups;
}

/// A cell on its way to being cut, and the pieces its range is worked on in.
struct CellCut {
  Cell cell;
  Bounds bounds;
  Halving halving;
  std::vector<OctantGroup> groups;
};
struct Chunk {
  std::size_t cut_index = 0;
  std::size_t begin = 0, end = 0;
  Bounds bounds;
  OctantCounts counts;
  std::array<std::size_t, 8> target{};
};

/// Finds halvings for all cells; those whose `groups` stay below two cannot be cut.
void choose_halvings(std::vector<CellCut>& cuts, std::vector<Chunk>& chunks, std::span<const CutElement> elements,
                     std::uint64_t leaf_vertex_count, bool has_triangles, WorkerPool& pool) {
  pool.for_each(chunks.size(), [&](std::size_t i) {
    Chunk& chunk = chunks[i];
    chunk.bounds = empty_bounds();
    for (std::size_t e = chunk.begin; e < chunk.end; ++e) include(chunk.bounds, elements[e].place);
  });
  for (CellCut& cut : cuts) cut.bounds = empty_bounds();
  for (const Chunk& chunk : chunks) {
    include(cuts[chunk.cut_index].bounds, chunk.bounds.min);
    include(cuts[chunk.cut_index].bounds, chunk.bounds.max);
  }
  for (const int attempt : {0, 1, 2}) {
    bool is_any_open = false;
    for (CellCut& cut : cuts) {
      if (cut.groups.size() > 1) continue;
      is_any_open = true;
      cut.halving = attempt == 1
                        ? halving_at_the_medians(elements.subspan(cut.cell.begin, cut.cell.end - cut.cell.begin))
                        : halving_in_the_middle(cut.bounds);
    }
    if (!is_any_open) return;
    pool.for_each(chunks.size(), [&](std::size_t i) {
      Chunk& chunk = chunks[i];
      const CellCut& cut = cuts[chunk.cut_index];
      if (cut.groups.size() > 1) return;
      chunk.counts = {};
      for (std::size_t e = chunk.begin; e < chunk.end; ++e) {
        OctantCount& count = chunk.counts[cut.halving.octant(elements[e].place)];
        ++count.element_count;
        if (elements[e].owned_corners != CutElement::kLoneVertex) ++count.triangle_count;
        count.owned_count += owned_vertex_count(elements[e]);
      }
    });
    std::vector<OctantCounts> sums(cuts.size());
    for (const Chunk& chunk : chunks) {
      for (unsigned octant = 0; octant < 8; ++octant) {
        OctantCount& sum = sums[chunk.cut_index][octant];
        sum.element_count += chunk.counts[octant].element_count;
        sum.triangle_count += chunk.counts[octant].triangle_count;
        sum.owned_count += chunk.counts[octant].owned_count;
      }
    }
    for (std::size_t c = 0; c < cuts.size(); ++c) {
      if (cuts[c].groups.size() > 1) continue;
      // Not all of them may become one again.
      const std::uint64_t most = std::min(leaf_vertex_count, cuts[c].cell.owned_count / 2);
      cuts[c].groups = octant_groups(sums[c], most, has_triangles, attempt == 2);
    }
  }
}

/// Moves the elements of the cut cells to their children's ranges and returns the children, in order.
std::vector<Cell> distribute(const std::vector<CellCut>& cuts, std::vector<Chunk>& chunks,
                             std::span<const CutElement> from, std::span<CutElement> to, WorkerPool& pool) {
  std::vector<Cell> children;
  std::vector<std::array<std::size_t, 8>> group_of_octant(cuts.size());
  std::vector<std::vector<std::size_t>> next_of_group(cuts.size());
  for (std::size_t c = 0; c < cuts.size(); ++c) {
    const CellCut& cut = cuts[c];
    std::size_t begin = cut.cell.begin;
    for (std::size_t g = 0; g < cut.groups.size() && cut.groups.size() > 1; ++g) {
      const OctantGroup& group = cut.groups[g];
      for (unsigned octant = 0; octant < 8; ++octant) {
        if ((group.octants >> octant & 1) != 0) group_of_octant[c][octant] = g;
      }
      const protocol::TileId& parent = cut.cell.id;
      const protocol::TileId id{static_cast<std::uint8_t>(parent.level + 1), 2 * parent.x + (group.heaviest & 1),
                                2 * parent.y + (group.heaviest >> 1 & 1), 2 * parent.z + (group.heaviest >> 2)};
      const std::size_t end = begin + static_cast<std::size_t>(group.count.element_count);
      children.push_back({id, begin, end, group.count.owned_count});
      next_of_group[c].push_back(begin);
      begin = end;
    }
  }
  for (Chunk& chunk : chunks) {
    if (next_of_group[chunk.cut_index].empty()) continue;
    for (unsigned octant = 0; octant < 8; ++octant) {
      const std::size_t group = group_of_octant[chunk.cut_index][octant];
      chunk.target[group] = next_of_group[chunk.cut_index][group];
    }
    for (unsigned octant = 0; octant < 8; ++octant) {
      next_of_group[chunk.cut_index][group_of_octant[chunk.cut_index][octant]] +=
          static_cast<std::size_t>(chunk.counts[octant].element_count);
    }
  }
  pool.for_each(chunks.size(), [&](std::size_t i) {
    Chunk& chunk = chunks[i];
    if (next_of_group[chunk.cut_index].empty()) return;
    const Halving& halving = cuts[chunk.cut_index].halving;
    const auto& groups = group_of_octant[chunk.cut_index];
    for (std::size_t e = chunk.begin; e < chunk.end; ++e) {
      to[chunk.target[groups[halving.octant(from[e].place)]]++] = from[e];
    }
  });
  return children;
}

/// Orders the elements of a leaf along a Morton curve through 16 x 16 x 16 cells of its box.
void sort_along_curve(std::span<CutElement> elements) {
  Bounds bounds = empty_bounds();
  for (const CutElement& element : elements) include(bounds, element.place);
  const auto low = coordinates(bounds.min), high = coordinates(bounds.max);
  std::array<double, 3> scale{};
  for (unsigned axis = 0; axis < 3; ++axis) {
    const double extent = high[axis] - low[axis];
    scale[axis] = extent > 0 ? 16 / extent : 0;
  }
  const auto cell_of = [&](const CutElement& element) {
    const auto p = coordinates(element.place);
    std::array<std::uint32_t, 3> cell{};
    for (unsigned axis = 0; axis < 3; ++axis) {
      const double position = (p[axis] - low[axis]) * scale[axis];
      cell[axis] = position > 0 ? static_cast<std::uint32_t>(std::min(position, 15.0)) : 0;
    }
    return static_cast<std::size_t>(morton_code(cell[0], cell[1], cell[2]));
  };
  std::vector<std::uint16_t> cells(elements.size());
  std::vector<std::uint32_t> next(4097);
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const std::size_t cell = cell_of(elements[i]);
    cells[i] = static_cast<std::uint16_t>(cell);
    ++next[cell + 1];
  }
  for (std::size_t cell = 0; cell < 4096; ++cell) next[cell + 1] += next[cell];
  const std::vector<CutElement> unsorted(elements.begin(), elements.end());
  for (std::size_t i = 0; i < unsorted.size(); ++i) elements[next[cells[i]]++] = unsorted[i];
}

}  // namespace

std::uint64_t morton_code(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  const auto spread = [](std::uint64_t v) {
    v &= 0x1fffff;
    v = (v | v << 32) & 0x1f00000000ffff;
    v = (v | v << 16) & 0x1f0000ff0000ff;
    v = (v | v << 8) & 0x100f00f00f00f00f;
    v = (v | v << 4) & 0x10c30c30c30c30c3;
    return (v | v << 2) & 0x1249249249249249;
  };
  return spread(x) | spread(y) << 1 | spread(z) << 2;
}

TemperatureRange TemperatureRange::joined(const TemperatureRange& other) const {
  // fmin and fmax prefer a number to NaN.
  return {std::fmin(lowest_celsius, other.lowest_celsius), std::fmax(highest_celsius, other.highest_celsius)};
}

TemperatureRange temperature_range(std::span<const float> temperature_celsius) {
  TemperatureRange range;
  for (const float t : temperature_celsius) {
    if (std::isnan(t)) continue;
    if (!(t >= range.lowest_celsius)) range.lowest_celsius = t;
    if (!(t <= range.highest_celsius)) range.highest_celsius = t;
  }
  return range;
}

Bounds bounds_of(std::span<const fusion::Vec3f> positions) {
  Bounds bounds = empty_bounds();
  for (const Vec3f& p : positions) include(bounds, p);
  return bounds;
}

OctreeCut octree_cut(const fusion::MultispectralMesh& mesh, std::uint32_t leaf_vertex_count, WorkerPool& pool,
                     std::uint32_t root_vertex_count) {
  OctreeCut result;
  result.elements[0] = cut_elements(mesh, pool);
  if (result.elements[0].empty()) return result;

  const auto is_leaf = [&](const Cell& cell) {
    if (cell.id.level == 0 && cell.owned_count > root_vertex_count) return false;
    return 4 * cell.owned_count <= 5 * std::uint64_t{leaf_vertex_count} || cell.id.level >= kDeepestLevel;
  };
  unsigned current = 0;
  // A leaf stays where it is: later levels write only to the ranges of cells that are cut.
  const auto keep = [&](const Cell& cell) {
    result.leaves.push_back({cell.id, std::span(result.elements[current]).subspan(cell.begin, cell.end - cell.begin)});
  };
  std::vector<Cell> cells{{{}, 0, result.elements[0].size(), mesh.vertex_count()}};
  if (is_leaf(cells[0])) {
    keep(cells[0]);
    return result;
  }
  result.elements[1].resize(result.elements[0].size());
  while (!cells.empty()) {
    std::vector<CellCut> cuts;
    std::vector<Chunk> chunks;
    for (const Cell& cell : cells) {
      for (std::size_t begin = cell.begin; begin < cell.end; begin += kChunkSize) {
        chunks.push_back({cuts.size(), begin, std::min(cell.end, begin + kChunkSize), {}, {}, {}});
      }
      cuts.push_back({cell, {}, {}, {}});
    }
    choose_halvings(cuts, chunks, result.elements[current], leaf_vertex_count, !mesh.is_point_cloud(), pool);
    for (const CellCut& cut : cuts) {
      if (cut.groups.size() < 2) keep(cut.cell);
    }
    const std::vector<Cell> children =
        distribute(cuts, chunks, result.elements[current], result.elements[1 - current], pool);
    current = 1 - current;
    cells.clear();
    for (const Cell& child : children) {
      if (is_leaf(child)) {
        keep(child);
      } else {
        cells.push_back(child);
      }
    }
  }
  std::sort(result.leaves.begin(), result.leaves.end(), [](const LeafCut& a, const LeafCut& b) {
    return std::pair(a.id.level, morton_code(a.id.x, a.id.y, a.id.z)) <
           std::pair(b.id.level, morton_code(b.id.x, b.id.y, b.id.z));
  });
  return result;
}

std::shared_ptr<Tile> leaf_tile(const fusion::MultispectralMesh& mesh, const LeafCut& leaf) {
  sort_along_curve(leaf.elements);
  auto tile = std::make_shared<Tile>();
  tile->id = leaf.id;

  std::size_t triangle_count = 0;
  std::size_t owned_count = 0;
  for (const CutElement& element : leaf.elements) {
    if (element.owned_corners != CutElement::kLoneVertex) ++triangle_count;
    owned_count += owned_vertex_count(element);
  }
  std::vector<std::uint32_t>& sources = tile->source_vertex;
  sources.reserve(owned_count);
  VertexIndexMap index_of(triangle_count == 0 ? 0 : owned_count + owned_count / 16);
  const std::vector<fusion::Triangle>& triangles = mesh.triangles();
  for (const CutElement& element : leaf.elements) {
    if (element.owned_corners == CutElement::kLoneVertex) continue;
    for (unsigned corner = 0; corner < 3; ++corner) {
      if ((element.owned_corners >> corner & 1) == 0) continue;
      const std::uint32_t vertex = triangles[element.index][corner];
      index_of.find_or_insert(vertex, static_cast<std::uint32_t>(sources.size()));
      sources.push_back(vertex);
    }
  }
  const std::size_t referenced_count = sources.size();
  for (const CutElement& element : leaf.elements) {
    if (element.owned_corners == CutElement::kLoneVertex) sources.push_back(element.index);
  }
  tile->owned_count = static_cast<std::uint32_t>(sources.size());
  tile->triangles.reserve(triangle_count);
  tile->source_triangle.reserve(triangle_count);
  for (const CutElement& element : leaf.elements) {
    if (element.owned_corners == CutElement::kLoneVertex) continue;
    fusion::Triangle triangle{};
    for (unsigned corner = 0; corner < 3; ++corner) {
      const std::uint32_t vertex = triangles[element.index][corner];
      const auto next = static_cast<std::uint32_t>(sources.size());
      triangle[corner] = index_of.find_or_insert(vertex, next);
      if (triangle[corner] == next) sources.push_back(vertex);
    }
    tile->triangles.push_back(triangle);
    tile->source_triangle.push_back(element.index);
  }
  sources.shrink_to_fit();

  const auto positions = mesh.positions();
  const auto visible = mesh.visible();
  const auto temperature = mesh.temperature_celsius();
  tile->positions.resize(sources.size());
  tile->visible.resize(sources.size());
  tile->temperature_celsius.resize(sources.size());
  for (std::size_t v = 0; v < sources.size(); ++v) {
    tile->positions[v] = positions[sources[v]];
    tile->visible[v] = visible[sources[v]];
    tile->temperature_celsius[v] = temperature[sources[v]];
  }
  tile->bounds = bounds_of(tile->positions);
  // The vertices that are drawn: all but the lone ones of a scene with triangles.
  const std::size_t lone_begin = triangle_count == 0 ? owned_count : referenced_count;
  const TemperatureRange range =
      temperature_range(std::span(tile->temperature_celsius).first(lone_begin))
          .joined(temperature_range(std::span(tile->temperature_celsius).subspan(owned_count)));
  tile->lowest_celsius = range.lowest_celsius;
  if (std::isnan(range.lowest_celsius)) tile->temperature_error_celsius = range.lowest_celsius;
  tile->highest_celsius = range.highest_celsius;
  return tile;
}

}  // namespace spectra::server
