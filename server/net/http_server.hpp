#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/net/block_change.hpp"
#include "server/net/frame_receiver.hpp"
#include "server/net/http_types.hpp"
#include "server/net/net_metrics.hpp"
#include "server/net/net_options.hpp"
#include "server/net/viewer_link.hpp"

namespace spectra::net {

/// An address to listen on as people write it: "127.0.0.1:8080", "[::1]:0", "localhost:8080".
struct ListenAddress {
  std::string address;
  std::uint16_t port = 0;
};

/// Nobody but this machine reaches it.
bool is_loopback(const ListenAddress& listen);

/// Reads a ListenAddress; nothing when it is none.
std::optional<ListenAddress> parsed_listen_address(std::string_view text);

/// HTTP and WebSocket on one port. Everything runs on the threads that are inside run(); nothing computes there.
class HttpServer {
 public:
  /// Opens the port; connections wait in the kernel until run(). Throws std::runtime_error with one clear sentence when
  /// it cannot. `web_root` may be empty. `viewers`, `http` and `blocks` are called from I/O threads; without
  /// `blocks` there is no /ingest.
  HttpServer(NetOptions options, HttpHandler http, ViewerClientFactory viewers, std::filesystem::path web_root,
             BlockHandler blocks = {});
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// Takes frames over /frames from now on. Before run(); `receiver` outlives it.
  void set_frame_receiver(FrameReceiver& receiver);

  /// Serves until stop(), with NetOptions::io_thread_count threads, the caller's among them.
  void run();

  /// Staged stop, from any thread: accepts nothing more, closes politely, and cancels what is left at the deadline.
  void stop();

  std::uint16_t port() const;

  /// "http://ADDRESS:PORT" for every address the server can be reached at, the one to show first in front.
  std::vector<std::string> urls() const;

  const NetMetrics& metrics() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace spectra::net
