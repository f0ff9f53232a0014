#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "fusion/base/progress.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"

namespace spectra::demo {

/// The sizes demo_scene() can make; a count outside them is brought to the nearer one.
inline constexpr std::uint64_t kDemoSceneLeastVertices = 5'000;
inline constexpr std::uint64_t kDemoSceneMostVertices = 10'000'000;

/// What the demo scene is made from.
struct DemoSceneOptions {
  std::uint64_t vertex_count = 300'000;  ///< Aimed at; met within 5 %.
  std::uint64_t seed = 1;                ///< Same options, same bytes, on every machine.
};

/// A collapsed office in which fusion earns its keep: warm screens, a cold bottle, lettering that only the visible
/// camera sees, rubble, and a person partly under it whose warm face and hand are hard to see in the visible picture.
/// Temperatures as a 384 x 288 sensor would give them: smoothed, noisy, missing where no view reached.
///
/// About 7.6 x 5.6 x 2.9 m, in metres: x to the right, y up, z towards the viewer; floor at y = 0, back wall at
/// z = -2.8, open at the front. A good first camera: from (-0.50, 2.00, 4.75) to (-0.05, 0.65, -0.60), up (0, 1, 0), a
/// vertical angle of 45 to 50 degrees.
/// `progress` is told of kModellingPhase.
mesh::MultispectralMesh demo_scene(const DemoSceneOptions& options, const base::Progress& progress = {});

/// The demo scene and which of its vertices are the bare skin of the person, for those who ask whether it is found.
struct LabelledDemoScene {
  mesh::MultispectralMesh mesh;
  std::vector<std::uint8_t> is_skin;  ///< One a vertex: 1 or 0.
};
LabelledDemoScene labelled_demo_scene(const DemoSceneOptions& options, const base::Progress& progress = {});

/// The surfaces of the demo scene as they are, for simulated sensors: all of them, whether a camera saw them or not, with their true
/// temperatures and the colours that a camera sees.
mesh::MultispectralMesh true_demo_scene(const DemoSceneOptions& options, const base::Progress& progress = {});

/// A place in the demo scene whose temperature is known, for tests and for trying out the tools.
struct DemoLandmark {
  std::string_view name;  ///< For example "mug", "face", "exit_sign".
  base::Vec3f position;   ///< On the surface, to about a centimetre; the same for every seed.
  float lowest_celsius;   ///< The nearest vertex of a scene of the default size lies between these.
  float highest_celsius;
};

/// Everything in the scene that is hot, cold, alive or written on.
std::vector<DemoLandmark> demo_landmarks();

}  // namespace spectra::demo
