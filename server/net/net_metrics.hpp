#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "server/access/role.hpp"

namespace spectra::net {

/// What the network side counts, for /metrics. Written from the I/O threads, read from anywhere.
struct NetMetrics {
  std::atomic<std::uint64_t> connections_accepted{0};
  std::atomic<std::int64_t> connections_open{0};
  std::atomic<std::uint64_t> accept_failures{0};      ///< Descriptors or memory ran out.
  std::atomic<std::uint64_t> connections_refused{0};  ///< Over max_connections.
  std::atomic<std::uint64_t> handshakes_failed{0};    ///< Of TLS.
  std::atomic<std::uint64_t> requests{0};             ///< HTTP, upgrades included.
  std::atomic<std::uint64_t> requests_delayed{0};     ///< Of an address that asks, or sends, too much.
  std::atomic<std::uint64_t> requests_refused{0};     ///< Answered with 4xx.
  std::atomic<std::int64_t> viewers{0};               ///< WebSocket sessions now.
  std::atomic<std::uint64_t> viewers_total{0};
  std::atomic<std::uint64_t> viewers_cut{0};  ///< Ended by a deadline or a full queue.
  std::atomic<std::uint64_t> messages_received{0};
  std::atomic<std::uint64_t> messages_sent{0};
  std::atomic<std::uint64_t> frames_sent{0};
  std::atomic<std::uint64_t> frame_bytes_sent{0};
  std::atomic<std::int64_t> senders{0};           ///< Sessions of /ingest now.
  std::atomic<std::uint64_t> blocks_received{0};  ///< Over /ingest.
  std::atomic<std::uint64_t> block_bytes_received{0};
  std::atomic<std::uint64_t> blocks_refused{0};

  /// Of the viewers of one role.
  struct OfRole {
    std::atomic<std::int64_t> viewers{0};  ///< Now.
    std::atomic<std::uint64_t> viewers_cut{0};
    std::atomic<std::uint64_t> frames_sent{0};
    std::atomic<std::uint64_t> frame_bytes_sent{0};
    std::atomic<std::int64_t> queued_bytes{0};  ///< Messages that wait now, without what is shared of them.
  };
  OfRole& of(access::AccessRole role) { return of_role_[static_cast<std::size_t>(role)]; }
  const OfRole& of(access::AccessRole role) const { return of_role_[static_cast<std::size_t>(role)]; }

 private:
  std::array<OfRole, access::kRoles.size()> of_role_;
};

}  // namespace spectra::net
