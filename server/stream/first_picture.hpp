#pragma once

#include <memory>

#include "server/map/scene_snapshot.hpp"
#include "server/stream/frame_cache.hpp"

namespace spectra::stream {

/// Encodes the geometry that every viewer is sent first (the topmost tiles, at the quality he begins with) and leaves it in
/// the cache, so that the first viewer of a scene gets his picture as quickly as the others. A tile that cannot be encoded
/// is left to the viewer's stream, which reports it. Takes some tens of milliseconds.
void encode_first_picture(const std::shared_ptr<const map::SceneSnapshot>& scene, FrameCache& cache);

}  // namespace spectra::stream
