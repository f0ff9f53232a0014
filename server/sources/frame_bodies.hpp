#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "fusion/base/error.hpp"
#include "server/mapping/picture_file.hpp"
#include "server/net/frame_receiver.hpp"

namespace spectra::sources {

/// The pose of a message: its stamp, then place and rotation. Nothing where they are not eight finite numbers with a rotation, or too far away to be
/// mapped (mapping::is_in_range).
std::optional<Eigen::Isometry3d> pose_of(const std::vector<double>& values);

/// The picture of a message; `name` is what errors call it.
base::Result<mapping::Picture16> picture16_of(const net::IncomingFrame& frame, const std::string& name);
base::Result<mapping::PictureRgb> colour_picture_of(const net::IncomingFrame& frame, const std::string& name);

}  // namespace spectra::sources
