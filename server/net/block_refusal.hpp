#pragma once

#include <string>

#include "server/net/http_types.hpp"

namespace spectra::net {

/// Why a block, or taking one out, was refused; nothing has changed then.
struct BlockRefusal {
  unsigned status = 400;  ///< Of HTTP.
  std::string code;       ///< snake_case, stable.
  std::string field;      ///< Of the request; may be empty.
  std::string reason;     ///< One sentence for a person.
  std::string limits;     ///< May be empty.
};

/// As docs/protocol.md, "Blocks of the map", says; with Retry-After where it may be tried again soon.
HttpReply refused(const BlockRefusal& refusal);

}  // namespace spectra::net
