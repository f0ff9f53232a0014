#pragma once

#include <cstdint>
#include <optional>

namespace spectra::stream {

/// stream.complete of the protocol.
struct StreamComplete {
  std::uint32_t generation = 0;
  std::uint32_t scene_revision = 0;
  std::uint32_t tile_count = 0;
  std::uint64_t vertex_count = 0;
};

/// stream.stats of the protocol, without what only the connection knows.
struct StreamStats {
  double round_trip_ms = 0;
  double throughput_bytes_per_s = 0;
  std::uint64_t queued_bytes = 0;
  std::uint64_t skipped_frames = 0;
  std::uint64_t failed_tiles = 0;    ///< Tiles that could not be encoded; the log names them.
  std::uint32_t generation = 0;      ///< Of the settings in force, with which all that is to be drawn
  std::uint32_t shown_revision = 0;  ///< has been given out as it was in this revision of the scene, or later.
  double position_mm = 0;   ///< The accuracy of what the viewer can draw now: largest distance to the full mesh,
  int colour_levels = 256;  ///< levels per channel that can be told apart, by rounding and by coarse tiles,
  double pixel_error = 0;   ///< the largest distance in pixels within the view; 0 before the first camera, and
  std::optional<double> temperature_celsius;  ///< what temperatures are off, 95th percentile; nothing without any.
};

}  // namespace spectra::stream
