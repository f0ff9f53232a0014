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

/// The vertices of a unit by the edge of the grid that they lie on: of every voxel those along x, y and z. Kept from unit to unit, as it is
/// large and mostly empty.
class VertexTable {
 public:
  /// The vertex of a place; `next` where there is none yet.
  std::uint32_t of(std::size_t place, std::uint32_t next) {
    const std::uint32_t known = entries_[place], entry = known > begin_ ? known : begin_ + next + 1;
    entries_[place] = entry;
    end_ = std::max(end_, entry);
    return entry - begin_ - 1;
  }
  /// What is there counts no more.
  void clear() {
    begin_ = end_;
    if (begin_ < kLast) return;
    std::fill(entries_.begin(), entries_.end(), 0);
    begin_ = end_ = 0;
  }

 private:
  static constexpr std::uint32_t kLast = 0xf0000000;  ///< Far more than the vertices of a unit are left.
  std::vector<std::uint32_t> entries_ =
      std::vector<std::uint32_t>(std::size_t{3} * kUnitCorners * kUnitCorners * kUnitCorners, 0);
  std::uint32_t begin_ = 0, end_ = 0;  ///< Entries above begin_, up to end_, are vertices, by their number and 1.
};

/// The triangles of a cell, whose vertices are numbered in the order in which they come. Most cells have at most kUsualVertices and
/// kUsualTriangles; up to there the first ones stand in the place of those that are not, so that nothing depends on how many there are.
struct CellCase {
  static constexpr std::size_t kUsualVertices = 6, kUsualTriangles = 4;
  std::size_t vertex_count = 0, triangle_count = 0;
  std::array<std::uint8_t, 12> edges{};                     ///< Of each vertex.
  std::array<std::array<std::uint8_t, 3>, 12> triangles{};  ///< Vertices.
};

const std::array<CellCase, 256>& cell_cases() {
  static const std::array<CellCase, 256> cases = [] {
    std::array<CellCase, 256> all;
    for (std::size_t i = 0; i < all.size(); ++i) {
      CellCase& cell = all[i];
      for (const auto& triangle : cube_cases()[i]) {
        for (std::size_t k = 0; k < 3; ++k) {
          const auto end = cell.edges.begin() + static_cast<std::ptrdiff_t>(cell.vertex_count);
          const auto found = std::find(cell.edges.begin(), end, triangle[k]);
          if (found == end) cell.edges[cell.vertex_count++] = triangle[k];
          cell.triangles[cell.triangle_count][k] = static_cast<std::uint8_t>(found - cell.edges.begin());
        }
        ++cell.triangle_count;
      }
      std::fill(cell.edges.begin() + static_cast<std::ptrdiff_t>(cell.vertex_count), cell.edges.end(), cell.edges[0]);
    }
    return all;
  }();
  return cases;
}

/// A voxel at 0..8 each as one number, to which one more of an axis can be added.
constexpr std::size_t kAcross = 4;  ///< Bits an axis.
constexpr std::size_t voxel_code(std::size_t x, std::size_t y, std::size_t z) {
  return x | y << kAcross | z << 2 * kAcross;
}
/// The same of an edge from a voxel along an axis.
constexpr std::size_t edge_code(std::size_t voxel_code, std::size_t axis) {
  return voxel_code | axis << 3 * kAcross;
}
/// Of each voxel_code(): which of the eight blocks, and the index within it.
struct VoxelOfCode {
  std::uint16_t block = 0, index = 0;
};
constexpr std::array<VoxelOfCode, voxel_code(8, 8, 8) + 1> kVoxelOfCode = [] {
  std::array<VoxelOfCode, voxel_code(8, 8, 8) + 1> all{};
  for (std::size_t z = 0; z < kEdge; ++z) {
    for (std::size_t y = 0; y < kEdge; ++y) {
      for (std::size_t x = 0; x < kEdge; ++x) {
        all[voxel_code(x, y, z)] = {static_cast<std::uint16_t>(x >> 3 | (y >> 3) << 1 | (z >> 3) << 2),
                                    static_cast<std::uint16_t>((x & 7) | (y & 7) << 3 | (z & 7) << 6)};
      }
    }
  }
  return all;
}();

/// Of blocks without any.
const HeatBlock& no_heat() {
  static const std::unique_ptr<const HeatBlock> none = [] {
    auto block = std::make_unique<HeatBlock>();
    block->celsius.fill(0);
    block->variance.fill(std::numeric_limits<float>::infinity());
    block->seen_s.fill(0);
    return block;
  }();
  return *none;
}

/// Which voxels of a block, and of its neighbours as far as its cells need them, are known and which are inside: bits along x.
struct Neighbourhood {
  std::array<const VoxelBlock*, 8> voxels{};  ///< The block and those beyond, by bits of x, y, z; null: none.
  std::array<const HeatBlock*, 8> heat{};     ///< no_heat() where there is none.
  std::array<float, 8> certainty{};           ///< BlockHead::heat_certainty.
  std::array<const BlockBits*, 8> bits{};     ///< All 0 where there is no block.
  std::array<std::uint16_t, kEdge * kEdge> known{}, inside{};

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
  std::array<std::uint16_t, CrossedEdges::kRoom> places{};  ///< Of the edges of a block: edge_code().
  CrossedEdges edges{};
  std::size_t triangle_count = 0;  ///< Of a block, as the following.
  std::array<base::Triangle, kBlockVoxels * 12> triangles{};
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
      const std::size_t from = edges_[e].from;
      const std::size_t place = ((from >> 2) * kUnitCorners + (from >> 1 & 1)) * kUnitCorners + (from & 1);
      offsets_[e] = 3 * place + edges_[e].axis;
      codes_[e] = edge_code(voxel_code(from & 1, from >> 1 & 1, from >> 2), edges_[e].axis);
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
    has_one_on_voxel_ = false;
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
      around_.heat[i] = index < 0 || map_.head(index).heat < 0 ? &no_heat() : &map_.heat(index);
      around_.certainty[i] = index < 0 ? 1.0F : map_.head(index).heat_certainty();
      around_.bits[i] =
          bits_of(around_.voxels[i], {in_unit.x + (k & 1), in_unit.y + (k >> 1 & 1), in_unit.z + (k >> 2)});
    }
    if (!around_.gather()) return;
    origin_ = {in_unit.x * kBlockEdge, in_unit.y * kBlockEdge, in_unit.z * kBlockEdge};
    room_.edges.count = 0;
    first_vertex_ = static_cast<std::uint32_t>(mesh_.edges.size());
    room_.triangle_count = 0;
    for (int z = 0; z < kBlockEdge; ++z) {
      for (int y = 0; y < kBlockEdge; ++y) add_cells(y, z);
    }
    add_vertices();
    // A surface through a voxel itself draws edges together.
    if (has_one_on_voxel_) drop_narrow();
    mesh_.triangles.insert(mesh_.triangles.end(), room_.triangles.begin(), triangles_end());
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
      const std::size_t code =
          voxel_code(static_cast<std::size_t>(x), static_cast<std::size_t>(y), static_cast<std::size_t>(z));
      const CellCase& cut = cases_[corners];
      std::array<std::uint32_t, 12> vertices;
      const auto find_vertex = [&](std::size_t k) { vertices[k] = vertex(cell, code, cut.edges[k]); };
      for (std::size_t k = 0; k < CellCase::kUsualVertices; ++k) find_vertex(k);
      for (std::size_t k = CellCase::kUsualVertices; k < cut.vertex_count; ++k) find_vertex(k);
      base::Triangle* triangles = &room_.triangles[room_.triangle_count];
      const auto put = [&](std::size_t t) {
        const auto& corner = cut.triangles[t];
        triangles[t] = {vertices[corner[0]], vertices[corner[1]], vertices[corner[2]]};
      };
      for (std::size_t t = 0; t < CellCase::kUsualTriangles; ++t) put(t);
      for (std::size_t t = CellCase::kUsualTriangles; t < cut.triangle_count; ++t) put(t);
      room_.triangle_count += cut.triangle_count;
    }
  }

  /// The vertex on an edge of a cell.
  std::uint32_t vertex(std::size_t cell, std::size_t code, std::size_t edge) {
    std::size_t& count = room_.edges.count;
    const auto next = first_vertex_ + static_cast<std::uint32_t>(count);
    const std::uint32_t index = room_.vertices.of(cell + offsets_[edge], next);
    // Written over by the next one if it is not new.
    room_.places[count] = static_cast<std::uint16_t>(code + codes_[edge]);
    count += index == next ? 1 : 0;
    return index;
  }

  std::array<base::Triangle, kBlockVoxels * 12>::iterator triangles_end() {
    return room_.triangles.begin() + static_cast<std::ptrdiff_t>(room_.triangle_count);
  }

  /// What is known of the two voxels of each edge.
  void read_ends() {
    CrossedEdges& crossed = room_.edges;
    const auto read = [&](VoxelOfCode at, std::size_t i, CrossedEdges::Ends& end) {
      const VoxelBlock& voxels = *around_.voxels[at.block];
      end.distance[i] = voxels.distance[at.index];
      end.colour_weight[i] = voxels.colour_weight[at.index];
      end.red[i] = voxels.red[at.index];
      end.green[i] = voxels.green[at.index];
      end.blue[i] = voxels.blue[at.index];
      const HeatBlock& heat = *around_.heat[at.block];
      end.celsius[i] = heat.celsius[at.index];
      end.variance[i] = heat.variance[at.index];
      end.own_variance[i] = heat.variance[at.index] * around_.certainty[at.block];
      end.seen_s[i] = heat.seen_s[at.index];
    };
    for (std::size_t i = 0; i < crossed.count; ++i) {
      const std::size_t axis = room_.places[i] >> 3 * kAcross, code = room_.places[i] ^ edge_code(0, axis);
      constexpr std::size_t kMask = (std::size_t{1} << kAcross) - 1;
      crossed.x[i] = base_.x * kBlockEdge + static_cast<std::int32_t>(code & kMask);
      crossed.y[i] = base_.y * kBlockEdge + static_cast<std::int32_t>(code >> kAcross & kMask);
      crossed.z[i] = base_.z * kBlockEdge + static_cast<std::int32_t>(code >> 2 * kAcross);
      crossed.axis[i] = static_cast<std::int32_t>(axis);
      read(kVoxelOfCode[code], i, crossed.first);
      read(kVoxelOfCode[code + (std::size_t{1} << kAcross * axis)], i, crossed.second);
    }
  }

  /// Those of the edges that were found in a block.
  void add_vertices() {
    CrossedEdges& crossed = room_.edges;
    read_ends();
    find_vertices(crossed, map_.voxel_m(), rules_.least_sigma_kelvin);
    has_one_on_voxel_ = has_one_on_voxel_ || crossed.has_one_on_voxel;
    mesh_.edges.resize(first_vertex_ + crossed.count);
    mesh_.positions.resize(first_vertex_ + crossed.count);
    mesh_.colours.resize(first_vertex_ + crossed.count);
    for (std::size_t i = 0; i < crossed.count; ++i) {
      // Places that are 2^21 voxels apart never meet in a unit or beside it.
      const auto place = [](std::int32_t voxel) { return static_cast<std::uint64_t>(voxel) & 0x1fffff; };
      mesh_.edges[first_vertex_ + i] = static_cast<std::uint64_t>(crossed.axis[i]) << 62 ^
                                       (place(crossed.x[i]) << 42 | place(crossed.y[i]) << 21 | place(crossed.z[i]));
      mesh_.positions[first_vertex_ + i] = {crossed.x_m[i], crossed.y_m[i], crossed.z_m[i]};
      const auto level = [](std::int32_t value) { return static_cast<std::uint8_t>(value); };
      mesh_.colours[first_vertex_ + i] =
          crossed.red[i] < 0 ? kNoColour
                             : base::Rgb8{level(crossed.red[i]), level(crossed.green[i]), level(crossed.blue[i])};
    }
    const auto append = [&](const CrossedEdges::Array<float>& from, std::vector<float>& to) {
      to.insert(to.end(), from.begin(), from.begin() + static_cast<std::ptrdiff_t>(crossed.count));
    };
    append(crossed.celsius, mesh_.celsius);
    append(crossed.sigma_kelvin, mesh_.sigma_kelvin);
    append(crossed.seen_s, mesh_.seen_s);
  }

  /// Takes out triangles of the block without area.
  void drop_narrow() {
    const auto kept = std::remove_if(room_.triangles.begin(), triangles_end(), [&](const base::Triangle& t) {
      const auto& at = mesh_.positions;
      return at[t[0]] == at[t[1]] || at[t[1]] == at[t[2]] || at[t[2]] == at[t[0]];
    });
    has_left_out_ = has_left_out_ || kept != triangles_end();
    room_.triangle_count = static_cast<std::size_t>(kept - room_.triangles.begin());
  }

  const VoxelMap& map_;
  const MeshRules& rules_;
  const std::uint16_t least_weight_;
  const std::array<CubeEdge, 12>& edges_ = cube_edges();
  const std::array<CellCase, 256>& cases_ = cell_cases();
  std::array<std::size_t, 12> offsets_{};  ///< Of an edge of a cell, in VertexTable.
  std::array<std::size_t, 12> codes_{};    ///< voxel_code() of its first voxel, from the cell's on.
  MeshingRoom& room_;
  std::array<const MapUnit*, 8> units_{};  ///< The unit and those beyond, by bits of x, y, z; null: none.
  Neighbourhood around_;
  GridPlace base_;                  ///< Of the block, in blocks.
  GridPlace origin_;                ///< Of the block within its unit, in voxels.
  std::uint32_t first_vertex_ = 0;  ///< Of the block.
  UnitMesh& mesh_;
  bool has_one_on_voxel_ = false;  ///< Some vertex of the unit so far may be where a voxel is.
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
