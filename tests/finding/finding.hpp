#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fusion/fusion_plan.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"

/// Whether a picture marks what is warm and small in a scene, and leaves the rest alone.
namespace spectra::fusion::test {

/// A scene with the surface that each vertex stands for, and the facts that a plan needs.
struct Surface {
  explicit Surface(mesh::MultispectralMesh scene);
  Surface(const Surface&) = delete;
  Surface& operator=(const Surface&) = delete;

  mesh::MultispectralMesh mesh;
  std::vector<double> area;                            ///< Per vertex: a third of its triangles.
  std::vector<std::vector<std::uint32_t>> neighbours;  ///< Joined by an edge; some stand twice.
  fusion::SceneTemperature facts;
};

/// Something in a scene that should be found: its vertices, and the ones around it beyond the blur of the sensor.
struct Thing {
  std::string name;
  std::vector<std::uint8_t> is_part;  ///< One a vertex: 1 or 0.
  std::vector<std::uint8_t> is_ring;
};

/// From labels; of what has no temperature nobody can tell that it is warm, so it is no part. The ring is what lies from a half
/// to one and a half radii away from it (the radius of a disc of its area), because heat spreads and sensors blur.
Thing thing_from(const Surface& surface, std::string name, std::vector<std::uint8_t> is_part);

/// The hottest things that do not touch: each is what hangs together with a hottest vertex and is hotter than half-way
/// between the scene's median and it.
std::vector<Thing> hottest_things(const Surface& surface, std::size_t count);

/// How much a picture shows of a thing. A colour has changed when it is 10 CIEDE2000 or more from the visible one.
struct Finding {
  double thing_changed = 0;  ///< Share of the surface of the thing, 0 to 1.
  double rest_changed = 0;   ///< Share of the surface of all that belongs to no thing.
  double difference_from_ring =
      0;  ///< CIEDE2000 between the mean colours of the thing and of its ring; 0 without a ring.
};

/// `things` are all that should be found in the scene; one finding each.
std::vector<Finding> findings(const Surface& surface, const fusion::FusionPlan& plan, const std::vector<Thing>& things);

/// What every method that marks should reach, and the plain views and those that recolour everything need not.
inline constexpr double kLeastOfTheThing = 0.60;
inline constexpr double kMostOfTheRest = 0.15;
inline constexpr double kLeastDifference = 10;

/// The plan of a method at its defaults in the settings that a person sees first.
fusion::FusionPlan first_view_plan(const Surface& surface, const std::string& method,
                                   const fusion::ParameterValues& params = {});

}  // namespace spectra::fusion::test
