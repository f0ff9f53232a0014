#pragma once

#include <algorithm>
#include <array>
#include <boost/unordered/unordered_flat_map.hpp>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace spectra::mapping {

/// Voxels an edge of a block, blocks an edge of a unit, voxels an edge of a unit.
inline constexpr int kBlockEdge = 8, kUnitBlocks = 4, kUnitEdge = kBlockEdge * kUnitBlocks;
inline constexpr std::size_t kBlockVoxels = 512, kBlocksOfUnit = 64;

/// A place in a grid: of voxels, blocks or units, as the name says. Voxel i is a point at i times the voxel size.
struct GridPlace {
  std::int32_t x = 0, y = 0, z = 0;
  friend auto operator<=>(const GridPlace&, const GridPlace&) = default;
};

/// The place divided by 2^bits, rounded down.
inline GridPlace coarser(GridPlace at, int bits) {
  return {at.x >> bits, at.y >> bits, at.z >> bits};
}
/// x fastest, of an edge of 2^bits.
inline std::size_t index_within(GridPlace at, int bits) {
  const std::int32_t mask = (1 << bits) - 1;
  return static_cast<std::size_t>((at.x & mask) | (at.y & mask) << bits | (at.z & mask) << (2 * bits));
}

/// Distance and colour of 8^3 voxels: 11 bytes a voxel.
struct VoxelBlock {
  alignas(64) std::array<std::int16_t,
                         kBlockVoxels> distance;   ///< To the surface, positive before it; kDistanceOne = truncation.
  std::array<std::uint16_t, kBlockVoxels> weight;  ///< kWeightOne = one look from near; 0: never seen.
  std::array<std::uint16_t, kBlockVoxels> red, green, blue;  ///< In 256ths of a level.
  std::array<std::uint8_t, kBlockVoxels> colour_weight;      ///< 0: no colour.
};
inline constexpr float kDistanceOne = 32767;
inline constexpr float kWeightOne = 1024, kWeightMost = 65535;

/// Temperatures of 8^3 voxels: 12 bytes a voxel, only where there are any.
struct HeatBlock {
  alignas(64) std::array<float, kBlockVoxels> celsius;
  std::array<float, kBlockVoxels> variance;  ///< K^2, at seen_s; infinite: never seen.
  std::array<float, kBlockVoxels> seen_s;    ///< Of the last look, after the map's first moment.
};

/// What is known of a block beside its voxels.
struct BlockHead {
  GridPlace at;              ///< In blocks.
  std::int32_t unit = -1;    ///< Whose it is; -1: not in use.
  std::int32_t heat = -1;    ///< Its temperatures; -1: none.
  bool has_surface = false;  ///< Some voxel is near a surface.
  /// Some voxel may be behind a surface; some may not.
  bool has_inside = true, has_outside = true;
  bool is_free = true;  ///< Nothing but unseen space and what is well before surfaces.
  /// At most so much has changed since the unit was meshed: distance in voxels, temperature in kelvin, colour in levels.
  float moved = 0, warmed = 0, recoloured = 0;
  /// Of its looks by the thermal camera: sums of 1 / s and of 1 / s^1.75 that forget slowly, s being what the variance of each is
  /// multiplied by beyond that of its pixel, so that it weighs less.
  float heat_weight = 0, heat_weight_certain = 0;
  /// What variances of its temperatures are to be multiplied by to be those of the errors, at most 1: looks from afar are weighed down by more
  /// than they err, which grows about as the fourth root of s.
  float heat_certainty() const { return heat_weight > 0 ? std::min(1.0F, heat_weight_certain / heat_weight) : 1.0F; }
  float hottest = -1000;  ///< Of the temperatures that were told since; -1000: none was.
};

struct MapUnit {
  GridPlace at;                                    ///< In units.
  std::array<std::int32_t, kBlocksOfUnit> blocks;  ///< Index of each; -1: none.
  float moved = 0;                                 ///< As BlockHead::moved, of blocks that were taken out.
};

/// Blocks of voxels in pools, found by their place: a hash of units of 4^3 blocks. What changes its structure is for one thread; different
/// blocks may be changed by different threads.
class VoxelMap {
 public:
  explicit VoxelMap(double voxel_m) : voxel_m_(voxel_m) {}

  double voxel_m() const { return voxel_m_; }

  /// Of a place in blocks or units, for a hash: 21 bits of each number.
  static std::uint64_t key_of(GridPlace at);

  /// Index of a block, -1 when there is none.
  std::int32_t find(GridPlace block) const;
  std::int32_t find_unit(GridPlace unit) const;
  /// The same; made, empty, when there is none.
  std::int32_t ensure(GridPlace block);
  /// Gives a block temperatures; all unseen.
  void add_heat(std::int32_t block);
  /// Whether ensure() would make a block of that place although block_bytes() are `most_bytes` or more.
  bool would_be_beyond(GridPlace block, std::uint64_t most_bytes) const;
  /// Takes out a block; its room is used again.
  void remove(std::int32_t block);

  /// One past the highest index of a block; those with head().unit == -1 are not in use.
  std::int32_t block_end() const { return static_cast<std::int32_t>(heads_.size()); }
  BlockHead& head(std::int32_t block) { return heads_[static_cast<std::size_t>(block)]; }
  const BlockHead& head(std::int32_t block) const { return heads_[static_cast<std::size_t>(block)]; }
  VoxelBlock& voxels(std::int32_t block) { return voxels_.at(block); }
  const VoxelBlock& voxels(std::int32_t block) const { return voxels_.at(block); }
  /// Of a block that has some.
  HeatBlock& heat(std::int32_t block) { return heat_.at(head(block).heat); }
  const HeatBlock& heat(std::int32_t block) const { return heat_.at(head(block).heat); }
  const std::vector<MapUnit>& units() const { return units_; }
  MapUnit& unit(std::size_t index) { return units_[index]; }

  std::size_t block_count() const { return block_count_; }
  std::size_t heat_count() const { return heat_count_; }
  /// What its blocks take; temperatures are counted for all of them, which most come to have. Room that was given back is free.
  std::size_t block_bytes() const {
    return block_count_ * (sizeof(VoxelBlock) + sizeof(HeatBlock) + sizeof(BlockHead));
  }
  /// All that the map has taken.
  std::size_t size_bytes() const;

 private:
  /// Objects that never move, 64 at a time.
  template <class T>
  class Pool {
   public:
    T& at(std::int32_t index) const {
      const auto i = static_cast<std::size_t>(index);
      return chunks_[i / kChunk][i % kChunk];
    }
    std::int32_t take();
    void give_back(std::int32_t index) { free_.push_back(index); }
    std::size_t size_bytes() const {
      return chunks_.size() * kChunk * sizeof(T) + free_.capacity() * sizeof(std::int32_t);
    }

   private:
    static constexpr std::size_t kChunk = 64;
    std::vector<std::unique_ptr<T[]>> chunks_;
    std::vector<std::int32_t> free_;
    std::size_t used_ = 0;
  };

  double voxel_m_;
  boost::unordered_flat_map<std::uint64_t, std::int32_t> unit_by_place_;
  std::vector<MapUnit> units_;
  std::vector<BlockHead> heads_;  ///< As the pool of voxels.
  Pool<VoxelBlock> voxels_;
  Pool<HeatBlock> heat_;
  std::size_t block_count_ = 0, heat_count_ = 0;
};

}  // namespace spectra::mapping
