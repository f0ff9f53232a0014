#pragma once

#include <string>

#include "fusion/files/ply_reader.hpp"
#include "fusion/settings.hpp"

namespace spectra::test {

/// What FusionPlan and write_ply() make of a scene that read_ply() has read: the bytes that fuse_ply() must give, too.
std::string fused_in_memory(const files::LoadedScene& scene, const fusion::FusionSettings& settings);

}  // namespace spectra::test
