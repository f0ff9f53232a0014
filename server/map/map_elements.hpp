#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "fusion/base/box.hpp"
#include "fusion/base/vertex_types.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"
#include "server/map/cell_content.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::map {

/// Where elements come from: a block that is put in, or a leaf of the version before.
struct Piece {
  std::span<const base::Vec3f> positions;
  std::span<const base::Rgb8> visible;
  std::span<const float> temperature_celsius;
  std::span<const StepHalvings> step_halvings;  ///< Empty: none are halved.
  std::span<const base::Triangle> triangles;
  std::span<const std::uint32_t> source_vertex;    ///< In the block; empty: the same number.
  std::span<const std::uint32_t> source_triangle;  ///< The same.
  std::span<const BlockNumber> vertex_block;       ///< Empty: all are of `block`.
  BlockNumber block = 0;
  /// What the vertices are compared with; empty: with themselves. The times are in one of the other two.
  std::span<const float> baseline_celsius;
  std::span<const double> baseline_at;
  const VertexTimes* baseline_times = nullptr;
  /// How sure the temperatures are, and when they were looked at, in one of the other two; empty: not known.
  std::span<const float> sigma_kelvin;
  std::span<const double> looked_at;
  const VertexTimes* looked_times = nullptr;

  std::uint32_t source_of_vertex(std::uint32_t v) const { return source_vertex.empty() ? v : source_vertex[v]; }
  std::uint32_t source_of_triangle(std::uint32_t t) const { return source_triangle.empty() ? t : source_triangle[t]; }
  BlockNumber block_of_vertex(std::uint32_t v) const { return vertex_block.empty() ? block : vertex_block[v]; }
  float baseline_of_vertex(std::uint32_t v) const {
    return baseline_celsius.empty() ? temperature_celsius[v] : baseline_celsius[v];
  }
  double baseline_time_of_vertex(std::uint32_t v, double own) const {
    if (baseline_celsius.empty()) return own;
    return baseline_times ? baseline_times->at(v) : baseline_at[v];
  }
  float sigma_of_vertex(std::uint32_t v) const {
    return sigma_kelvin.empty() ? std::numeric_limits<float>::quiet_NaN() : sigma_kelvin[v];
  }
  double look_of_vertex(std::uint32_t v) const {
    if (sigma_kelvin.empty()) return kUnknownTime;
    return looked_times ? looked_times->at(v) : looked_at[v];
  }
  BlockNumber block_of_triangle(std::uint32_t t) const { return block_of_vertex(triangles[t][0]); }
};

/// The pieces of one change, by number. Thread-safe; a piece stays where it is.
class Pieces {
 public:
  std::uint32_t add(const Piece& piece) {
    const std::lock_guard lock(mutex_);
    pieces_.push_back(piece);
    return static_cast<std::uint32_t>(pieces_.size() - 1);
  }
  const Piece& operator[](std::uint32_t number) const {
    const std::lock_guard lock(mutex_);
    return pieces_[number];
  }

 private:
  mutable std::mutex mutex_;
  std::deque<Piece> pieces_;
};

/// What lies in cells: a triangle (at its centroid), or a vertex of no triangle.
struct Element {
  base::Vec3f place;
  std::uint32_t index = 0;  ///< In its piece, of the triangle or the vertex.
  std::uint32_t piece : 27 = 0;
  std::uint32_t is_changing : 1 = 0;  ///< Of a block that is not settled.
  /// Bit k: corner k is the first in its block to use its vertex, which is therefore owned where this triangle is.
  /// kLoneVertex: the element is a vertex.
  std::uint32_t owned_corners : 4 = 0;

  static constexpr std::uint32_t kLoneVertex = 8;

  bool is_lone_vertex() const { return owned_corners == kLoneVertex; }
  CellContent content() const {
    // A lone vertex has one bit, too.
    return {is_lone_vertex() ? 0u : 1u, static_cast<std::uint64_t>(std::popcount(std::uint32_t{owned_corners})),
            is_changing};
  }
};

/// Gives the pieces of elements one after the other; neighbours in a list mostly have the same.
class PieceCursor {
 public:
  explicit PieceCursor(const Pieces& pieces) : pieces_(pieces) {}

  const Piece& operator()(const Element& element) {
    if (last_ == nullptr || element.piece != last_number_) {
      last_number_ = element.piece;
      last_ = &pieces_[last_number_];
    }
    return *last_;
  }

 private:
  const Pieces& pieces_;
  std::uint32_t last_number_ = 0;
  const Piece* last_ = nullptr;
};

BlockNumber block_of(const Piece& piece, const Element& element);
CellContent content_of(std::span<const Element> elements);
/// Of their places.
base::Bounds bounds_of(std::span<const Element> elements);

/// The elements of a piece. `triangle_order`: its triangles in an order in which those of each block ascend; empty: as they are.
/// Vertices from `owned_count` on are owned elsewhere.
std::vector<Element> elements_of(const Piece& piece, std::uint32_t number, std::size_t owned_count,
                                 std::span<const std::uint32_t> triangle_order, const BlockLabels& labels);

/// Copies a leaf out of its pieces, its elements along a space-filling curve. They are put in the order of the names of their blocks before, in each as the
/// block has them, triangles before vertices of none: the same tile in whatever order they came. Thread-safe for different elements.
std::shared_ptr<Tile> leaf_tile(const protocol::TileId& id, std::vector<Element>& elements, const Pieces& pieces,
                                const BlockLabels& labels);

}  // namespace spectra::map
