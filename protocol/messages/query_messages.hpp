// Made by protocol/generate from protocol/schema. Not to be edited.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/messages/message.hpp"
#include "protocol/messages/scene_messages.hpp"
#include "protocol/messages/stream_messages.hpp"

/// Questions about the scene.
namespace spectra::protocol {

/// Params of scene.histogram.
struct HistogramRequest {
  int bins = 0;
};

/// Result of scene.histogram; without thermal data every list is empty, mean and sigma are null.
struct HistogramReply {
  /// bins + 1 temperatures, degC.
  std::vector<double> edges;
  /// Vertices per bin.
  std::vector<std::uint64_t> counts;
  /// nullopt = null.
  std::optional<double> mean;
  /// nullopt = null.
  std::optional<double> sigma;
  /// Intervals [low, high] that the current method highlights, degC; one of the lowest or the highest alone: what
  /// is beyond the sensor's range there.
  std::vector<std::array<double, 2>> highlighted;
  /// Share of the surface (of points: of the vertices) that the current method highlights; absent for a method that
  /// shows all temperatures alike.
  std::optional<double> highlighted_share;
};

/// Params of scene.probe.
struct ProbeRequest {
  Position position{};
};

enum class BeyondRange { Over, Under };

/// r, g, b
using ColourBytes = std::array<std::uint8_t, 3>;

/// Result of scene.probe: the nearest vertex at full accuracy.
struct ProbeReply {
  /// In the input's order.
  std::uint64_t vertex_index = 0;
  Vector3 position{};
  /// degC; null = missing, or beyond the sensor's range.
  std::optional<double> temperature;
  /// The reading is beyond the sensor's range, hotter or colder than it could tell; absent otherwise.
  std::optional<BeyondRange> temperature_range;
  ColourBytes visible{};
  ColourBytes fused{};
  /// Metres.
  double distance = 0;
  /// When the vertex was seen, Unix seconds; null = not known.
  std::optional<double> observed_at;
  /// What its temperature is compared with, degC; null = nothing, or beyond the sensor's range.
  std::optional<double> baseline;
  /// The time that is of, Unix seconds; null = not known.
  std::optional<double> baseline_at;
  /// Standard deviation of the temperature, kelvin, apart from the camera's absolute error; absent where nobody
  /// says how sure it is.
  std::optional<double> temperature_sigma;
  /// When the thermal camera last looked there, Unix seconds; absent where it is not known.
  std::optional<double> temperature_at;
};

enum class BaselineAction { Mark, Get };

/// Params of scene.baseline.
struct BaselineRequest {
  BaselineAction action = BaselineAction::Get;
};

/// Result of scene.baseline.
struct BaselineReply {
  /// When the temperatures of that moment became the baseline, Unix seconds; null = never: each vertex is compared
  /// with what it was when first seen.
  std::optional<double> marked_at;
  /// Of the scene that has it.
  std::uint32_t revision = 0;
};

/// A place and its temperature, degC.
struct Extreme {
  Vector3 position{};
  double temperature = 0;
};

/// Params of scene.extremes. With a camera: of what it sees with nothing in between; where the server has the
/// capability extremes_in_view.
struct ExtremesRequest {
  std::optional<CameraSet> camera;
  /// Left, top, right and bottom of the part of the picture that counts, as shares of its width and height; absent:
  /// all of it.
  std::optional<std::array<double, 4>> window;
};

/// Result of scene.extremes; null without thermal data.
struct ExtremesReply {
  /// nullopt = null.
  std::optional<Extreme> hottest;
  /// nullopt = null.
  std::optional<Extreme> coldest;
  /// A place hotter than the sensor could tell; absent where there is none.
  std::optional<Vector3> over_range;
  /// A place colder than the sensor could tell.
  std::optional<Vector3> under_range;
};

/// Params of fusion.facts.
struct FactsRequest {
  /// A histogram of so many bins; absent: none.
  std::optional<int> bins;
  /// Whether the hues of the visible colours are wanted; absent: no.
  std::optional<bool> hues;
};

/// Result of fusion.facts: what automatic values are made of; extremes, mean and sigma are 0 without a finite
/// temperature.
struct FactsReply {
  std::uint64_t finite_count = 0;
  std::uint64_t missing_count = 0;
  std::uint64_t over_range_count = 0;
  std::uint64_t under_range_count = 0;
  /// degC, as are the next three.
  double min = 0;
  double max = 0;
  double mean = 0;
  double sigma = 0;
  /// Finite temperatures of each of `bins` equal bins from min to max; there when `bins` was given.
  std::optional<std::vector<std::uint64_t>> counts;
  /// Chroma (largest channel less the smallest) of the visible colours, summed by equal sectors of hue from red on;
  /// there when `hues` was asked for.
  std::optional<std::vector<std::uint64_t>> hues;
};

extern template struct Wire<HistogramRequest>;
extern template struct Wire<HistogramReply>;
extern template struct Wire<ProbeRequest>;
extern template struct Wire<ProbeReply>;
extern template struct Wire<BaselineRequest>;
extern template struct Wire<BaselineReply>;
extern template struct Wire<Extreme>;
extern template struct Wire<ExtremesRequest>;
extern template struct Wire<ExtremesReply>;
extern template struct Wire<FactsRequest>;
extern template struct Wire<FactsReply>;

}  // namespace spectra::protocol
