#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "protocol/messages/ingest_messages.hpp"

namespace spectra::net {

/// Where blocks are sent to.
struct IngestAddress {
  std::string host;  ///< Without brackets.
  std::string port;
  std::string path;  ///< Ends in /ingest.
  bool is_encrypted = false;

  std::string url() const;        ///< Without the path.
  std::string authority() const;  ///< As in a URL.
};

/// Reads http://HOST[:PORT][/FOLDER] or https://; ws:// and wss:// are the same. A sentence when it is none.
std::variant<IngestAddress, std::string> parsed_ingest_address(std::string_view url);

/// A block that is about to be sent.
struct OutgoingBlock {
  std::string target;  ///< As docs/protocol.md, "A stream of blocks", has it.
  std::string ply;     ///< Empty: the block is to be taken out.
};

/// What is sent; all functions are called by send_blocks, in its thread.
struct BlocksToSend {
  std::size_t count = 0;
  /// The block number `index`, again when it has to be sent again. Nothing: it is left out.
  std::function<std::optional<OutgoingBlock>(std::size_t index, std::uint64_t max_block_bytes)> read;
  std::function<void(std::size_t index, const protocol::IngestAcknowledged&)> acknowledged;
  std::function<void(std::size_t index, const protocol::IngestRefused&)> refused;
  /// The link is broken; it is tried again.
  std::function<void(const std::string& why)> broken;
};

struct SendingLimits {
  std::optional<double> blocks_per_s;
  std::string token;  ///< Shown to the server; empty: none.
  /// PEM file of those whose certificates are trusted, or of the server's own; empty: whom this machine trusts.
  std::string trusted;
  std::chrono::milliseconds connect_timeout{10'000};
  std::chrono::milliseconds silence{15'000};   ///< The server pings every 4 s.
  std::chrono::milliseconds patience{30'000};  ///< A broken link is tried again for this long.
};

/// Sends blocks in their order, within the credit, and waits until each is answered; over a new connection what was not, when a link
/// breaks. Blocks whose answer is that the server is busy are sent again. Nothing when all are answered, else a sentence: the
/// server was not there to begin with, does not take blocks, or did not come back.
std::optional<std::string> send_blocks(const IngestAddress& to, const BlocksToSend& blocks,
                                       const SendingLimits& limits);

}  // namespace spectra::net
