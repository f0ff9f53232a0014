#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/messages/message.hpp"
#include "protocol/messages/stream_messages.hpp"

namespace spectra::protocol {

/// Params of scene.histogram.
struct HistogramRequest {
  std::uint32_t bins = 0;  ///< 1..4096.
};

/// Result of scene.histogram, degC; without thermal data every list is empty, mean and sigma are null.
struct HistogramReply {
  std::vector<double> edges;  ///< One more than counts.
  std::vector<std::uint64_t> counts;
  std::optional<double> mean;
  std::optional<double> sigma;
  std::vector<std::array<double, 2>> highlighted;  ///< Intervals [low, high] that the current method highlights.
  /// Share of the surface (of points: of the vertices) that the method highlights, 0..1; absent for a method that shows all
  /// temperatures alike.
  std::optional<double> highlighted_share;
};

/// Params of scene.probe; metres relative to the scene origin, finite as float.
struct ProbeRequest {
  std::array<double, 3> position{};
};

/// Which end of the sensor's range a reading lies beyond.
enum class BeyondRange { Over, Under };

/// Result of scene.probe: the nearest vertex at full accuracy.
struct ProbeReply {
  std::uint64_t vertex_index = 0;                ///< In the input's order.
  std::array<double, 3> position{};              ///< Metres relative to the scene origin.
  std::optional<double> temperature;             ///< degC; null = missing, or beyond the sensor's range.
  std::optional<BeyondRange> temperature_range;  ///< Absent where the sensor could tell the temperature, or has none.
  std::array<std::uint8_t, 3> visible{};
  std::array<std::uint8_t, 3> fused{};
  double distance = 0;                ///< Metres.
  std::optional<double> observed_at;  ///< When it was seen, Unix seconds; null = not known.
  std::optional<double> baseline;     ///< degC; null = there is none, or it is beyond the sensor's range.
  std::optional<double> baseline_at;  ///< The time it is of, Unix seconds; null = not known.
  std::optional<double>
      temperature_sigma;  ///< Standard deviation of the temperature, kelvin; absent where nobody says how sure it is.
  std::optional<double>
      temperature_at;  ///< When the thermal camera last looked there, Unix seconds; absent where it is not known.
};

enum class BaselineAction { Mark, Get };

/// Params of scene.baseline.
struct BaselineRequest {
  BaselineAction action = BaselineAction::Get;
};

/// Result of scene.baseline.
struct BaselineReply {
  std::optional<double>
      marked_at;  ///< Unix seconds; null = never: vertices are compared with what they were when first seen.
  std::uint32_t revision = 0;  ///< Of the scene that has it.
};

/// A place and its temperature, degC.
struct Extreme {
  std::array<double, 3> position{};
  double temperature = 0;
};

/// Params of scene.extremes: of the whole scene, or of what a camera sees with nothing in between.
struct ExtremesRequest {
  std::optional<CameraSet> camera;
  /// Left, top, right and bottom of the part of the picture that counts, shares of its width and height; absent: all of it.
  std::optional<std::array<double, 4>> window;
};

/// Result of scene.extremes; null without thermal data.
struct ExtremesReply {
  std::optional<Extreme> hottest;  ///< Of what the sensor could tell.
  std::optional<Extreme> coldest;
  std::optional<std::array<double, 3>> over_range;  ///< A place beyond the sensor's range; absent where there is none.
  std::optional<std::array<double, 3>> under_range;
};

/// Params of fusion.facts.
struct FactsRequest {
  std::optional<std::uint32_t> bins;  ///< 1..4096; absent: no histogram.
  std::optional<bool> hues;           ///< Absent: no.
};

/// Result of fusion.facts: what automatic values are made of, so that a client that fuses by itself comes to the same. The
/// extremes, mean and sigma are 0 without a finite temperature.
struct FactsReply {
  std::uint64_t finite_count = 0;
  std::uint64_t missing_count = 0;
  std::uint64_t over_range_count = 0;
  std::uint64_t under_range_count = 0;
  double min = 0;
  double max = 0;
  double mean = 0;
  double sigma = 0;
  std::optional<std::vector<std::uint64_t>> counts;  ///< Of `bins` equal bins from min to max.
  std::optional<std::vector<std::uint64_t>>
      hues;  ///< Chroma of the visible colours by equal sectors of hue, from red on.
};

extern template struct Wire<FactsRequest>;
extern template struct Wire<FactsReply>;
extern template struct Wire<HistogramRequest>;
extern template struct Wire<HistogramReply>;
extern template struct Wire<ProbeRequest>;
extern template struct Wire<ProbeReply>;
extern template struct Wire<BaselineRequest>;
extern template struct Wire<BaselineReply>;
extern template struct Wire<ExtremesRequest>;
extern template struct Wire<Extreme>;
extern template struct Wire<ExtremesReply>;

}  // namespace spectra::protocol
