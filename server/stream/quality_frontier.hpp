#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "protocol/tile_frame.hpp"
#include "server/stream/stream_quality.hpp"

namespace spectra::stream {

/// One way to answer a change of the settings: how coarse the tiles, how coarse their colours.
struct QualityPoint {
  double pixel_error_factor = 1;  ///< Times the pixel error that the viewer wants in the end.
  int colour_bits = 8;            ///< At most what the viewer wants in the end.
  friend bool operator==(const QualityPoint&, const QualityPoint&) = default;
};

/// From full quality to the least that still helps; each point costs fewer bytes than the one before. Colours lose two bits
/// first: six are hard to tell from eight and save two fifths. Then tiles get coarser: a level less costs fewer bytes and a
/// smaller colour difference than a fifth or fourth bit (docs/tradeoff.md).
std::span<const QualityPoint> quality_frontier();

/// Bytes of a colour frame per vertex, for each number of colour bits; learnt from the frames that are sent, starting from
/// what a scanned outdoor scene needs.
class ColourCost {
 public:
  explicit ColourCost(protocol::ColourTransform transform = protocol::ColourTransform::None);
  void learn(int colour_bits, std::size_t vertex_count, std::size_t payload_bytes);
  double bytes_per_vertex(int colour_bits) const;

 private:
  std::array<double, 9> bytes_per_vertex_;
};

/// The point at which a change of the settings is answered first: in automatic quality the finest that is expected to arrive
/// within the latency target at this rate (the cheapest when none is), else, or while the rate is unknown (0), full
/// quality. `target_vertex_count` tells how many vertices are to be coloured at a pixel error.
QualityPoint first_answer(const StreamQuality& quality, double rate_bytes_per_s, double round_trip_s,
                          const ColourCost& cost,
                          const std::function<std::uint64_t(double pixel_error)>& target_vertex_count);

}  // namespace spectra::stream
