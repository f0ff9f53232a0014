#pragma once

#include <functional>
#include <string_view>

namespace spectra::base {

/// Is told how far a long job is: `share` (0 .. 1) of `phase` is done; a phase that begins ends the one before. Called often
/// and from any thread, several at a time too, so it has to return at once. An empty one is not called.
using Progress = std::function<void(std::string_view phase, double share)>;

/// Names of phases.
inline constexpr std::string_view kReadingPhase = "reading";
inline constexpr std::string_view kReadingThermalPhase = "reading temperatures";
inline constexpr std::string_view kJoiningPhase = "joining temperatures";
inline constexpr std::string_view kSurveyPhase = "surveying";
inline constexpr std::string_view kHistogramPhase = "counting temperatures";
inline constexpr std::string_view kFusingPhase = "fusing";
inline constexpr std::string_view kWritingPhase = "writing";
inline constexpr std::string_view kTopologyPhase = "examining the topology";
inline constexpr std::string_view kModellingPhase = "modelling";

/// Tells a sink that may be empty.
inline void report(const Progress& progress, std::string_view phase, double share) {
  if (progress) progress(phase, share);
}

}  // namespace spectra::base
