#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/base/progress.hpp"
#include "fusion/base/vertex_types.hpp"
#include "fusion/files/ply_reader.hpp"
#include "fusion/fusion_plan.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"
#include "fusion/statistics/temperature_statistics.hpp"
#include "protocol/codec/draco_file.hpp"
#include "server/map/scene_snapshot.hpp"

namespace spectra::exports {

/// The files a fused scene can be written as.
enum class SceneFileFormat { Ply, Glb, Draco };

/// By the ending ".ply", ".glb" or ".drc" of a file name or request path, any case.
std::optional<SceneFileFormat> scene_file_format(std::string_view name);

/// The MIME type of an export.
std::string_view content_type_of(SceneFileFormat format);

/// What a method may know of a mesh that is wholly in memory. Refers to the mesh.
fusion::SceneTemperature temperature_of(const mesh::MultispectralMesh& mesh);

/// The fused colour of every vertex, in the mesh's order.
std::vector<base::Rgb8> fused_colours(const mesh::MultispectralMesh& mesh, const fusion::FusionPlan& plan,
                                      std::span<const float> baseline_celsius = {});

/// How a fused scene is written.
struct SceneFileOptions {
  SceneFileFormat format = SceneFileFormat::Ply;
  protocol::codec::DracoKeeping keeping =
      protocol::codec::DracoKeeping::Shape;  ///< Of a Draco file; the others keep everything.
  float position_step_m = 0;                 ///< Of a Draco file that does not keep everything; 0: it has no lattice.
  float largest_position_step_m = 0;         ///< The step of those vertices that are rounded most.
};

/// A file, and what it does not tell as the scene did.
struct SceneFile {
  std::string bytes;
  std::vector<files::Note> losses;
};

/// The bytes of a file that holds the mesh with these colours (one a vertex): the one way to make exports, so that the
/// command line and HTTP give the same bytes. In a GLB temperature is the vertex attribute _TEMPERATURE (float, degC;
/// kGlbMissingCelsius where there is none, because glTF allows no NaN) and the scene's origin the node's translation.
base::Result<SceneFile> scene_file(const mesh::MultispectralMesh& mesh, std::span<const base::Rgb8> colours,
                                   const SceneFileOptions& options);

/// The same into a file that appears whole or not at all; returns the losses. `progress` is told of kWritingPhase.
base::Result<std::vector<files::Note>> write_scene_file(const std::filesystem::path& path,
                                                        const mesh::MultispectralMesh& mesh,
                                                        std::span<const base::Rgb8> colours,
                                                        const SceneFileOptions& options,
                                                        const base::Progress& progress = {});

/// Rounds the whole mesh of a scene for a Draco file that does not keep everything, as the scene is streamed: each vertex as finely
/// as its surroundings need. Sets the options' steps; the file's is the finest, doubled until all that is written fits on it, or none (0) where it would have to be
/// coarser than the scene's.
base::Result<void> round_for_file(const map::SceneSnapshot& scene, mesh::MultispectralMesh& mesh,
                                  SceneFileOptions& options);

}  // namespace spectra::exports
