// Made by protocol/generate from protocol/schema. Not to be edited.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/messages/message.hpp"
#include "protocol/messages/scene_messages.hpp"

/// A stream of blocks into the map (/ingest).
namespace spectra::protocol {

/// What may have been sent since the connection began; only ever grows.
struct IngestCredit {
  /// Messages.
  std::uint64_t blocks = 0;
  /// Of messages; the last one may go beyond it.
  std::uint64_t bytes = 0;
};

/// What one message may hold.
struct IngestLimits {
  /// PLY.
  std::uint64_t max_block_bytes = 0;
  /// Name and query.
  std::uint64_t max_target_bytes = 0;
};

/// Params of the notification ingest.hello.
struct IngestHello {
  /// spectra.ingest.v1
  std::string protocol;
  IngestLimits limits;
  IngestCredit credit;
};

/// Params of the notification ingest.acknowledged: the change is part of the map, and durable where there is a
/// store.
struct IngestAcknowledged {
  /// Of the message.
  std::uint64_t sequence = 0;
  /// Of the block; of the change, when one was taken out.
  std::uint64_t revision = 0;
  /// What was noticed in the block; left out when there is nothing.
  std::vector<SceneNote> notes;
  IngestCredit credit;
};

/// Params of the notification ingest.refused: the map is as it was.
struct IngestRefused {
  /// Of the message.
  std::uint64_t sequence = 0;
  /// snake_case, stable.
  std::string code;
  /// What is wrong; may be empty.
  std::string field;
  /// One sentence for a person.
  std::string reason;
  /// What would be accepted, for a person; left out when there is nothing to say.
  std::string limits;
  IngestCredit credit;
};

extern template struct Wire<IngestCredit>;
extern template struct Wire<IngestLimits>;
extern template struct Wire<IngestHello>;
extern template struct Wire<IngestAcknowledged>;
extern template struct Wire<IngestRefused>;

}  // namespace spectra::protocol
