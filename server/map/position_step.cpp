#include "server/map/position_step.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "fusion/mesh/surface.hpp"
#include "server/map/position_shapes.hpp"

namespace spectra::map {

using namespace steps;

namespace {

/// Of what a side of a box measures. Each of its two ends is off by half a step at most, so that a tenth is on the safe side:
/// for pieces, and for what is so dense that the usual step halved would not keep it apart. Of other cells, which a patch is larger
/// than, a little more: what half the vertices of a scan pay for.
constexpr double kStepOfPieceSide = 0.1;
constexpr double kStepOfCellSide = 0.4;

/// How far the needs of a cell reach beyond it, in parts of its longest side. Those of what is much closer together than the usual
/// step reach to the next vertices; others to what the cell touches, and with one halving less to the next vertices.
constexpr double kReach = 0.2;
constexpr double kTouch = 0.05;

/// Pieces of more vertices are as many cells.
constexpr std::uint32_t kSmallPieceVertexCount = 256;

/// Pieces that touch others, sharing no vertices with them, have a form of their own from so many vertices on: triangles and what is
/// drawn of triangles that share none have not.
constexpr std::size_t kFewestOfTouching = 4;

/// A scene may be rounded finer everywhere for so many bits; by no more than a thousandth of the step.
constexpr std::size_t kNegligibleBits = 8 * 4096;
constexpr int kMostSpareHalvings = 10;

/// Up to `kSampleCount` lengths of what neighbours in a leaf: edges, or in a point cloud nearest vertices.
std::vector<double> neighbour_distances(const Tile& leaf) {
  constexpr std::size_t kSampleCount = 256;
  constexpr std::size_t kPointSampleCount = 16;
  std::vector<double> distances;
  const auto keep = [&](double squared) {
    if (squared > 0 && std::isfinite(squared)) distances.push_back(std::sqrt(squared));
  };
  if (!leaf.triangles.empty()) {
    const std::size_t stride = leaf.triangles.size() / kSampleCount + 1;
    for (std::size_t t = 0; t < leaf.triangles.size(); t += stride) {
      const base::Triangle& triangle = leaf.triangles[t];
      for (unsigned corner = 0; corner < 3; ++corner) {
        keep(mesh::squared_distance(leaf.positions[triangle[corner]], leaf.positions[triangle[(corner + 1) % 3]]));
      }
    }
    return distances;
  }
  const std::size_t stride = leaf.positions.size() / kPointSampleCount + 1;
  for (std::size_t v = 0; v < leaf.positions.size(); v += stride) {
    double nearest = 0;
    for (const base::Vec3f& other : leaf.positions) {
      const double squared = mesh::squared_distance(leaf.positions[v], other);
      if (squared > 0 && (nearest == 0 || squared < nearest)) nearest = squared;
    }
    keep(nearest);
  }
  return distances;
}

/// The power of two nearest to a quarter of the median distance between neighbours.
float usual_step_m(std::span<const std::shared_ptr<Tile>> leaves, jobs::WorkerPool& pool) {
  std::vector<std::vector<double>> of_leaf(leaves.size());
  pool.for_each(leaves.size(), [&](std::size_t i) { of_leaf[i] = neighbour_distances(*leaves[i]); });
  std::vector<double> distances;
  for (const auto& some : of_leaf) distances.insert(distances.end(), some.begin(), some.end());
  if (distances.empty()) return 0x1p-10F;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  const double exponent = std::round(std::log2(*middle / 4));
  return static_cast<float>(std::exp2(std::clamp(exponent, -90.0, 100.0)));
}

/// Vertices that count: in a scene with triangles those of a triangle.
std::vector<bool> drawn_vertices(const Tile& tile) {
  std::vector<bool> is_drawn(tile.positions.size(), tile.triangles.empty());
  for (const base::Triangle& triangle : tile.triangles) {
    for (const std::uint32_t v : triangle) is_drawn[v] = true;
  }
  return is_drawn;
}

/// Which vertices hang together.
class Pieces {
 public:
  explicit Pieces(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0u); }

  std::uint32_t of(std::uint32_t v) {
    while (parent_[v] != v) v = parent_[v] = parent_[parent_[v]];
    return v;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = of(a);
    b = of(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

}  // namespace

PositionSteps::PositionSteps(std::span<const std::shared_ptr<Tile>> leaves, jobs::WorkerPool& pool,
                             std::optional<float> largest_step_m, double largest_tile_m,
                             const std::function<void(double)>& found_share) {
  largest_step_m_ = largest_step_m.value_or(usual_step_m(leaves, pool));
  gather(leaves);
  if (points_.empty()) return;
  if (!largest_step_m) {
    const std::size_t spare = kNegligibleBits / (3 * points_.size());
    largest_step_m_ = std::ldexp(largest_step_m_, -static_cast<int>(std::min<std::size_t>(spare, kMostSpareHalvings)));
  }
  cut(pool);
  ask_cells(pool);
  ask_pieces(leaves);
  ask_neighbours(pool);
  most_halvings_ = kMostHalvings;
  const bool has_triangles =
      std::any_of(leaves.begin(), leaves.end(), [](const auto& leaf) { return !leaf->triangles.empty(); });
  if (has_triangles) limit_to_one_tile(largest_tile_m);
  keep_sides(pool, found_share);
  coincident_ = {};
  small_pieces_ = {};
}

void PositionSteps::gather(std::span<const std::shared_ptr<Tile>> leaves) {
  std::size_t count = 0;
  for (const auto& leaf : leaves) count += leaf->owned_count;
  points_.reserve(count);
  for (const auto& leaf : leaves) {
    const std::vector<bool> is_drawn = drawn_vertices(*leaf);
    for (std::uint32_t v = 0; v < leaf->owned_count; ++v) {
      if (is_drawn[v] && is_finite(leaf->positions[v])) points_.push_back({leaf->positions[v], leaf->source_vertex[v]});
    }
  }
}

void PositionSteps::ask_cells(jobs::WorkerPool& pool) {
  constexpr std::size_t kChunk = 64;
  const auto step_m = static_cast<double>(largest_step_m_);
  pool.for_each((cells_.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
    std::vector<base::Vec3f> positions;
    for (std::size_t c = chunk * kChunk; c < std::min(cells_.size(), (chunk + 1) * kChunk); ++c) {
      Cell& cell = cells_[c];
      positions.clear();
      for (std::uint32_t i = cell.begin; i < cell.end; ++i) positions.push_back(points_[i].position);
      const Shape shape(cell.bounds);
      const std::uint8_t apart = halvings_apart(positions, positions.size() / kVerticesToMerged, step_m);
      const double step_of_side = apart > 1 ? kStepOfPieceSide : kStepOfCellSide;
      cell.own = shape.within_precision(finer(shape.for_sides(step_of_side, step_m), {apart, apart, apart}), step_m);
      cell.is_dense = apart > 0;
    }
  });
}

void PositionSteps::ask_pieces(std::span<const std::shared_ptr<Tile>> leaves) {
  std::uint32_t source_count = 0;
  for (const Point& point : points_) source_count = std::max(source_count, point.source + 1);
  // Of coincident points one alone was kept, and triangles know the others.
  for (const auto& [kept, other] : coincident_) source_count = std::max({source_count, kept + 1, other + 1});
  bool has_triangles = false;
  Pieces pieces(source_count);
  for (const auto& leaf : leaves) {
    has_triangles = has_triangles || !leaf->triangles.empty();
    for (const base::Triangle& t : leaf->triangles) {
      const std::uint32_t first = leaf->source_vertex[t[0]];
      pieces.join(first, leaf->source_vertex[t[1]]);
      pieces.join(first, leaf->source_vertex[t[2]]);
    }
  }
  if (!has_triangles) return;
  std::vector<Member> members, alone;
  std::vector<std::uint32_t> cell_of(points_.size());
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    for (std::uint32_t i = cells_[c].begin; i < cells_[c].end; ++i) {
      members.push_back({points_[i].source, i});
      cell_of[i] = static_cast<std::uint32_t>(c);
    }
  }
  if (!coincident_.empty()) {
    std::vector<std::uint32_t> point_of(source_count);
    std::vector<bool> touches(source_count);
    for (const Member& member : members) point_of[member.piece] = member.point;
    alone = members;
    for (const auto& [kept, other] : coincident_) {
      alone.push_back({other, point_of[kept]});
      touches[pieces.of(kept)] = touches[pieces.of(other)] = true;
    }
    for (Member& member : alone) member.piece = pieces.of(member.piece);
    std::erase_if(alone, [&](const Member& member) { return !touches[member.piece]; });
    for (const auto& [a, b] : coincident_) pieces.join(a, b);
  }
  for (Member& member : members) member.piece = pieces.of(member.piece);
  ask_pieces_of(members, 1, source_count, cell_of);
  // Boxes that stand on each other are one piece, and each has its own form. Of single triangles none has.
  ask_pieces_of(alone, kFewestOfTouching, source_count, cell_of);
}

void PositionSteps::ask_pieces_of(std::span<const Member> members, std::size_t fewest, std::uint32_t piece_count,
                                  std::span<const std::uint32_t> cell_of) {
  constexpr auto kNone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> number_of(piece_count, kNone);
  struct Piece {
    base::Bounds bounds;
    std::uint32_t count = 0;
    StepHalvings halvings{};
    std::vector<std::uint32_t> points;  ///< Of a small one.
  };
  std::vector<Piece> all;
  for (const Member& member : members) {
    const base::Vec3f& p = points_[member.point].position;
    std::uint32_t& number = number_of[member.piece];
    if (number == kNone) {
      number = static_cast<std::uint32_t>(all.size());
      all.push_back({{p, p}, 0, {}, {}});
    }
    Piece& piece = all[number];
    base::include(piece.bounds, p);
    if (++piece.count <= kSmallPieceVertexCount) piece.points.push_back(member.point);
  }
  const auto step_m = static_cast<double>(largest_step_m_);
  bool is_any_fine = false;
  std::vector<base::Vec3f> positions;
  for (Piece& piece : all) {
    // A piece may have several vertices in one place.
    std::sort(piece.points.begin(), piece.points.end());
    piece.points.erase(std::unique(piece.points.begin(), piece.points.end()), piece.points.end());
    if (piece.points.size() < fewest) continue;
    const Shape shape(piece.bounds);
    piece.halvings = shape.for_sides(kStepOfPieceSide, step_m, kThinPiece);
    if (piece.count <= kSmallPieceVertexCount) {
      positions.clear();
      for (const std::uint32_t i : piece.points) positions.push_back(points_[i].position);
      const std::uint8_t apart = halvings_apart(positions, positions.size() / kVerticesToMerged, step_m);
      piece.halvings = finer(piece.halvings, {apart, apart, apart});
      small_pieces_.push_back(std::move(piece.points));
    }
    piece.halvings = shape.within_precision(piece.halvings, step_m);
    is_any_fine = is_any_fine || piece.halvings != StepHalvings{};
  }
  if (!is_any_fine) return;
  for (const Member& member : members) {
    StepHalvings& halvings = cells_[cell_of[member.point]].halvings;
    halvings = finer(halvings, all[number_of[member.piece]].halvings);
  }
}

void PositionSteps::keep_pieces_apart(std::vector<StepHalvings>& wanted, bool are_all_new) const {
  std::map<std::array<double, 3>, std::uint32_t> first_at;
  std::vector<std::uint32_t> merged;
  for (const std::vector<std::uint32_t>& piece : small_pieces_) {
    if (!are_all_new &&
        std::none_of(piece.begin(), piece.end(), [&](std::uint32_t p) { return wanted[p] != halvings_[p]; })) {
      continue;
    }
    for (bool is_finer = true; is_finer;) {
      is_finer = false;
      first_at.clear();
      merged.clear();
      std::size_t merged_count = 0;
      for (const std::uint32_t p : piece) {
        const auto [twin, is_new] = first_at.try_emplace(rounded_at(p, wanted[p]), p);
        if (is_new) continue;
        ++merged_count;
        merged.insert(merged.end(), {p, twin->second});
      }
      if (merged_count * kVerticesToMerged <= piece.size()) break;
      for (const std::uint32_t p : merged) {
        for (std::uint8_t& halvings : wanted[p]) {
          if (halvings >= most_halvings_) continue;
          ++halvings;
          is_finer = true;
        }
      }
    }
  }
}

std::array<double, 3> PositionSteps::rounded_at(std::uint32_t point, const StepHalvings& halvings) const {
  std::array<double, 3> rounded{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double step = std::ldexp(static_cast<double>(largest_step_m_), -halvings[axis]);
    rounded[axis] = std::floor(double{coordinates(points_[point].position)[axis]} / step + 0.5) * step;
  }
  return rounded;
}

void PositionSteps::ask_neighbours(jobs::WorkerPool& pool) {
  constexpr std::size_t kChunk = 64;
  for (Cell& cell : cells_) cell.halvings = finer(cell.halvings, cell.own);
  pool.for_each((cells_.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
    for (std::size_t c = chunk * kChunk; c < std::min(cells_.size(), (chunk + 1) * kChunk); ++c) {
      const Cell& cell = cells_[c];
      if (cell.own == StepHalvings{}) continue;
      const double longest = longest_side(cell.bounds);
      std::array<double, 3> low{}, high{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = double{coordinates(cell.bounds.min)[axis]} - longest * kReach;
        high[axis] = double{coordinates(cell.bounds.max)[axis]} + longest * kReach;
      }
      for_each_cell(low, high, [&](Cell& other) {
        double gap = 0;  // Along the axis on which they are farthest apart.
        for (std::size_t axis = 0; axis < 3; ++axis) {
          gap = std::max({gap, double{coordinates(other.bounds.min)[axis]} - double{coordinates(cell.bounds.max)[axis]},
                          double{coordinates(cell.bounds.min)[axis]} - double{coordinates(other.bounds.max)[axis]}});
        }
        if (gap > longest * kReach) return;
        const int fewer = cell.is_dense || gap <= longest * kTouch ? 0 : 1;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          raise(other.halvings[axis], static_cast<std::uint8_t>(std::max(0, cell.own[axis] - fewer)));
        }
      });
    }
  });
}

void PositionSteps::limit_to_one_tile(double largest_tile_m) {
  std::vector<base::Vec3f> corners;
  for (const Cell& cell : cells_) {
    corners.push_back(cell.bounds.min);
    corners.push_back(cell.bounds.max);
  }
  const double extent = std::min(longest_side(bounds_of(corners)), 2 * largest_tile_m);
  const double most = std::floor(std::log2(static_cast<double>(largest_step_m_) * 0x1.fffffcp23 / extent));
  // A triangle to a stray vertex coarsens the tiles that have it, no others.
  if (!(most >= 1 && most < kMostHalvings)) return;
  most_halvings_ = static_cast<std::uint8_t>(most);
  for (Cell& cell : cells_) {
    for (std::uint8_t& halvings : cell.halvings) {
      is_limited_ = is_limited_ || halvings > most_halvings_;
      halvings = std::min(halvings, most_halvings_);
    }
  }
}

std::uint32_t PositionSteps::point_at(const base::Vec3f& position) const {
  const auto p = coordinates(position);
  const Node* node = &nodes_[0];
  while (node->axis != kNoAxis) node = &nodes_[node->below + (p[node->axis] < node->split ? 0 : 1)];
  const Cell& cell = cells_[node->below];
  std::uint32_t i = cell.begin;
  while (i + 1 < cell.end && points_[i].position != position) ++i;
  return i;
}

void PositionSteps::apply(Tile& tile) const {
  tile.step_halvings.clear();
  if (cells_.empty() || tile.positions.empty()) return;
  const std::vector<bool> is_drawn = drawn_vertices(tile);
  std::vector<StepHalvings> halvings(tile.positions.size());
  bool is_any = false;
  for (std::size_t v = 0; v < halvings.size(); ++v) {
    if (!is_drawn[v]) continue;
    halvings[v] = halvings_[point_at(tile.positions[v])];
    is_any = is_any || halvings[v] != StepHalvings{};
  }
  if (is_any) tile.step_halvings = std::move(halvings);
}

}  // namespace spectra::map
