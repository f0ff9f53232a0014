// Made by protocol/generate from protocol/schema. Not to be edited.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/messages/message.hpp"

/// A stream of frames into the map (/frames).
namespace spectra::protocol {

/// what a message of /frames speaks of
enum class FramesKind { Calibration, Poses, CorrectedPoses, Picture, End };

enum class FrameSensor { Depth, Color, Thermal };

enum class FrameEncoding { Png, Jpeg, Raw16 };

/// stamp in seconds, position in metres, orientation x y z w
using StampedPose = std::vector<double>;

/// The head of a message; what it speaks of stands behind it.
struct FrameHead {
  FramesKind kind = FramesKind::Calibration;
  /// At most 2^53 - 1; chosen by the sender, the answer names it.
  std::uint64_t sequence = 0;
  /// Of a picture: its stamp, seconds.
  std::optional<double> time;
  /// Of a picture.
  std::optional<FrameSensor> sensor;
  /// Of a picture.
  std::optional<FrameEncoding> encoding;
  /// Of a raw picture, pixels.
  std::optional<int> width;
  /// Of a raw picture, pixels.
  std::optional<int> height;
  /// Of the camera, and in the sense, that the calibration says.
  std::vector<StampedPose> poses;
};

/// What may have been sent since the connection began; only ever grows.
struct FramesCredit {
  /// Messages.
  std::uint64_t messages = 0;
  /// Of messages; the last one may go beyond it.
  std::uint64_t bytes = 0;
};

/// What one message may hold.
struct FramesLimits {
  /// A larger one ends the connection (1009).
  std::uint64_t max_message_bytes = 0;
  /// Of the head.
  std::uint64_t max_head_bytes = 0;
};

/// Params of the notification frames.hello.
struct FramesHello {
  /// spectra.frames.v1
  std::string protocol;
  FramesLimits limits;
  FramesCredit credit;
};

/// Params of the notification frames.taken.
struct FramesTaken {
  /// Of the message.
  std::uint64_t sequence = 0;
  /// The mapper had no time for the picture.
  std::optional<bool> skipped;
  /// No more than so many are wanted, of all sensors together; absent: as many as come.
  std::optional<double> pictures_per_s;
  FramesCredit credit;
};

/// Params of the notification frames.refused: the map is as it was.
struct FramesRefused {
  /// Of the message; 0: its head could not be read.
  std::uint64_t sequence = 0;
  /// snake_case, stable.
  std::string code;
  /// May be empty.
  std::string field;
  /// One sentence for a person.
  std::string reason;
  FramesCredit credit;
};

extern template struct Wire<FrameHead>;
extern template struct Wire<FramesCredit>;
extern template struct Wire<FramesLimits>;
extern template struct Wire<FramesHello>;
extern template struct Wire<FramesTaken>;
extern template struct Wire<FramesRefused>;

}  // namespace spectra::protocol
