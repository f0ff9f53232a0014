#include "server/sources/frame_bodies.hpp"

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "server/mapping/picture_file.hpp"

namespace spectra::sources {
namespace {

using protocol::FrameEncoding;
using protocol::FrameSensor;

std::span<const unsigned char> body_of(const net::IncomingFrame& frame) {
  const auto* data = std::bit_cast<const unsigned char*>(frame.message.data());
  return {data + frame.body_begin, frame.message.size() - frame.body_begin};
}

base::Result<mapping::Picture16> picture16_of(const net::IncomingFrame& frame, const std::string& name) {
  const auto body = body_of(frame);
  if (frame.head.encoding == FrameEncoding::Png) return mapping::png16_of(body, name);
  if (frame.head.encoding == FrameEncoding::Jpeg) {
    return base::failure(base::ErrorCode::FileUnreadable, name + ": a JPEG has no 16 bits; png or raw16 is wanted");
  }
  mapping::Picture16 picture;
  picture.width = *frame.head.width;
  picture.height = *frame.head.height;
  const std::size_t pixels = static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height);
  if (body.size() != 2 * pixels) {
    return base::failure(base::ErrorCode::FileUnreadable, name + ": has " + std::to_string(body.size()) +
                                                              " bytes, and " + std::to_string(2 * pixels) +
                                                              " are wanted of its width and height");
  }
  picture.pixels.resize(pixels);
  for (std::size_t i = 0; i < pixels; ++i)
    picture.pixels[i] = static_cast<std::uint16_t>(body[2 * i] | body[2 * i + 1] << 8U);
  return picture;
}

base::Result<mapping::PictureRgb> colour_picture_of(const net::IncomingFrame& frame, const std::string& name) {
  if (frame.head.encoding != FrameEncoding::Raw16) return mapping::colour_of(body_of(frame), name);
  return base::failure(base::ErrorCode::FileUnreadable, name + ": is no colour picture; png or jpeg is wanted");
}

}  // namespace

std::string name_of(protocol::FrameSensor sensor) {
  return sensor == FrameSensor::Depth ? "depth" : sensor == FrameSensor::Color ? "color" : "thermal";
}

std::string picture_name(protocol::FrameSensor sensor) {
  return "a " + name_of(sensor) + " picture";
}

mapping::Frame frame_of(const net::IncomingFrame& frame, double time_s, const mapping::Calibration& calibration,
                        mapping::FaultLog& faults) {
  const FrameSensor sensor = *frame.head.sensor;
  const std::string name = picture_name(sensor);
  mapping::Frame result;
  result.time_s = time_s;
  const auto take = [&](auto read, const mapping::CameraModel& camera, auto& into) {
    if (!read) {
      faults.add(mapping::FaultKind::DamagedFile, read.error().message);
    } else if (read.value().width != camera.width || read.value().height != camera.height) {
      faults.add(mapping::FaultKind::WrongSize, name + " has " + std::to_string(read.value().width) + " x " +
                                                    std::to_string(read.value().height) +
                                                    " pixels, and its camera has " + std::to_string(camera.width) +
                                                    " x " + std::to_string(camera.height));
    } else {
      into = std::move(read).value();
    }
  };
  if (sensor == FrameSensor::Depth) take(picture16_of(frame, name), calibration.depth.camera, result.depth);
  if (sensor == FrameSensor::Thermal) take(picture16_of(frame, name), calibration.thermal->camera, result.thermal);
  if (sensor == FrameSensor::Color) take(colour_picture_of(frame, name), calibration.colour->camera, result.colour);
  return result;
}

}  // namespace spectra::sources
