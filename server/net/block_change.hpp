#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "fusion/files/ply_reader.hpp"
#include "server/net/block_refusal.hpp"

namespace spectra::net {

/// A block that is to become part of the map, or to be taken out of it.
struct BlockChange {
  std::string id;
  std::vector<std::pair<std::string, std::string>> query;  ///< What is said of it.
  std::shared_ptr<const std::string> ply;                  ///< Null: it is taken out.
};

/// The change is made, and durable where there is a store.
struct BlockTaken {
  std::uint64_t revision = 0;
  std::vector<files::Note> notes;  ///< Of a block that was put.
};

using BlockOutcome = std::variant<BlockTaken, BlockRefusal>;

/// Makes a change and calls `done` once, now or later, from any thread. Called on an I/O thread; changes of one block take effect
/// in the order of the calls. Never refuses because too much waits: the caller bounds what it hands over.
using BlockHandler = std::function<void(BlockChange change, std::function<void(BlockOutcome)> done)>;

}  // namespace spectra::net
