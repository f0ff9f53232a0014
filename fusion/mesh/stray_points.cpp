#include "fusion/mesh/stray_points.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "fusion/mesh/disjoint_sets.hpp"

namespace spectra::mesh {

namespace {

/// A piece of so many vertices is a part of the scene, wherever it is.
constexpr std::uint64_t kPartVertices = 50;
/// Each round leaves out what is far at its scale; a far point may hide a less far one. Factors of 8 and more a round, so
/// that these are enough for all that a float can tell.
constexpr int kMostRounds = 64;
/// A triangle far away is a stray in a room of a few vertices, too.
constexpr std::uint64_t kFewVertices = 3;
/// What more than one in so many triangles stand up to is no spike but a spire or the tip of a cone.
constexpr std::uint64_t kSpikeShare = 10;
constexpr std::size_t kFewestCells = 8;
constexpr std::size_t kMostCells = 64;
constexpr std::uint32_t kNoPiece = std::numeric_limits<std::uint32_t>::max();

std::array<double, 3> coordinates(const base::Vec3f& p) {
  return {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
}

struct Box {
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  std::array<double, 3> low{kInfinity, kInfinity, kInfinity};
  std::array<double, 3> high{-kInfinity, -kInfinity, -kInfinity};

  void include(const std::array<double, 3>& p) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], p[axis]);
      high[axis] = std::max(high[axis], p[axis]);
    }
  }
  void include(const Box& other) {
    include(other.low);
    include(other.high);
  }
  double longest() const { return std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]}); }
  double diagonal() const { return std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]); }
  double distance(const Box& other) const {
    std::array<double, 3> gap{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      gap[axis] = std::max({0.0, other.low[axis] - high[axis], low[axis] - other.high[axis]});
    }
    return std::hypot(gap[0], gap[1], gap[2]);
  }
};

base::Bounds bounds_of(const Box& box) {
  const auto point = [](const std::array<double, 3>& p) {
    return base::Vec3f{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
  };
  return {point(box.low), point(box.high)};
}

/// Cubes over a box, at most kMostCells + 1 along an edge.
class Grid {
 public:
  Grid(const Box& box, std::size_t cell_count) : box_(box), cell_(box.longest() / static_cast<double>(cell_count)) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      count_[axis] = static_cast<std::size_t>((box.high[axis] - box.low[axis]) / cell_) + 1;
    }
  }

  double cell_m() const { return cell_; }
  std::size_t size() const { return count_[0] * count_[1] * count_[2]; }

  std::size_t cell_of(const base::Vec3f& position) const {
    const auto p = coordinates(position);
    std::size_t cell = 0;
    for (std::size_t axis = 3; axis-- > 0;) {
      const auto along = static_cast<std::size_t>((p[axis] - box_.low[axis]) / cell_);
      cell = cell * count_[axis] + std::min(along, count_[axis] - 1);
    }
    return cell;
  }

  /// Calls `visit` with every cell that touches `cell`, at a corner at least (and with `cell`).
  template <class Visit>
  void for_each_neighbour(std::size_t cell, Visit visit) const {
    const std::array<std::size_t, 3> at = {cell % count_[0], cell / count_[0] % count_[1],
                                           cell / count_[0] / count_[1]};
    std::array<std::size_t, 3> first{}, last{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      first[axis] = at[axis] > 0 ? at[axis] - 1 : 0;
      last[axis] = std::min(at[axis] + 1, count_[axis] - 1);
    }
    for (std::size_t z = first[2]; z <= last[2]; ++z) {
      for (std::size_t y = first[1]; y <= last[1]; ++y) {
        for (std::size_t x = first[0]; x <= last[0]; ++x) visit((z * count_[1] + y) * count_[0] + x);
      }
    }
  }

 private:
  Box box_;
  double cell_;
  std::array<std::size_t, 3> count_{};
};

/// What hangs together: points in cells that touch each other, and what triangles hold.
struct Piece {
  Box box;
  std::uint64_t vertex_count = 0;
  std::uint64_t spike_count = 0;  ///< Triangles of which it holds one corner, and the rest the others.
  std::uint32_t spike_foot = 0;   ///< The piece in which one of those stands.
  bool has_surface = false;

  void include(const Piece& other) {
    box.include(other.box);
    vertex_count += other.vertex_count;
    has_surface = has_surface || other.has_surface;
  }
};

class Search {
 public:
  Search(std::span<const base::Vec3f> positions, std::span<const base::Triangle> triangles)
      : positions_(positions),
        triangles_(triangles),
        count_limit_(std::max(std::min<std::uint64_t>(positions.size() / 10, kPartVertices + positions.size() / 1000),
                              positions.size() < 8 * kFewVertices ? 0 : kFewVertices)),
        cell_count_(std::clamp(static_cast<std::size_t>(std::sqrt(static_cast<double>(positions.size()))), kFewestCells,
                               kMostCells)) {}

  StrayPoints run() {
    for (int round = 0; count_limit_ > 0 && round < kMostRounds && leave_out(); ++round) {
    }
    StrayPoints result;
    if (positions_.empty()) return result;
    const Box core = box_of_kept();
    result.core = bounds_of(core);
    result.count = stray_count_;
    for (std::size_t v = 0; v < is_stray_.size(); ++v) {
      if (!is_stray_[v]) continue;
      Box point;
      point.include(coordinates(positions_[v]));
      result.farthest_m = std::max(result.farthest_m, core.distance(point));
    }
    return result;
  }

 private:
  bool is_kept(std::size_t vertex) const { return is_stray_.empty() || !is_stray_[vertex]; }

  Box box_of_kept() const {
    Box box;
    for (std::size_t v = 0; v < positions_.size(); ++v) {
      if (is_kept(v)) box.include(coordinates(positions_[v]));
    }
    return box;
  }

  /// One round at the scale of what is left; false when it found nothing more.
  bool leave_out() {
    const Box box = box_of_kept();
    if (!(box.longest() > 0)) return false;
    const Grid grid(box, cell_count_);
    const std::vector<std::uint32_t> piece_of_cell = connected_cells(grid);
    if (piece_count_ == 1) return false;
    std::vector<Piece> pieces(piece_count_);
    for (std::size_t v = 0; v < positions_.size(); ++v) {
      if (!is_kept(v)) continue;
      Piece& piece = pieces[piece_of_cell[grid.cell_of(positions_[v])]];
      piece.box.include(coordinates(positions_[v]));
      ++piece.vertex_count;
    }
    std::vector<bool> is_far = far_pieces(pieces, grid.cell_m());
    if (std::find(is_far.begin(), is_far.end(), true) == is_far.end()) return false;

    DisjointSets sets(pieces.size());
    for (const base::Triangle& triangle : triangles_) {
      if (!is_kept(triangle[0]) || !is_kept(triangle[1]) || !is_kept(triangle[2])) continue;
      std::array<std::uint32_t, 3> piece{};
      int far_count = 0;
      for (std::size_t corner = 0; corner < 3; ++corner) {
        piece[corner] = piece_of_cell[grid.cell_of(positions_[triangle[corner]])];
        pieces[piece[corner]].has_surface = true;
        far_count += is_far[piece[corner]] ? 1 : 0;
      }
      const bool is_spike = far_count == 1;
      if (is_spike) {
        for (std::size_t corner = 0; corner < 3; ++corner) {
          if (!is_far[piece[corner]]) continue;
          ++pieces[piece[corner]].spike_count;
          pieces[piece[corner]].spike_foot = piece[(corner + 1) % 3];
        }
        continue;
      }
      sets.unite(piece[0], piece[1]);
      sets.unite(piece[0], piece[2]);
    }
    for (std::uint32_t p = 0; p < pieces.size(); ++p) {
      if (pieces[p].spike_count * kSpikeShare > triangles_.size()) sets.unite(p, pieces[p].spike_foot);
    }
    for (std::uint32_t p = 0; p < pieces.size(); ++p) {
      if (sets.root(p) == p) continue;
      pieces[sets.root(p)].include(pieces[p]);
      pieces[p] = {};
    }
    is_far = far_pieces(pieces, grid.cell_m());
    std::uint64_t far_count = 0;
    for (std::size_t p = 0; p < pieces.size(); ++p) far_count += is_far[p] ? pieces[p].vertex_count : 0;
    if (far_count == 0 || stray_count_ + far_count > count_limit_) return false;

    stray_count_ += far_count;
    is_stray_.resize(positions_.size());
    for (std::size_t v = 0; v < positions_.size(); ++v) {
      if (is_kept(v) && is_far[sets.root(piece_of_cell[grid.cell_of(positions_[v])])]) is_stray_[v] = true;
    }
    return true;
  }

  /// Numbers the groups of occupied cells that touch each other; sets piece_count_.
  std::vector<std::uint32_t> connected_cells(const Grid& grid) {
    std::vector<bool> is_open(grid.size());  // occupied, and in no piece yet
    for (std::size_t v = 0; v < positions_.size(); ++v) {
      if (is_kept(v)) is_open[grid.cell_of(positions_[v])] = true;
    }
    std::vector<std::uint32_t> piece_of_cell(grid.size(), kNoPiece);
    std::vector<std::size_t> waiting;
    piece_count_ = 0;
    for (std::size_t first = 0; first < grid.size(); ++first) {
      if (!is_open[first]) continue;
      is_open[first] = false;
      waiting.push_back(first);
      while (!waiting.empty()) {
        const std::size_t cell = waiting.back();
        waiting.pop_back();
        piece_of_cell[cell] = piece_count_;
        grid.for_each_neighbour(cell, [&](std::size_t neighbour) {
          if (!is_open[neighbour]) return;
          is_open[neighbour] = false;
          waiting.push_back(neighbour);
        });
      }
      ++piece_count_;
    }
    return piece_of_cell;
  }

  /// The pieces that are small and farther from the rest than the rest is large. The rest begins with the heaviest piece and
  /// all that cannot be strays, and takes in what is near it.
  std::vector<bool> far_pieces(const std::vector<Piece>& pieces, double cell_m) const {
    const auto heaviest = std::max_element(
        pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) { return a.vertex_count < b.vertex_count; });
    const std::uint64_t tiny_share = positions_.size() / 2000;
    std::vector<bool> is_far(pieces.size());
    Box core = heaviest->box;
    for (std::size_t p = 0; p < pieces.size(); ++p) {
      const Piece& piece = pieces[p];
      if (piece.vertex_count == 0 || &piece == &*heaviest) continue;
      const double size = piece.box.diagonal();
      const double core_size = std::max(heaviest->box.diagonal(), cell_m);
      const bool is_few =
          piece.vertex_count < kPartVertices || size == 0 || (piece.vertex_count < tiny_share && size < core_size / 20);
      const bool is_large_surface = piece.has_surface && size >= core_size / 4;
      if (is_few && !is_large_surface && piece.vertex_count <= count_limit_) {
        is_far[p] = true;
      } else {
        core.include(piece.box);
      }
    }
    for (bool has_grown = true; has_grown;) {
      // Two passes make the diagonal longer by a factor of 1.4 at least, or nothing is taken in any more.
      const double reach = std::max(core.diagonal(), cell_m);
      has_grown = false;
      for (std::size_t p = 0; p < pieces.size(); ++p) {
        if (!is_far[p] || core.distance(pieces[p].box) > reach) continue;
        is_far[p] = false;
        core.include(pieces[p].box);
        has_grown = true;
      }
    }
    return is_far;
  }

  std::span<const base::Vec3f> positions_;
  std::span<const base::Triangle> triangles_;
  const std::uint64_t count_limit_;
  const std::size_t cell_count_;
  std::uint32_t piece_count_ = 0;
  std::uint64_t stray_count_ = 0;
  std::vector<bool> is_stray_;  ///< Empty while there is none.
};

}  // namespace

StrayPoints stray_points(std::span<const base::Vec3f> positions, std::span<const base::Triangle> triangles) {
  return Search(positions, triangles).run();
}

}  // namespace spectra::mesh
