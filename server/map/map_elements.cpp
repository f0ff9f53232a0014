#include "server/map/map_elements.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include "fusion/mesh/vertex_index_map.hpp"
#include "server/map/leaf_facts.hpp"

namespace spectra::map {
namespace {

using base::Triangle;
using base::Vec3f;

/// A vertex as its piece has it.
struct PieceVertex {
  const Piece* piece;
  std::uint32_t index;
};

std::array<double, 3> coordinates(const base::Vec3f& v) {
  return {double{v.x}, double{v.y}, double{v.z}};
}

base::Vec3f centroid(const Piece& piece, const base::Triangle& triangle) {
  const auto mean = [&](float base::Vec3f::*axis) {
    return static_cast<float>((double{piece.positions[triangle[0]].*axis} + double{piece.positions[triangle[1]].*axis} +
                               double{piece.positions[triangle[2]].*axis}) /
                              3);
  };
  return {mean(&base::Vec3f::x), mean(&base::Vec3f::y), mean(&base::Vec3f::z)};
}

/// Orders the elements of a leaf along a Morton curve through 16 x 16 x 16 cells of its box.
void sort_along_curve(std::span<Element> elements) {
  base::Bounds bounds = base::empty_bounds();
  for (const Element& element : elements) base::include(bounds, element.place);
  const auto low = coordinates(bounds.min), high = coordinates(bounds.max);
  std::array<double, 3> scale{};
  for (unsigned axis = 0; axis < 3; ++axis) {
    const double extent = high[axis] - low[axis];
    scale[axis] = extent > 0 ? 16 / extent : 0;
  }
  const auto cell_of = [&](const Element& element) {
    const auto p = coordinates(element.place);
    std::array<std::uint32_t, 3> cell{};
    for (unsigned axis = 0; axis < 3; ++axis) {
      const double position = (p[axis] - low[axis]) * scale[axis];
      cell[axis] = position > 0 ? static_cast<std::uint32_t>(std::min(position, 15.0)) : 0;
    }
    return static_cast<std::size_t>(base::morton_code(cell[0], cell[1], cell[2]));
  };
  std::vector<std::uint16_t> cells(elements.size());
  std::vector<std::uint32_t> next(4097);
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const std::size_t cell = cell_of(elements[i]);
    cells[i] = static_cast<std::uint16_t>(cell);
    ++next[cell + 1];
  }
  for (std::size_t cell = 0; cell < 4096; ++cell) next[cell + 1] += next[cell];
  const std::vector<Element> unsorted(elements.begin(), elements.end());
  for (std::size_t i = 0; i < unsorted.size(); ++i) elements[next[cells[i]]++] = unsorted[i];
}

/// In the order of names, as their blocks have them, triangles before vertices of none.
void put_in_order(std::vector<Element>& elements, const Pieces& pieces, const BlockLabels& labels) {
  struct Key {
    const std::string* name;
    bool is_lone;
    std::uint32_t source;
    Element element;
  };
  std::vector<Key> keys;
  keys.reserve(elements.size());
  PieceCursor piece_of(pieces);
  for (const Element& element : elements) {
    const Piece& its = piece_of(element);
    const std::uint32_t source =
        element.is_lone_vertex() ? its.source_of_vertex(element.index) : its.source_of_triangle(element.index);
    keys.push_back({&labels.at(block_of(its, element)).name, element.is_lone_vertex(), source, element});
  }
  std::sort(keys.begin(), keys.end(), [](const Key& a, const Key& b) {
    if (a.name != b.name) return *a.name < *b.name;
    return std::pair(a.is_lone, a.source) < std::pair(b.is_lone, b.source);
  });
  for (std::size_t i = 0; i < keys.size(); ++i) elements[i] = keys[i].element;
}

void copy_vertices(std::span<const PieceVertex> vertices, Tile& tile) {
  const std::size_t count = vertices.size();
  tile.positions.resize(count);
  tile.visible.resize(count);
  tile.temperature_celsius.resize(count);
  tile.source_vertex.resize(count);
  bool is_any_halved = false, is_of_one_block = true;
  if (count > 0) tile.block = vertices[0].piece->block_of_vertex(vertices[0].index);
  for (std::size_t v = 0; v < count; ++v) {
    const auto& [piece, index] = vertices[v];
    tile.positions[v] = piece->positions[index];
    tile.visible[v] = piece->visible[index];
    tile.temperature_celsius[v] = piece->temperature_celsius[index];
    tile.source_vertex[v] = piece->source_of_vertex(index);
    is_any_halved = is_any_halved || (!piece->step_halvings.empty() && piece->step_halvings[index] != StepHalvings{});
    is_of_one_block = is_of_one_block && piece->block_of_vertex(index) == tile.block;
  }
  if (is_any_halved) {
    tile.step_halvings.resize(count);
    for (std::size_t v = 0; v < count; ++v) {
      const auto& [piece, index] = vertices[v];
      if (!piece->step_halvings.empty()) tile.step_halvings[v] = piece->step_halvings[index];
    }
  }
  if (!is_of_one_block) {
    tile.vertex_block.resize(count);
    for (std::size_t v = 0; v < count; ++v) {
      tile.vertex_block[v] = vertices[v].piece->block_of_vertex(vertices[v].index);
    }
  }
}

void copy_confidence(std::span<const PieceVertex> vertices, Tile& tile) {
  const auto is_known = [](const PieceVertex& v) { return !std::isnan(v.piece->sigma_of_vertex(v.index)); };
  if (std::none_of(vertices.begin(), vertices.end(), is_known)) return;
  std::vector<double> times;
  times.reserve(vertices.size());
  tile.sigma_kelvin.reserve(vertices.size());
  for (const auto& [piece, index] : vertices) {
    tile.sigma_kelvin.push_back(piece->sigma_of_vertex(index));
    times.push_back(piece->look_of_vertex(index));
  }
  tile.looked_at = VertexTimes::of(times);
}

bool is_same(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

/// When vertices were seen, and what they are compared with.
void copy_memory(std::span<const PieceVertex> vertices, const BlockLabels& labels, Tile& tile) {
  BlockNumber last_block = 0;
  const BlockLabel* last = nullptr;
  const auto label_of = [&](const PieceVertex& vertex) -> const BlockLabel& {
    const BlockNumber block = vertex.piece->block_of_vertex(vertex.index);
    if (last == nullptr || block != last_block) last = &labels.at(block);
    last_block = block;
    return *last;
  };
  std::vector<double> times(vertices.size());
  for (std::size_t v = 0; v < vertices.size(); ++v) times[v] = label_of(vertices[v]).observed_at;
  tile.seen_at = VertexTimes::of(times);
  bool is_any_kept = false;
  for (std::size_t v = 0; v < vertices.size() && !is_any_kept; ++v) {
    const auto& [piece, index] = vertices[v];
    if (piece->baseline_celsius.empty()) continue;
    const double own_at = label_of(vertices[v]).baseline_at;
    is_any_kept = !is_same(double{piece->baseline_of_vertex(index)}, double{piece->temperature_celsius[index]}) ||
                  !is_same(piece->baseline_time_of_vertex(index, own_at), own_at);
  }
  if (!is_any_kept) return;
  tile.baseline_mark = labels.baseline_mark;
  tile.baseline_celsius.resize(vertices.size());
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const auto& [piece, index] = vertices[v];
    tile.baseline_celsius[v] = piece->baseline_of_vertex(index);
    times[v] = piece->baseline_time_of_vertex(index, label_of(vertices[v]).baseline_at);
  }
  tile.baseline_at = VertexTimes::of(times);
}

}  // namespace

BlockNumber block_of(const Piece& piece, const Element& element) {
  return element.is_lone_vertex() ? piece.block_of_vertex(element.index) : piece.block_of_triangle(element.index);
}

CellContent content_of(std::span<const Element> elements) {
  CellContent sum;
  for (const Element& element : elements) sum += element.content();
  return sum;
}

base::Bounds bounds_of(std::span<const Element> elements) {
  base::Bounds bounds = base::empty_bounds();
  for (const Element& element : elements) base::include(bounds, element.place);
  return bounds;
}

std::vector<Element> elements_of(const Piece& piece, std::uint32_t number, std::size_t owned_count,
                                 std::span<const std::uint32_t> triangle_order, const BlockLabels& labels) {
  BlockNumber last_block = piece.block;
  bool is_last_changing = !labels.at(last_block).is_settled;
  const auto is_changing = [&](BlockNumber block) {
    if (block != last_block) is_last_changing = !labels.at(block).is_settled;
    last_block = block;
    return is_last_changing ? 1u : 0u;
  };
  std::vector<Element> elements(piece.triangles.size());
  std::vector<bool> is_used(piece.positions.size());
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const std::uint32_t t = triangle_order.empty() ? static_cast<std::uint32_t>(i) : triangle_order[i];
    Element& element = elements[i];
    element.place = centroid(piece, piece.triangles[t]);
    element.index = t;
    element.piece = number & 0x7ffffffu;
    element.is_changing = is_changing(piece.block_of_triangle(t)) & 1u;
    for (unsigned corner = 0; corner < 3; ++corner) {
      const std::uint32_t v = piece.triangles[t][corner];
      auto used = is_used[v];
      if (!used && v < owned_count) element.owned_corners |= 1u << corner;
      used = true;
    }
  }
  for (std::uint32_t v = 0; v < owned_count; ++v) {
    if (is_used[v]) continue;
    Element& element = elements.emplace_back();
    element.place = piece.positions[v];
    element.index = v;
    element.piece = number & 0x7ffffffu;
    element.is_changing = is_changing(piece.block_of_vertex(v)) & 1u;
    element.owned_corners = Element::kLoneVertex;
  }
  return elements;
}

std::shared_ptr<Tile> leaf_tile(const protocol::TileId& id, std::vector<Element>& elements, const Pieces& pieces,
                                const BlockLabels& labels) {
  const bool is_of_one_new_piece =
      std::all_of(elements.begin(), elements.end(),
                  [&](const Element& element) { return element.piece == elements.front().piece; }) &&
      (elements.empty() || pieces[elements.front().piece].source_triangle.empty());
  if (!is_of_one_new_piece) put_in_order(elements, pieces, labels);
  sort_along_curve(elements);
  auto tile = std::make_shared<Tile>();
  tile->id = id;
  const CellContent content = content_of(elements);
  std::vector<PieceVertex> vertices;
  vertices.reserve(content.owned_count);
  mesh::VertexIndexMap index_of(content.triangle_count == 0 ? 0 : content.owned_count + content.owned_count / 16);
  const auto key_of = [](const Piece& its, std::uint32_t v) {
    return std::uint64_t{its.block_of_vertex(v)} << 32 | its.source_of_vertex(v);
  };
  PieceCursor piece_of(pieces);
  for (const Element& element : elements) {
    if (element.is_lone_vertex()) continue;
    const Piece& its = piece_of(element);
    for (unsigned corner = 0; corner < 3; ++corner) {
      if ((element.owned_corners >> corner & 1) == 0) continue;
      const std::uint32_t v = its.triangles[element.index][corner];
      index_of.find_or_insert(key_of(its, v), static_cast<std::uint32_t>(vertices.size()));
      vertices.push_back({&its, v});
    }
  }
  const std::size_t referenced_count = vertices.size();
  for (const Element& element : elements) {
    if (element.is_lone_vertex()) vertices.push_back({&piece_of(element), element.index});
  }
  tile->owned_count = static_cast<std::uint32_t>(vertices.size());
  tile->triangles.reserve(content.triangle_count);
  tile->source_triangle.reserve(content.triangle_count);
  for (const Element& element : elements) {
    if (element.is_lone_vertex()) continue;
    const Piece& its = piece_of(element);
    base::Triangle triangle{};
    for (unsigned corner = 0; corner < 3; ++corner) {
      const std::uint32_t v = its.triangles[element.index][corner];
      const auto next = static_cast<std::uint32_t>(vertices.size());
      triangle[corner] = index_of.find_or_insert(key_of(its, v), next);
      if (triangle[corner] == next) vertices.push_back({&its, v});
    }
    tile->triangles.push_back(triangle);
    tile->source_triangle.push_back(its.source_of_triangle(element.index));
  }
  copy_vertices(vertices, *tile);
  copy_memory(vertices, labels, *tile);
  copy_confidence(vertices, *tile);
  tile->bounds = bounds_of(std::span<const base::Vec3f>(tile->positions));
  // The vertices that are drawn: all but the lone ones of a scene with triangles.
  const std::size_t lone_begin = content.triangle_count == 0 ? tile->owned_count : referenced_count;
  const TemperatureRange range =
      temperature_range(std::span(tile->temperature_celsius).first(lone_begin))
          .joined(temperature_range(std::span(tile->temperature_celsius).subspan(tile->owned_count)));
  tile->lowest_celsius = range.lowest_celsius;
  if (std::isnan(range.lowest_celsius)) tile->temperature_error_celsius = range.lowest_celsius;
  tile->highest_celsius = range.highest_celsius;
  return tile;
}

}  // namespace spectra::map
