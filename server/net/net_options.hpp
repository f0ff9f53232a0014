#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/access/access_control.hpp"

namespace spectra::net {

class TlsIdentity;

/// Every bound the network side keeps. The defaults are what is shipped; tests shorten the times.
struct NetLimits {
  std::size_t header_size_bytes = 8 * 1024;
  std::size_t body_size_bytes = 1024 * 1024;
  std::size_t block_size_bytes = std::size_t{256} * 1024 * 1024;     ///< One block that is put into the map.
  std::size_t block_bytes_at_once = std::size_t{512} * 1024 * 1024;  ///< All that are being received or answered.
  double block_bytes_per_s = 100e6;          ///< Of one address; beyond it the reading of bodies of blocks pauses.
  std::size_t ingest_sessions = 16;          ///< Senders of blocks at a time.
  std::uint64_t ingest_credit_blocks = 256;  ///< Messages of one sender that wait for their answers.
  std::uint64_t ingest_credit_bytes = std::uint64_t{32} * 1024 * 1024;  ///< Their bytes; the last may go beyond.
  std::size_t message_size_bytes = 64 * 1024;                           ///< One WebSocket message of a client.
  std::size_t control_queue_bytes = 1024 * 1024;  ///< Unsent JSON of one viewer; beyond it the viewer is cut.
  std::size_t queue_bytes_at_once = std::size_t{64} * 1024 * 1024;  ///< Of all viewers; see MessageRoom.
  std::size_t max_connections = 4096;          ///< Further ones are closed as soon as they are accepted.
  std::size_t connections_per_address = 1024;  ///< Likewise.
  double messages_per_s = 10'000;              ///< Beyond it a session's reading pauses (back-pressure).
  double message_bytes_per_s = 512 * 1024;     ///< Likewise.
  bool gives_raw_layers = true;                ///< Temperatures and visible colours of tiles, beside fused colours.
  double requests_per_s = 300;                 ///< Beyond it requests are refused with Busy.
  double http_requests_per_s = 1'000;          ///< Of one address; beyond it their reading pauses.
  std::size_t json_depth = 16;                 ///< Objects and arrays in each other, in a message of a viewer.
  std::size_t json_elements = 10'000;          ///< Values of every kind in it.
  std::size_t exports_at_once = 2;             ///< Whole files that are being made.
  std::size_t export_bytes = std::size_t{512} * 1024 * 1024;  ///< Of files that are being sent.
  std::size_t cache_bytes = std::size_t{256} * 1024 * 1024;   ///< Encoded frames that are kept for further viewers.
  std::uint64_t scene_bytes = std::uint64_t{16'000'000'000};  ///< As map_keeper.hpp counts them.
  std::size_t descriptors = 1'000'000;                        ///< As many of them as the system gives.
  double message_burst_s = 2;                                 ///< How many seconds' worth of either may come at once.
  /// A request must be complete within this; the peer sees the end well within 10 s.
  std::chrono::milliseconds header_timeout{9'500};
  std::chrono::milliseconds body_timeout{10'000};  ///< The body of a block may stand still for this long.
  /// A write may stand still for this long; with two ticks more, within which it is noticed, that is 15 s.
  std::chrono::milliseconds write_timeout{13'000};
  double download_bytes_per_s = 8'000;                  ///< A long answer must move so fast, on the whole,
  std::chrono::milliseconds download_patience{30'000};  ///< after so long.
  std::chrono::milliseconds ping_interval{4'000};
  /// A ping may go unanswered for this long while no waiting write moves either: buffers of the two kernels can take all
  /// that a viewer is owed, so that writes alone do not tell who never reads. With the interval and two ticks that is 15 s.
  std::chrono::milliseconds pong_timeout{9'000};
  std::chrono::milliseconds idle_timeout{120'000};  ///< Neither a byte read nor a byte written for this long.
  std::chrono::milliseconds close_timeout{1'500};   ///< For the peer to answer a polite close.
  std::chrono::milliseconds stop_timeout{1'500};    ///< From stop() until everything is cancelled: all ends within 2 s.
  std::chrono::milliseconds tick{1'000};            ///< How often a session looks at its deadlines.
  std::chrono::milliseconds accept_backoff{100};    ///< Pause after the descriptors ran out.
};

/// Where and how to serve.
struct NetOptions {
  std::string address = "127.0.0.1";       ///< An IPv4 or IPv6 address.
  std::uint16_t port = 8080;               ///< 0 picks a free one.
  std::vector<std::string> allowed_hosts;  ///< Host names beside loopback and the addresses listened on.
  std::shared_ptr<access::AccessControl> access = std::make_shared<access::AccessControl>();
  std::shared_ptr<TlsIdentity> tls;  ///< Loaded; every connection is encrypted. Null: none is.
  unsigned io_thread_count = 1;
  bool stop_on_signals = false;       ///< SIGINT and SIGTERM begin stop().
  std::function<void()> reload = {};  ///< What SIGHUP does; empty: what the system does.
  NetLimits limits;
};

}  // namespace spectra::net
