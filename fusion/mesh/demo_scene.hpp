#pragma once

#include <cstdint>

#include "fusion/mesh/multispectral_mesh.hpp"

namespace spectra::fusion {

/// What the demo scene is made from.
struct DemoSceneOptions {
  std::uint64_t vertex_count = 300'000;  ///< Aimed at; met within 5 %.
  std::uint64_t seed = 1;                ///< Same options, same bytes, on every machine.
};

/// A collapsed office in which fusion earns its keep: warm screens, a cold bottle, lettering that only the visible
/// camera sees, rubble, and a person partly under it whose warm face and hand are hard to see in the visible picture.
/// Temperatures as a 384 x 288 sensor would give them: smoothed, noisy, missing where no view reached.
MultispectralMesh demo_scene(const DemoSceneOptions& options);

}  // namespace spectra::fusion
