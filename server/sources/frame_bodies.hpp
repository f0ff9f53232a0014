#pragma once

#include <string>

#include "fusion/base/error.hpp"
#include "server/mapping/picture_file.hpp"
#include "server/net/frame_receiver.hpp"

namespace spectra::sources {

/// The picture of a message; `name` is what errors call it.
base::Result<mapping::Picture16> picture16_of(const net::IncomingFrame& frame, const std::string& name);
base::Result<mapping::PictureRgb> colour_picture_of(const net::IncomingFrame& frame, const std::string& name);

}  // namespace spectra::sources
