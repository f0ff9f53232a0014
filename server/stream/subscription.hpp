#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/tile_frame.hpp"

namespace spectra::stream {

/// What a viewer says of itself in scene.subscribe.
struct Subscription {
  std::size_t in_flight_bytes = 0;  ///< Bounds the sending window; 0 = our choice (which is also the largest).
  /// Most bytes of decoded tiles, see decoded_bytes(). Tiles not looked at for longest are removed, and what the camera
  /// asks for is refined no further than fits, where its lack is seen most first; the tops of the tree are always sent.
  /// 0 = kCacheBytes for what is left over from earlier cameras, and no bound to what the present one asks for.
  std::uint64_t cache_bytes = 0;
  protocol::ColourTransform colour_transform = protocol::ColourTransform::None;  ///< Of visible colours, too.
  bool fused = true;  ///< Colours by the plan; without, tiles come as geometry and raw layers.
  /// Raw layers come after everything else, hottest and nearest first, and the visible colours after the temperatures of a tile.
  bool temperature = false;
  bool visible = false;
  bool temperature_sigma = false;       ///< Comes as the raw layers do, after them.
  double temperature_step_celsius = 0;  ///< 0 = the default.

  static constexpr std::uint64_t kCacheBytes = 256u << 20;
};

/// A tile that a viewer still has from an earlier connection, geometry and colours.
struct ResumedTile {
  protocol::TileId tile;
  std::uint32_t revision = 0;
  bool has_raw_layers = false;  ///< Temperatures and visible colours, in the form that it subscribes to.
  bool has_temperature_sigma = false;
  /// Of the frame that brought its colours over that connection, 0 where they are as that connection was resumed with; nothing:
  /// they are to come anew.
  std::optional<std::uint32_t> colour_sequence = std::nullopt;
};

/// What of such tiles need not be sent again.
struct Resumed {
  std::uint32_t tile_count = 0;  ///< Geometry.
  std::vector<std::uint32_t>
      current_colours;  ///< Places, in what was claimed, of those whose colours are as demanded, not rounded.
};

}  // namespace spectra::stream
