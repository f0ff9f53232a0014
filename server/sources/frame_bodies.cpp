#include "server/sources/frame_bodies.hpp"

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

namespace spectra::sources {
namespace {

using protocol::FrameEncoding;

std::span<const unsigned char> body_of(const net::IncomingFrame& frame) {
  const auto* data = std::bit_cast<const unsigned char*>(frame.message.data());
  return {data + frame.body_begin, frame.message.size() - frame.body_begin};
}

}  // namespace

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

}  // namespace spectra::sources
