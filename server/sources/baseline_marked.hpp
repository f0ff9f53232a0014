#pragma once

#include <cstdint>
#include <functional>
#include <variant>

#include "server/net/block_refusal.hpp"

namespace spectra::sources {

/// A moment whose temperatures have become the baseline, and the revision of the scene that says so.
struct BaselineMarked {
  double marked_at = 0;  ///< Unix seconds.
  std::uint32_t revision = 0;
};
using BaselineDone = std::function<void(std::variant<BaselineMarked, net::BlockRefusal>)>;

}  // namespace spectra::sources
