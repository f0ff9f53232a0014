#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <variant>

#include "protocol/messages/frames_messages.hpp"
#include "server/net/block_refusal.hpp"

namespace spectra::net {

/// What became of a message of /frames.
struct FrameTaken {
  bool is_skipped = false;               ///< There was no time for it.
  std::optional<double> pictures_per_s;  ///< No more than so many are wanted.
};
using FrameOutcome = std::variant<FrameTaken, BlockRefusal>;

/// A message of /frames.
struct IncomingFrame {
  protocol::FrameHead head;
  std::string message;         ///< All of it.
  std::size_t body_begin = 0;  ///< Of what the head speaks of.
};

/// Who makes a map of the frames of one robot at a time. Thread-safe.
class FrameReceiver {
 public:
  virtual ~FrameReceiver() = default;
  /// A sender has come. Refused (503): another one is there, the map is not open yet (busy), or nothing is mapped any more (not_mapping).
  virtual std::optional<BlockRefusal> begin() = 0;
  /// `done` is called once, now or later, from any thread. Never refuses because too much waits: the caller bounds what it hands over.
  virtual void take(IncomingFrame frame, std::function<void(FrameOutcome)> done) = 0;
  /// The sender has gone: what waits for poses waits no longer.
  virtual void end() = 0;
};

}  // namespace spectra::net
