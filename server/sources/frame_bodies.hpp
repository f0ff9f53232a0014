#pragma once

#include <string>

#include "server/mapping/calibration.hpp"
#include "server/mapping/frame_folder.hpp"
#include "server/net/frame_receiver.hpp"

namespace spectra::sources {

/// What people call a sensor, and a picture of it ("a depth picture").
std::string name_of(protocol::FrameSensor sensor);
std::string picture_name(protocol::FrameSensor sensor);

/// The picture of a message, of a sensor that the calibration has. One that cannot be read, or is not of the size of its camera, is missing and stands in `faults`.
mapping::Frame frame_of(const net::IncomingFrame& frame, double time_s, const mapping::Calibration& calibration,
                        mapping::FaultLog& faults);

}  // namespace spectra::sources
