#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "protocol/messages/frames_messages.hpp"
#include "protocol/rpc_error.hpp"

namespace spectra::protocol {

/// The subprotocol of /frames; docs/protocol.md, "A stream of frames".
inline constexpr const char* kFramesProtocol = "spectra.frames.v1";
inline constexpr std::string_view kFrameMagic = "SPF1";
/// "SPF1" and the bytes of the head, u32 little-endian; then the head, then what it speaks of.
inline constexpr std::size_t kFrameLeadSize = 8;
inline constexpr std::size_t kFrameHeadSize = 64 * 1024;

/// A message of /frames: what its head says, and where in it the rest begins.
struct FrameMessage {
  FrameHead head;
  std::size_t body_begin = 0;
};

/// Reads the head of a message. Safe on untrusted input; the error says what is wrong in a sentence.
Result<FrameMessage> decoded_frame_message(std::string_view message);
/// A whole message.
std::string encoded_frame_message(const FrameHead& head, std::string_view body);

}  // namespace spectra::protocol
