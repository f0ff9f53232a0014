#pragma once

#include <array>
#include <optional>

#include "server/map/scene_snapshot.hpp"
#include "server/stream/camera.hpp"

namespace spectra::stream {

/// A part of a picture: left, top, right and bottom as shares of its width and height.
using PictureWindow = std::array<double, 4>;
inline constexpr PictureWindow kWholePicture{0, 0, 1, 1};

/// The hottest and the coldest of the finite temperatures, and a vertex beyond the sensor's range at either side.
struct ExtremesInView {
  std::optional<map::Extreme> hottest, coldest, over_range, under_range;
};

/// The extremes of what a camera sees in a window of its picture, with nothing in between, of the full mesh; of several the
/// first of the input. What is in front is found on a map of depth 640 pixels along the longer side of the window: a vertex
/// that is less than a pixel of it behind the surface in front counts as seen. Points are as wide as they are apart.
/// Nothing for a camera that is not is_usable().
ExtremesInView extremes_in_view(const map::SceneSnapshot& scene, const Camera& camera, const PictureWindow& window);

}  // namespace spectra::stream
