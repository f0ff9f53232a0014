#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fusion/error.hpp"
#include "fusion/fusion_plan.hpp"
#include "fusion/mesh/multispectral_mesh.hpp"
#include "fusion/statistics/temperature_statistics.hpp"
#include "fusion/vertex_types.hpp"

namespace spectra::server {

/// The files a fused scene can be written as.
enum class SceneFileFormat { Ply, Glb, Draco };

/// By the ending ".ply", ".glb" or ".drc" of a file name or request path, any case.
std::optional<SceneFileFormat> scene_file_format(std::string_view name);

/// The MIME type of an export.
std::string_view content_type_of(SceneFileFormat format);

/// What a method may know of a mesh that is wholly in memory. Refers to the mesh.
fusion::SceneTemperature temperature_of(const fusion::MultispectralMesh& mesh);

/// The fused colour of every vertex, in the mesh's order.
std::vector<fusion::Rgb8> fused_colours(const fusion::MultispectralMesh& mesh, const fusion::FusionPlan& plan);

/// The bytes of a file that holds the mesh with these colours (one a vertex): the one way to make exports, so that the
/// command line and HTTP give the same bytes. In a GLB temperature is the vertex attribute _TEMPERATURE (float, degC;
/// kGlbMissingCelsius where there is none, because glTF allows no NaN) and the scene's origin the node's translation.
fusion::Result<std::string> scene_file(const fusion::MultispectralMesh& mesh, std::span<const fusion::Rgb8> colours,
                                       SceneFileFormat format);

/// The same into a file that appears whole or not at all.
fusion::Result<void> write_scene_file(const std::filesystem::path& path, const fusion::MultispectralMesh& mesh,
                                      std::span<const fusion::Rgb8> colours, SceneFileFormat format);

/// Stands for a missing temperature in a GLB: colder than anything can be.
inline constexpr float kGlbMissingCelsius = -1000;

}  // namespace spectra::server
