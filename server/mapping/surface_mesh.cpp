#include "server/mapping/surface_mesh.hpp"

#include <algorithm>
#include <array>
#include <boost/unordered/unordered_flat_map.hpp>
#include <cmath>

#include "server/mapping/cube_cases.hpp"

namespace spectra::mapping {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr int kEdge = kBlockEdge + 1;  ///< Voxels that the cells of a block need, each way.
constexpr std::size_t kCells = std::size_t{kEdge} * kEdge * kEdge;
constexpr base::Rgb8 kNoColour{128, 128, 128};

/// The voxels of a block and those of its neighbours that its cells need.
struct Neighbourhood {
  std::array<std::int32_t, 8> blocks;  ///< The block and those beyond, by bits of x, y, z; -1: none.
  std::array<float, kCells> distance;
  std::array<bool, kCells> is_known;

  static std::size_t at(int x, int y, int z) {
    return static_cast<std::size_t>(x) +
           static_cast<std::size_t>(kEdge) *
               (static_cast<std::size_t>(y) + static_cast<std::size_t>(kEdge) * static_cast<std::size_t>(z));
  }

  /// The block and the index within it of a voxel at 0..8 each.
  std::pair<std::int32_t, std::size_t> voxel(int x, int y, int z) const {
    const std::size_t which = static_cast<std::size_t>(x >> 3 | (y >> 3) << 1 | (z >> 3) << 2);
    return {blocks[which], index_within({x, y, z}, 3)};
  }

  bool gather(const VoxelMap& map, std::int32_t block, float least_weight) {
    const GridPlace at_block = map.head(block).at;
    for (int i = 0; i < 8; ++i) {
      blocks[static_cast<std::size_t>(i)] =
          i == 0 ? block : map.find({at_block.x + (i & 1), at_block.y + (i >> 1 & 1), at_block.z + (i >> 2)});
    }
    bool has_inside = false, has_outside = false;
    for (int z = 0; z < kEdge; ++z) {
      for (int y = 0; y < kEdge; ++y) {
        for (int x = 0; x < kEdge; ++x) {
          const auto [from, index] = voxel(x, y, z);
          const std::size_t to = at(x, y, z);
          is_known[to] = from >= 0 && static_cast<float>(map.voxels(from).weight[index]) >= least_weight;
          distance[to] = is_known[to] ? static_cast<float>(map.voxels(from).distance[index]) : 0;
          (distance[to] < 0 ? has_inside : has_outside) = true;
        }
      }
    }
    return has_inside && has_outside;
  }
};

class Mesher {
 public:
  Mesher(const VoxelMap& map, const MeshRules& rules) : map_(map), rules_(rules) {}

  void add_block(std::int32_t block) {
    if (!around_.gather(map_, block, rules_.least_weight)) return;
    base_ = map_.head(block).at;
    for (int z = 0; z < kBlockEdge; ++z) {
      for (int y = 0; y < kBlockEdge; ++y) {
        for (int x = 0; x < kBlockEdge; ++x) add_cell(x, y, z);
      }
    }
  }

  UnitMesh take() { return std::move(mesh_); }

 private:
  void add_cell(int x, int y, int z) {
    unsigned inside = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const std::size_t at = Neighbourhood::at(x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2));
      if (!around_.is_known[at]) return;
      inside |= around_.distance[at] < 0 ? 1U << corner : 0U;
    }
    for (const auto& triangle : cube_triangles(static_cast<std::uint8_t>(inside))) {
      base::Triangle corners{};
      for (std::size_t i = 0; i < 3; ++i) corners[i] = vertex(x, y, z, cube_edges()[triangle[i]]);
      // A surface through a voxel itself draws edges together.
      if (mesh_.positions[corners[0]] == mesh_.positions[corners[1]] ||
          mesh_.positions[corners[1]] == mesh_.positions[corners[2]] ||
          mesh_.positions[corners[2]] == mesh_.positions[corners[0]]) {
        continue;
      }
      mesh_.triangles.push_back(corners);
    }
  }

  /// The vertex on an edge of a cell.
  std::uint32_t vertex(int x, int y, int z, const CubeEdge& edge) {
    const int fx = x + (edge.from & 1), fy = y + (edge.from >> 1 & 1), fz = z + (edge.from >> 2);
    const auto place = [](std::int32_t block, int within) {
      return static_cast<std::uint64_t>(block * kBlockEdge + within) & 0x1fffff;
    };
    // Places that are 2^21 voxels apart never meet in a unit or beside it.
    const std::uint64_t key = static_cast<std::uint64_t>(edge.axis) << 62 ^
                              (place(base_.x, fx) << 42 | place(base_.y, fy) << 21 | place(base_.z, fz));
    const auto [entry, is_new] = vertices_.try_emplace(key, static_cast<std::uint32_t>(mesh_.positions.size()));
    if (is_new) make_vertex({fx, fy, fz}, edge, key);
    return entry->second;
  }

  void make_vertex(GridPlace from, const CubeEdge& edge, std::uint64_t key) {
    const GridPlace to{from.x + (edge.axis == 0 ? 1 : 0), from.y + (edge.axis == 1 ? 1 : 0),
                       from.z + (edge.axis == 2 ? 1 : 0)};
    const float a = around_.distance[Neighbourhood::at(from.x, from.y, from.z)],
                b = around_.distance[Neighbourhood::at(to.x, to.y, to.z)];
    const double share = static_cast<double>(a) / (static_cast<double>(a) - static_cast<double>(b));
    const auto metres = [&](std::int32_t block, int within, bool is_along) {
      return static_cast<float>((static_cast<double>(block) * kBlockEdge + within + (is_along ? share : 0)) *
                                map_.voxel_m());
    };
    mesh_.positions.push_back({metres(base_.x, from.x, edge.axis == 0), metres(base_.y, from.y, edge.axis == 1),
                               metres(base_.z, from.z, edge.axis == 2)});
    mesh_.edges.push_back(key);
    const auto [block_a, voxel_a] = around_.voxel(from.x, from.y, from.z);
    const auto [block_b, voxel_b] = around_.voxel(to.x, to.y, to.z);
    add_colour(block_a, voxel_a, block_b, voxel_b, share);
    add_temperature(block_a, voxel_a, block_b, voxel_b, static_cast<float>(share));
  }

  void add_colour(std::int32_t block_a, std::size_t voxel_a, std::int32_t block_b, std::size_t voxel_b, double share) {
    const VoxelBlock &a = map_.voxels(block_a), &b = map_.voxels(block_b);
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
    float celsius = 0, variance = std::numeric_limits<float>::infinity(), seen_s = 0;
  };
  Heat heat_of(std::int32_t block, std::size_t voxel) const {
    if (map_.head(block).heat < 0) return {};
    const HeatBlock& heat = map_.heat(block);
    return {heat.celsius[voxel], heat.variance[voxel], heat.seen_s[voxel]};
  }

  void add_temperature(std::int32_t block_a, std::size_t voxel_a, std::int32_t block_b, std::size_t voxel_b,
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
    const float mixed = std::isinf(a.variance)   ? b.variance
                        : std::isinf(b.variance) ? a.variance
                                                 : (of_a * a.variance + of_b * b.variance) / sum;
    mesh_.sigma_kelvin.push_back(std::sqrt(mixed + rules_.least_sigma_kelvin * rules_.least_sigma_kelvin));
    mesh_.seen_s.push_back(std::isinf(a.variance)   ? b.seen_s
                           : std::isinf(b.variance) ? a.seen_s
                                                    : std::max(a.seen_s, b.seen_s));
  }

  const VoxelMap& map_;
  const MeshRules& rules_;
  Neighbourhood around_;
  GridPlace base_;
  UnitMesh mesh_;
  boost::unordered_flat_map<std::uint64_t, std::uint32_t> vertices_;
};

}  // namespace

namespace {

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
  Mesher mesher(map, rules);
  for (const std::int32_t block : map.units()[static_cast<std::size_t>(unit)].blocks) {
    if (block >= 0) mesher.add_block(block);
  }
  UnitMesh mesh = mesher.take();
  drop_unused(mesh);
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
