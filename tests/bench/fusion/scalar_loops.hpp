#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "fusion/fusion_plan.hpp"

namespace spectra::fusion::bench {

/// A scene in flat arrays, with what its plan knows.
struct Scene {
  std::vector<float> temperature;
  std::vector<float> baseline;
  std::vector<base::Rgb8> visible;
  fusion::TemperatureSummary summary;
  std::vector<std::uint64_t> counts;  ///< Of a histogram of 64 bins.
};

using Loop = std::function<void(std::span<base::Rgb8>)>;

/// The method as anybody would write it first: one loop over the vertices, in double precision. Empty for a method
/// without one.
Loop scalar_double_loop(const Scene& scene, const fusion::FusionPlan& plan, const fusion::PaletteTable& palette);

/// The blend as a plain float loop that the compiler may turn into vector instructions as far as it can.
Loop plain_float_blend(const Scene& scene, const fusion::FusionPlan& plan, const fusion::PaletteTable& palette);

/// The same picture composed of OpenCV operations on the same arrays; empty where it cannot be, or without OpenCV.
Loop opencv_composition(const Scene& scene, const fusion::FusionPlan& plan, const fusion::PaletteTable& palette);

}  // namespace spectra::fusion::bench
