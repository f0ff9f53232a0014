#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>

#include "server/mapping/voxel_map.hpp"

namespace spectra::mapping {

/// A quantity between voxels: its value, and how it changes, in its unit a metre, along the axes of the world.
struct Sampled {
  float value = 0;
  Eigen::Vector3f gradient = Eigen::Vector3f::Zero();
};

/// What a map has at the eight voxels about a place, as far as it was asked for: x fastest.
struct SampledCell {
  enum class State : std::uint8_t { NotAsked, None, Known };
  GridPlace voxel{INT32_MIN, 0, 0};  ///< The lowest.
  State distance_state = State::NotAsked, luma_state = State::NotAsked, celsius_state = State::NotAsked;
  std::array<float, 8> distance, luma, celsius;
};

/// Looks up what a map has at places between its voxels, linearly along each axis. One place at a time: seek(), then what is wanted of it. Remembers the
/// block of the place before. For one thread; the map must not change.
class MapSampler {
 public:
  explicit MapSampler(const VoxelMap& map) : map_(map), per_m_(1 / map.voxel_m()) {}

  /// Goes to a place, metres. `cell`: one that was used before; what it knows is not looked up again where it is the same one.
  void seek(const Eigen::Vector3d& place, SampledCell& cell) {
    const Eigen::Vector3d at = place * per_m_;
    const Eigen::Vector3d low(std::floor(at.x()), std::floor(at.y()), std::floor(at.z()));
    share_ = (at - low).cast<float>();
    const GridPlace voxel{static_cast<std::int32_t>(low.x()), static_cast<std::int32_t>(low.y()),
                          static_cast<std::int32_t>(low.z())};
    cell_ = &cell;
    if (cell.voxel == voxel) return;
    cell.voxel = voxel;
    cell.distance_state = cell.luma_state = cell.celsius_state = SampledCell::State::NotAsked;
  }

  /// Truncated signed distance in shares of the truncation (-1 .. 1); false where a voxel was never seen, or where all around is as far as
  /// distances go.
  bool distance(Sampled& out) {
    return sample(cell_->distance_state, cell_->distance, out, [this] {
      bool is_near = false;
      for (std::size_t k = 0; k < 8; ++k) {
        if (map_.voxels(blocks_[k]).weight[indices_[k]] == 0) return false;
        const float corner = static_cast<float>(map_.voxels(blocks_[k]).distance[indices_[k]]) / kDistanceOne;
        cell_->distance[k] = corner;
        is_near = is_near || std::abs(corner) < 0.95F;
      }
      return is_near;
    });
  }

  /// Brightness in levels (0 .. 255); false where a voxel has no colour.
  bool luma(Sampled& out) {
    return sample(cell_->luma_state, cell_->luma, out, [this] {
      for (std::size_t k = 0; k < 8; ++k) {
        const VoxelBlock& block = map_.voxels(blocks_[k]);
        const std::size_t i = indices_[k];
        if (block.colour_weight[i] == 0) return false;
        cell_->luma[k] = (0.299F * block.red[i] + 0.587F * block.green[i] + 0.114F * block.blue[i]) / 256;
      }
      return true;
    });
  }

  /// Temperature in degC; false where a voxel has none that is known to `most_sigma`, kelvin, the same each time.
  bool celsius(float most_sigma, Sampled& out) {
    return sample(cell_->celsius_state, cell_->celsius, out, [this, most_sigma] {
      for (std::size_t k = 0; k < 8; ++k) {
        if (map_.head(blocks_[k]).heat < 0) return false;
        const HeatBlock& heat = map_.heat(blocks_[k]);
        if (!(heat.variance[indices_[k]] < most_sigma * most_sigma)) return false;
        cell_->celsius[k] = heat.celsius[indices_[k]];
      }
      return true;
    });
  }

 private:
  template <class LookUp>
  bool sample(SampledCell::State& state, const std::array<float, 8>& corners, Sampled& out, const LookUp& look_up) {
    using State = SampledCell::State;
    if (state == State::NotAsked) state = find_corners() && look_up() ? State::Known : State::None;
    if (state == State::None) return false;
    interpolate(corners, out);
    return true;
  }

  /// Where the eight voxels of the cell are; false when there is no block for one of them.
  bool find_corners() {
    const GridPlace& voxel = cell_->voxel;
    const GridPlace within{voxel.x & 7, voxel.y & 7, voxel.z & 7};
    const std::int32_t home = block_at(coarser(voxel, 3));
    if (home < 0) return false;
    if (within.x < 7 && within.y < 7 && within.z < 7) {
      const std::size_t first = index_within(within, 3);
      for (std::size_t k = 0; k < 8; ++k) {
        blocks_[k] = home;
        indices_[k] = first + (k & 1) + (k >> 1 & 1) * 8 + (k >> 2) * 64;
      }
      return true;
    }
    for (std::size_t k = 0; k < 8; ++k) {
      const GridPlace corner{voxel.x + static_cast<std::int32_t>(k & 1),
                             voxel.y + static_cast<std::int32_t>(k >> 1 & 1),
                             voxel.z + static_cast<std::int32_t>(k >> 2)};
      blocks_[k] = block_at(coarser(corner, 3));
      if (blocks_[k] < 0) return false;
      indices_[k] = index_within(corner, 3);
    }
    return true;
  }

  std::int32_t block_at(GridPlace block) {
    if (block == last_) return last_block_;
    last_ = block;
    last_block_ = map_.find(block);
    return last_block_;
  }

  void interpolate(const std::array<float, 8>& c, Sampled& out) const {
    const float x = share_.x(), y = share_.y(), z = share_.z();
    const auto mix = [](float a, float b, float share) { return a + (b - a) * share; };
    const float y0z0 = mix(c[0], c[1], x), y1z0 = mix(c[2], c[3], x), y0z1 = mix(c[4], c[5], x),
                y1z1 = mix(c[6], c[7], x);
    const float z0 = mix(y0z0, y1z0, y), z1 = mix(y0z1, y1z1, y);
    out.value = mix(z0, z1, z);
    const auto per_m = static_cast<float>(per_m_);
    const float dx = mix(mix(c[1] - c[0], c[3] - c[2], y), mix(c[5] - c[4], c[7] - c[6], y), z);
    out.gradient = per_m * Eigen::Vector3f(dx, mix(y1z0 - y0z0, y1z1 - y0z1, z), z1 - z0);
  }

  const VoxelMap& map_;
  const double per_m_;
  GridPlace last_{INT32_MIN, 0, 0};
  std::int32_t last_block_ = -1;
  SampledCell* cell_ = nullptr;
  Eigen::Vector3f share_ = Eigen::Vector3f::Zero();
  std::array<std::int32_t, 8> blocks_{};
  std::array<std::size_t, 8> indices_{};
};

}  // namespace spectra::mapping
