#include "server/mapping/surface_mesh.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <boost/unordered/unordered_flat_map.hpp>
#include <cmath>

#include "server/mapping/cube_cases.hpp"

namespace spectra::mapping {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr int kEdge = kBlockEdge + 1;        ///< Voxels that the cells of a block need, each way.
constexpr int kUnitCorners = kUnitEdge + 1;  ///< The same of a unit.
constexpr base::Rgb8 kNoColour{128, 128, 128};
constexpr std::uint32_t kNoVertex = 0xffffffff;

/// The vertices of a unit by the edge of the grid that they lie on: of every voxel those along x, y and z. Kept from unit to unit, as it is
/// large, mostly empty, and emptied by going through what was put in.
struct VertexTable {
  std::vector<std::uint32_t> index =
      std::vector<std::uint32_t>(std::size_t{3} * kUnitCorners * kUnitCorners * kUnitCorners, kNoVertex);
  std::vector<std::uint32_t> used;  ///< Places in `index` that hold a vertex.

  std::uint32_t& of(std::size_t place, std::uint32_t next) {
    if (index[place] == kNoVertex) {
      index[place] = next;
      used.push_back(static_cast<std::uint32_t>(place));
    }
    return index[place];
  }
  void clear() {
    for (const std::uint32_t place : used) index[place] = kNoVertex;
    used.clear();
  }
};

/// 0 or 1 for each voxel of a row.
using RowFlags = std::array<std::uint16_t, kBlockEdge>;

/// The flags as bits: a product brings those of four voxels beside each other.
unsigned bits_of(const RowFlags& flags) {
  static_assert(std::endian::native == std::endian::little);
  constexpr std::uint64_t kBeside = 1ULL << 48 | 1ULL << 33 | 1ULL << 18 | 1ULL << 3;
  const auto halves = std::bit_cast<std::array<std::uint64_t, 2>>(flags);
  return static_cast<unsigned>((halves[0] * kBeside >> 48 & 0xf) | (halves[1] * kBeside >> 48 & 0xf) << 4);
}

/// Which voxels of a block, and of its neighbours as far as its cells need them, are known and which are inside: bits along x.
struct Neighbourhood {
  std::array<const VoxelBlock*, 8> voxels{};  ///< The block and those beyond, by bits of x, y, z; null: none.
  std::array<const HeatBlock*, 8> heat{};
  std::array<float, 8> certainty{};  ///< BlockHead::heat_certainty.
  std::array<std::uint16_t, kEdge * kEdge> known{}, inside{};

  /// The block, by its number in the eight, and the index within it of a voxel at 0..8 each.
  static std::pair<std::size_t, std::size_t> voxel(int x, int y, int z) {
    return {static_cast<std::size_t>(x >> 3 | (y >> 3) << 1 | (z >> 3) << 2), index_within({x, y, z}, 3)};
  }

  /// False: no surface can be in it.
  bool gather(std::uint16_t least_weight) {
    unsigned any = 0, all = 0x1ff;
    for (int row = 0; row < kEdge * kEdge; ++row) {
      const auto [which, first] = voxel(0, row % kEdge, row / kEdge);
      const VoxelBlock *block = voxels[which], *next = voxels[which | 1];
      unsigned is_known = 0, is_inside = 0;
      if (block != nullptr) {
        RowFlags are_inside, are_known;
        for (std::size_t x = 0; x < kBlockEdge; ++x) {
          are_inside[x] = block->distance[first + x] < 0 ? 1 : 0;
          are_known[x] = block->weight[first + x] >= least_weight ? 1 : 0;
        }
        is_inside = bits_of(are_inside);
        is_known = bits_of(are_known);
      }
      if (next != nullptr) {
        is_inside |= next->distance[first] < 0 ? 1U << kBlockEdge : 0;
        is_known |= next->weight[first] >= least_weight ? 1U << kBlockEdge : 0;
      }
      is_inside &= is_known;
      any |= is_inside;
      all &= is_inside;
      known[static_cast<std::size_t>(row)] = static_cast<std::uint16_t>(is_known);
      inside[static_cast<std::size_t>(row)] = static_cast<std::uint16_t>(is_inside);
    }
    return any != 0 && all != 0x1ff;
  }
};

class Mesher {
 public:
  Mesher(const VoxelMap& map, const MeshRules& rules, VertexTable& vertices)
      : map_(map),
        rules_(rules),
        least_weight_(static_cast<std::uint16_t>(std::clamp(std::ceil(rules.least_weight), 0.0F, kWeightMost))),
        vertices_(vertices) {}

  void add_unit(const MapUnit& unit) {
    for (int i = 0; i < 8; ++i) {
      const std::int32_t beyond = map_.find_unit({unit.at.x + (i & 1), unit.at.y + (i >> 1 & 1), unit.at.z + (i >> 2)});
      units_[static_cast<std::size_t>(i)] = beyond < 0 ? nullptr : &map_.units()[static_cast<std::size_t>(beyond)];
    }
    vertices_.clear();
    for (const std::int32_t block : unit.blocks) {
      if (block >= 0) add_block(block);
    }
  }

  UnitMesh take() { return std::move(mesh_); }
  /// Some vertices may be in no triangle.
  bool has_left_out() const { return has_left_out_; }

 private:
  void add_block(std::int32_t block) {
    base_ = map_.head(block).at;
    const GridPlace in_unit{base_.x & 3, base_.y & 3, base_.z & 3};
    bool may_be_inside = false, may_be_outside = false;
    for (int i = 0; i < 8; ++i) {
      const GridPlace at{in_unit.x + (i & 1), in_unit.y + (i >> 1 & 1), in_unit.z + (i >> 2)};
      const MapUnit* unit = units_[static_cast<std::size_t>(at.x >> 2 | (at.y >> 2) << 1 | (at.z >> 2) << 2)];
      const std::int32_t found = unit == nullptr ? -1 : unit->blocks[index_within(at, 2)];
      around_.voxels[static_cast<std::size_t>(i)] = found < 0 ? nullptr : &map_.voxels(found);
      around_.heat[static_cast<std::size_t>(i)] = found < 0 || map_.head(found).heat < 0 ? nullptr : &map_.heat(found);
      around_.certainty[static_cast<std::size_t>(i)] = found < 0 ? 1.0F : map_.head(found).heat_certainty();
      may_be_inside = may_be_inside || (found >= 0 && map_.head(found).has_inside);
      may_be_outside = may_be_outside || (found >= 0 && map_.head(found).has_outside);
    }
    if (!may_be_inside || !may_be_outside || !around_.gather(least_weight_)) return;
    origin_ = {in_unit.x * kBlockEdge, in_unit.y * kBlockEdge, in_unit.z * kBlockEdge};
    for (int z = 0; z < kBlockEdge; ++z) {
      for (int y = 0; y < kBlockEdge; ++y) add_cells(y, z);
    }
  }

  /// The cells of a row that the surface crosses.
  void add_cells(int y, int z) {
    const std::size_t row = static_cast<std::size_t>(y + kEdge * z);
    const std::array<std::size_t, 4> rows{row, row + 1, row + kEdge, row + kEdge + 1};
    unsigned known = 0x1ff, any = 0, all = 0x1ff;
    for (const std::size_t r : rows) {
      known &= around_.known[r];
      any |= around_.inside[r];
      all &= around_.inside[r];
    }
    unsigned crossed = (known & known >> 1) & (any | any >> 1) & ~(all & all >> 1) & 0xff;
    for (; crossed != 0; crossed &= crossed - 1) {
      const int x = std::countr_zero(crossed);
      unsigned corners = 0;
      for (std::size_t k = 0; k < 4; ++k) corners |= (around_.inside[rows[k]] >> x & 3U) << 2 * k;
      for (const auto& triangle : cases_[corners]) add_triangle(x, y, z, triangle);
    }
  }

  void add_triangle(int x, int y, int z, const std::array<std::uint8_t, 3>& edges) {
    base::Triangle corners{};
    for (std::size_t i = 0; i < 3; ++i) corners[i] = vertex(x, y, z, edges_[edges[i]]);
    // A surface through a voxel itself draws edges together.
    if (mesh_.positions[corners[0]] == mesh_.positions[corners[1]] ||
        mesh_.positions[corners[1]] == mesh_.positions[corners[2]] ||
        mesh_.positions[corners[2]] == mesh_.positions[corners[0]]) {
      has_left_out_ = true;
      return;
    }
    mesh_.triangles.push_back(corners);
  }

  /// The vertex on an edge of a cell.
  std::uint32_t vertex(int x, int y, int z, const CubeEdge& edge) {
    const GridPlace from{x + (edge.from & 1), y + (edge.from >> 1 & 1), z + (edge.from >> 2)};
    const int place = ((origin_.z + from.z) * kUnitCorners + origin_.y + from.y) * kUnitCorners + origin_.x + from.x;
    const auto next = static_cast<std::uint32_t>(mesh_.positions.size());
    const std::uint32_t index = vertices_.of(static_cast<std::size_t>(3 * place + edge.axis), next);
    if (index == next) make_vertex(from, edge);
    return index;
  }

  void make_vertex(GridPlace from, const CubeEdge& edge) {
    const auto place = [](std::int32_t block, int within) {
      return static_cast<std::uint64_t>(block * kBlockEdge + within) & 0x1fffff;
    };
    // Places that are 2^21 voxels apart never meet in a unit or beside it.
    mesh_.edges.push_back(static_cast<std::uint64_t>(edge.axis) << 62 ^
                          (place(base_.x, from.x) << 42 | place(base_.y, from.y) << 21 | place(base_.z, from.z)));
    const auto [block_a, voxel_a] = Neighbourhood::voxel(from.x, from.y, from.z);
    const auto [block_b, voxel_b] = Neighbourhood::voxel(
        from.x + (edge.axis == 0 ? 1 : 0), from.y + (edge.axis == 1 ? 1 : 0), from.z + (edge.axis == 2 ? 1 : 0));
    const VoxelBlock &a = *around_.voxels[block_a], &b = *around_.voxels[block_b];
    const double of_a = a.distance[voxel_a], of_b = b.distance[voxel_b];
    const double share = of_a / (of_a - of_b);
    const auto metres = [&](std::int32_t block, int within, bool is_along) {
      return static_cast<float>((static_cast<double>(block) * kBlockEdge + within + (is_along ? share : 0)) *
                                map_.voxel_m());
    };
    mesh_.positions.push_back({metres(base_.x, from.x, edge.axis == 0), metres(base_.y, from.y, edge.axis == 1),
                               metres(base_.z, from.z, edge.axis == 2)});
    add_colour(a, voxel_a, b, voxel_b, share);
    add_temperature(block_a, voxel_a, block_b, voxel_b, static_cast<float>(share));
  }

  void add_colour(const VoxelBlock& a, std::size_t voxel_a, const VoxelBlock& b, std::size_t voxel_b, double share) {
    const bool has_a = a.colour_weight[voxel_a] > 0, has_b = b.colour_weight[voxel_b] > 0;
    if (!has_a && !has_b) {
      mesh_.colours.push_back(kNoColour);
      return;
    }
    const double of_b = !has_a ? 1 : !has_b ? 0 : share;
    const auto level = [&](const auto& channel_a, const auto& channel_b) {
      const double mixed = (1 - of_b) * channel_a[voxel_a] + of_b * channel_b[voxel_b];
      return static_cast<std::uint8_t>(std::min(255.0, mixed / 256 + 0.5));
    };
    mesh_.colours.push_back({level(a.red, b.red), level(a.green, b.green), level(a.blue, b.blue)});
  }

  /// What a voxel knows of its temperature.
  struct Heat {
    float celsius = 0, variance = std::numeric_limits<float>::infinity(), own_variance = 0, seen_s = 0;
  };
  Heat heat_of(std::size_t block, std::size_t voxel) const {
    const HeatBlock* heat = around_.heat[block];
    if (heat == nullptr) return {};
    return {heat->celsius[voxel], heat->variance[voxel], heat->variance[voxel] * around_.certainty[block],
            heat->seen_s[voxel]};
  }

  void add_temperature(std::size_t block_a, std::size_t voxel_a, std::size_t block_b, std::size_t voxel_b,
                       float share) {
    const Heat a = heat_of(block_a, voxel_a), b = heat_of(block_b, voxel_b);
    // Never quite 0, so that a voxel that knows nothing leaves it to the other, however far that is.
    const float of_a = (1 - share + 1e-3F) / a.variance, of_b = (share + 1e-3F) / b.variance;
    const float sum = of_a + of_b;
    if (!(sum > 0)) {
      mesh_.celsius.push_back(kNaN);
      mesh_.sigma_kelvin.push_back(kNaN);
      mesh_.seen_s.push_back(kNaN);
      return;
    }
    mesh_.celsius.push_back((of_a * a.celsius + of_b * b.celsius) / sum);
    // The looks of both are the same looks: together they know no more than the mean of what each knows.
    const float mixed = std::isinf(a.variance)   ? b.own_variance
                        : std::isinf(b.variance) ? a.own_variance
                                                 : (of_a * a.own_variance + of_b * b.own_variance) / sum;
    mesh_.sigma_kelvin.push_back(std::sqrt(mixed + rules_.least_sigma_kelvin * rules_.least_sigma_kelvin));
    mesh_.seen_s.push_back(std::isinf(a.variance)   ? b.seen_s
                           : std::isinf(b.variance) ? a.seen_s
                                                    : std::max(a.seen_s, b.seen_s));
  }

  const VoxelMap& map_;
  const MeshRules& rules_;
  const std::uint16_t least_weight_;
  const std::array<CubeEdge, 12>& edges_ = cube_edges();
  const CubeCases& cases_ = cube_cases();
  VertexTable& vertices_;
  std::array<const MapUnit*, 8> units_{};  ///< The unit and those beyond, by bits of x, y, z; null: none.
  Neighbourhood around_;
  GridPlace base_;    ///< Of the block, in blocks.
  GridPlace origin_;  ///< Of the block within its unit, in voxels.
  UnitMesh mesh_;
  bool has_left_out_ = false;
};

/// Leaves out vertices that no triangle has: those of triangles without area.
void drop_unused(UnitMesh& mesh) {
  std::vector<std::uint32_t> place(mesh.positions.size(), 0);
  for (const base::Triangle& t : mesh.triangles) {
    for (const std::uint32_t v : t) place[v] = 1;
  }
  std::uint32_t next = 0;
  for (std::size_t i = 0; i < place.size(); ++i) {
    if (place[i] == 0) continue;
    mesh.positions[next] = mesh.positions[i];
    mesh.colours[next] = mesh.colours[i];
    mesh.celsius[next] = mesh.celsius[i];
    mesh.sigma_kelvin[next] = mesh.sigma_kelvin[i];
    mesh.seen_s[next] = mesh.seen_s[i];
    mesh.edges[next] = mesh.edges[i];
    place[i] = next++;
  }
  mesh.positions.resize(next);
  mesh.colours.resize(next);
  mesh.celsius.resize(next);
  mesh.sigma_kelvin.resize(next);
  mesh.seen_s.resize(next);
  mesh.edges.resize(next);
  for (base::Triangle& t : mesh.triangles) {
    for (std::uint32_t& v : t) v = place[v];
  }
}

}  // namespace

UnitMesh mesh_of_unit(const VoxelMap& map, std::int32_t unit, const MeshRules& rules) {
  thread_local VertexTable vertices;
  Mesher mesher(map, rules, vertices);
  mesher.add_unit(map.units()[static_cast<std::size_t>(unit)]);
  UnitMesh mesh = mesher.take();
  if (mesher.has_left_out()) drop_unused(mesh);
  return mesh;
}

UnitMesh joined(const std::vector<UnitMesh>& units) {
  UnitMesh all;
  boost::unordered_flat_map<std::uint64_t, std::uint32_t> vertices;
  std::vector<std::uint32_t> index;
  for (const UnitMesh& unit : units) {
    index.clear();
    for (std::size_t i = 0; i < unit.positions.size(); ++i) {
      const auto [entry, is_new] =
          vertices.try_emplace(unit.edges[i], static_cast<std::uint32_t>(all.positions.size()));
      index.push_back(entry->second);
      if (!is_new) continue;
      all.positions.push_back(unit.positions[i]);
      all.colours.push_back(unit.colours[i]);
      all.celsius.push_back(unit.celsius[i]);
      all.sigma_kelvin.push_back(unit.sigma_kelvin[i]);
      all.seen_s.push_back(unit.seen_s[i]);
      all.edges.push_back(unit.edges[i]);
    }
    for (const base::Triangle& t : unit.triangles) all.triangles.push_back({index[t[0]], index[t[1]], index[t[2]]});
  }
  return all;
}

}  // namespace spectra::mapping
