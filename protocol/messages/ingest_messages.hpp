#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/messages/message.hpp"
#include "protocol/messages/scene_messages.hpp"

namespace spectra::protocol {

/// What may have been sent since the connection began; only ever grows.
struct IngestCredit {
  std::uint64_t blocks = 0;  ///< Messages.
  std::uint64_t bytes = 0;   ///< Of messages; the last one may go beyond it.
};

/// What one message may hold.
struct IngestLimits {
  std::uint64_t max_block_bytes = 0;   ///< PLY.
  std::uint64_t max_target_bytes = 0;  ///< Name and query.
};

/// Params of ingest.hello.
struct IngestHello {
  std::string protocol;
  IngestLimits limits;
  IngestCredit credit;
};

/// Params of ingest.acknowledged: the change is part of the map, and durable where there is a store.
struct IngestAcknowledged {
  std::uint64_t sequence = 0;
  std::uint64_t revision = 0;
  std::vector<SceneNote> notes;  ///< What was noticed in the block; left out when there is nothing.
  IngestCredit credit;
};

/// Params of ingest.refused: the map is as it was.
struct IngestRefused {
  std::uint64_t sequence = 0;
  std::string code;    ///< snake_case, stable.
  std::string field;   ///< May be empty.
  std::string reason;  ///< One sentence for a person.
  std::string limits;  ///< Left out when it is empty.
  IngestCredit credit;
};

extern template struct Wire<IngestCredit>;
extern template struct Wire<IngestLimits>;
extern template struct Wire<IngestHello>;
extern template struct Wire<IngestAcknowledged>;
extern template struct Wire<IngestRefused>;

}  // namespace spectra::protocol
