#include "server/mapping/surface_mesh.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <boost/unordered/unordered_flat_map.hpp>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "server/mapping/cube_cases.hpp"
#include "server/mapping/mesh_kernels.hpp"

namespace spectra::mapping {
namespace {

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

/// Which voxels of a block, and of its neighbours as far as its cells need them, are known and which are inside: bits along x.
struct Neighbourhood {
  std::array<const VoxelBlock*, 8> voxels{};  ///< The block and those beyond, by bits of x, y, z; null: none.
  std::array<const HeatBlock*, 8> heat{};
  std::array<float, 8> certainty{};        ///< BlockHead::heat_certainty.
  std::array<const BlockBits*, 8> bits{};  ///< All 0 where there is no block.
  std::array<std::uint16_t, kEdge * kEdge> known{}, inside{};

  /// The block, by its number in the eight, and the index within it of a voxel at 0..8 each.
  static std::pair<std::size_t, std::size_t> voxel(int x, int y, int z) {
    return {static_cast<std::size_t>(x >> 3 | (y >> 3) << 1 | (z >> 3) << 2), index_within({x, y, z}, 3)};
  }

  /// False: no surface can be in it.
  bool gather() {
    unsigned any = 0, all = 0x1ff;
    for (int z = 0; z < kEdge; ++z) {
      for (int y = 0; y < kEdge; ++y) {
        const auto which = static_cast<std::size_t>((y >> 3) << 1 | (z >> 3) << 2);
        const auto row = static_cast<std::size_t>((y & 7) | (z & 7) << 3);
        const BlockBits &block = *bits[which], &next = *bits[which | 1];
        const auto at = static_cast<std::size_t>(y + kEdge * z);
        known[at] = static_cast<std::uint16_t>(block.known[row] | (next.known[row] & 1U) << kBlockEdge);
        inside[at] = static_cast<std::uint16_t>(block.inside[row] | (next.inside[row] & 1U) << kBlockEdge);
        any |= inside[at];
        all &= inside[at];
      }
    }
    return any != 0 && all != 0x1ff;
  }
};

/// What meshing a unit needs room for, kept from unit to unit.
struct MeshingRoom {
  static constexpr int kBlocks = kUnitBlocks + 1;  ///< A unit and the blocks beyond, each way.
  VertexTable vertices;
  std::array<BlockBits, std::size_t{kBlocks} * kBlocks * kBlocks> bits;
  std::array<bool, std::size_t{kBlocks} * kBlocks * kBlocks> has_bits{};
  CrossedEdges edges{};
  UnitMesh mesh;
};

class Mesher {
 public:
  Mesher(const VoxelMap& map, const MeshRules& rules, MeshingRoom& room)
      : map_(map),
        rules_(rules),
        least_weight_(static_cast<std::uint16_t>(std::clamp(std::ceil(rules.least_weight), 0.0F, kWeightMost))),
        room_(room),
        mesh_(room.mesh) {
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      const int from = edges_[e].from;
      const int place = ((from >> 2) * kUnitCorners + (from >> 1 & 1)) * kUnitCorners + (from & 1);
      offsets_[e] = static_cast<std::size_t>(3 * place + edges_[e].axis);
    }
  }

  void add_unit(const MapUnit& unit) {
    for (int i = 0; i < 8; ++i) {
      const std::int32_t beyond = map_.find_unit({unit.at.x + (i & 1), unit.at.y + (i >> 1 & 1), unit.at.z + (i >> 2)});
      units_[static_cast<std::size_t>(i)] = beyond < 0 ? nullptr : &map_.units()[static_cast<std::size_t>(beyond)];
    }
    room_.vertices.clear();
    room_.has_bits.fill(false);
    mesh_.positions.clear();
    mesh_.colours.clear();
    for (auto* values : {&mesh_.celsius, &mesh_.sigma_kelvin, &mesh_.seen_s}) values->clear();
    mesh_.edges.clear();
    mesh_.triangles.clear();
    for (const std::int32_t block : unit.blocks) {
      if (block >= 0) add_block(block);
    }
  }

  /// Some vertices may be in no triangle.
  bool has_left_out() const { return has_left_out_; }

 private:
  void add_block(std::int32_t block) {
    base_ = map_.head(block).at;
    const GridPlace in_unit{base_.x & 3, base_.y & 3, base_.z & 3};
    bool may_be_inside = false, may_be_outside = false;
    std::array<std::int32_t, 8> found{};
    for (int i = 0; i < 8; ++i) {
      const GridPlace at{in_unit.x + (i & 1), in_unit.y + (i >> 1 & 1), in_unit.z + (i >> 2)};
      const MapUnit* unit = units_[static_cast<std::size_t>(at.x >> 2 | (at.y >> 2) << 1 | (at.z >> 2) << 2)];
      const std::int32_t index = unit == nullptr ? -1 : unit->blocks[index_within(at, 2)];
      found[static_cast<std::size_t>(i)] = index;
      may_be_inside = may_be_inside || (index >= 0 && map_.head(index).has_inside);
      may_be_outside = may_be_outside || (index >= 0 && map_.head(index).has_outside);
    }
    if (!may_be_inside || !may_be_outside) return;
    for (std::size_t i = 0; i < 8; ++i) {
      const std::int32_t index = found[i];
      const auto k = static_cast<int>(i);
      around_.voxels[i] = index < 0 ? nullptr : &map_.voxels(index);
      around_.heat[i] = index < 0 || map_.head(index).heat < 0 ? nullptr : &map_.heat(index);
      around_.certainty[i] = index < 0 ? 1.0F : map_.head(index).heat_certainty();
      around_.bits[i] =
          bits_of(around_.voxels[i], {in_unit.x + (k & 1), in_unit.y + (k >> 1 & 1), in_unit.z + (k >> 2)});
    }
    if (!around_.gather()) return;
    origin_ = {in_unit.x * kBlockEdge, in_unit.y * kBlockEdge, in_unit.z * kBlockEdge};
    room_.edges.count = 0;
    first_vertex_ = static_cast<std::uint32_t>(mesh_.edges.size());
    const std::size_t first_triangle = mesh_.triangles.size();
    for (int z = 0; z < kBlockEdge; ++z) {
      for (int y = 0; y < kBlockEdge; ++y) add_cells(y, z);
    }
    add_vertices();
    drop_narrow(first_triangle);
  }

  /// Those of a block, found once a unit; `at` in blocks of the unit.
  const BlockBits* bits_of(const VoxelBlock* block, GridPlace at) {
    static const BlockBits kNone{};
    if (block == nullptr) return &kNone;
    constexpr int kBlocks = MeshingRoom::kBlocks;
    const auto place = static_cast<std::size_t>((at.z * kBlocks + at.y) * kBlocks + at.x);
    if (!room_.has_bits[place]) {
      find_bits(*block, least_weight_, room_.bits[place]);
      room_.has_bits[place] = true;
    }
    return &room_.bits[place];
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
      const std::size_t cell =
          3 * static_cast<std::size_t>(((origin_.z + z) * kUnitCorners + origin_.y + y) * kUnitCorners + origin_.x + x);
      for (const auto& edges : cases_[corners]) {
        base::Triangle triangle{};
        for (std::size_t i = 0; i < 3; ++i) triangle[i] = vertex(cell, edges[i], x, y, z);
        mesh_.triangles.push_back(triangle);
      }
    }
  }

  /// The vertex on an edge of a cell.
  std::uint32_t vertex(std::size_t cell, std::size_t edge, int x, int y, int z) {
    CrossedEdges& crossed = room_.edges;
    const auto next = first_vertex_ + static_cast<std::uint32_t>(crossed.count);
    const std::uint32_t index = room_.vertices.of(cell + offsets_[edge], next);
    if (index == next) add_edge({x, y, z}, edges_[edge]);
    return index;
  }

  void add_edge(GridPlace cell, const CubeEdge& edge) {
    CrossedEdges& crossed = room_.edges;
    const GridPlace from{cell.x + (edge.from & 1), cell.y + (edge.from >> 1 & 1), cell.z + (edge.from >> 2)};
    const std::size_t i = crossed.count++;
    crossed.x[i] = base_.x * kBlockEdge + from.x;
    crossed.y[i] = base_.y * kBlockEdge + from.y;
    crossed.z[i] = base_.z * kBlockEdge + from.z;
    crossed.axis[i] = edge.axis;
    read_end(from, i, crossed.first);
    read_end({from.x + (edge.axis == 0 ? 1 : 0), from.y + (edge.axis == 1 ? 1 : 0), from.z + (edge.axis == 2 ? 1 : 0)},
             i, crossed.second);
  }

  void read_end(GridPlace voxel, std::size_t i, CrossedEdges::Ends& end) const {
    const auto [block, v] = Neighbourhood::voxel(voxel.x, voxel.y, voxel.z);
    const VoxelBlock& voxels = *around_.voxels[block];
    end.distance[i] = voxels.distance[v];
    end.colour_weight[i] = voxels.colour_weight[v];
    end.red[i] = voxels.red[v];
    end.green[i] = voxels.green[v];
    end.blue[i] = voxels.blue[v];
    const HeatBlock* heat = around_.heat[block];
    end.celsius[i] = heat == nullptr ? 0 : heat->celsius[v];
    end.variance[i] = heat == nullptr ? std::numeric_limits<float>::infinity() : heat->variance[v];
    end.own_variance[i] = heat == nullptr ? 0 : heat->variance[v] * around_.certainty[block];
    end.seen_s[i] = heat == nullptr ? 0 : heat->seen_s[v];
  }

  /// Those of the edges that were found in a block.
  void add_vertices() {
    CrossedEdges& crossed = room_.edges;
    find_vertices(crossed, map_.voxel_m(), rules_.least_sigma_kelvin);
    for (std::size_t i = 0; i < crossed.count; ++i) {
      // Places that are 2^21 voxels apart never meet in a unit or beside it.
      const auto place = [](std::int32_t voxel) { return static_cast<std::uint64_t>(voxel) & 0x1fffff; };
      mesh_.edges.push_back(static_cast<std::uint64_t>(crossed.axis[i]) << 62 ^
                            (place(crossed.x[i]) << 42 | place(crossed.y[i]) << 21 | place(crossed.z[i])));
      mesh_.positions.push_back({crossed.x_m[i], crossed.y_m[i], crossed.z_m[i]});
      const auto level = [](std::int32_t value) { return static_cast<std::uint8_t>(value); };
      mesh_.colours.push_back(crossed.red[i] < 0
                                  ? kNoColour
                                  : base::Rgb8{level(crossed.red[i]), level(crossed.green[i]), level(crossed.blue[i])});
    }
    const auto append = [&](const CrossedEdges::Array<float>& from, std::vector<float>& to) {
      to.insert(to.end(), from.begin(), from.begin() + static_cast<std::ptrdiff_t>(crossed.count));
    };
    append(crossed.celsius, mesh_.celsius);
    append(crossed.sigma_kelvin, mesh_.sigma_kelvin);
    append(crossed.seen_s, mesh_.seen_s);
  }

  /// A surface through a voxel itself draws edges together: takes out triangles without area, from one on.
  void drop_narrow(std::size_t first) {
    const auto is_narrow = [&](const base::Triangle& t) {
      const auto& at = mesh_.positions;
      return at[t[0]] == at[t[1]] || at[t[1]] == at[t[2]] || at[t[2]] == at[t[0]];
    };
    const auto kept =
        std::remove_if(mesh_.triangles.begin() + static_cast<std::ptrdiff_t>(first), mesh_.triangles.end(), is_narrow);
    has_left_out_ = has_left_out_ || kept != mesh_.triangles.end();
    mesh_.triangles.erase(kept, mesh_.triangles.end());
  }

  const VoxelMap& map_;
  const MeshRules& rules_;
  const std::uint16_t least_weight_;
  const std::array<CubeEdge, 12>& edges_ = cube_edges();
  const CubeCases& cases_ = cube_cases();
  std::array<std::size_t, 12> offsets_{};  ///< Of an edge of a cell, in VertexTable.
  MeshingRoom& room_;
  std::array<const MapUnit*, 8> units_{};  ///< The unit and those beyond, by bits of x, y, z; null: none.
  Neighbourhood around_;
  GridPlace base_;                  ///< Of the block, in blocks.
  GridPlace origin_;                ///< Of the block within its unit, in voxels.
  std::uint32_t first_vertex_ = 0;  ///< Of the block.
  UnitMesh& mesh_;
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

const UnitMesh& passing_mesh_of_unit(const VoxelMap& map, std::int32_t unit, const MeshRules& rules) {
  thread_local const auto room = std::make_unique<MeshingRoom>();
  Mesher mesher(map, rules, *room);
  mesher.add_unit(map.units()[static_cast<std::size_t>(unit)]);
  if (mesher.has_left_out()) drop_unused(room->mesh);
  return room->mesh;
}

UnitMesh mesh_of_unit(const VoxelMap& map, std::int32_t unit, const MeshRules& rules) {
  return passing_mesh_of_unit(map, unit, rules);
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
