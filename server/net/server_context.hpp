#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/net/block_change.hpp"
#include "server/net/connection_places.hpp"
#include "server/net/frame_receiver.hpp"
#include "server/net/host_list.hpp"
#include "server/net/http_types.hpp"
#include "server/net/message_room.hpp"
#include "server/net/net_metrics.hpp"
#include "server/net/net_options.hpp"
#include "server/net/static_files.hpp"
#include "server/net/viewer_link.hpp"

namespace spectra::net {

/// A connection as the server's staged stop sees it; both are callable from any thread.
class Stoppable {
 public:
  virtual ~Stoppable() = default;
  /// Finish politely: no new request, a close frame to a viewer.
  virtual void begin_stop() = 0;
  /// Close the socket now.
  virtual void cut() = 0;
};

/// What all connections of one server share. Outlives them.
class ServerContext {
 public:
  ServerContext(NetOptions options_in, HttpHandler http_in, ViewerClientFactory viewers_in, BlockHandler blocks_in,
                StaticFiles& files_in, NetMetrics& metrics_in)
      : options(std::move(options_in)),
        http(std::move(http_in)),
        viewers(std::move(viewers_in)),
        blocks(std::move(blocks_in)),
        files(files_in),
        metrics(metrics_in) {}

  const NetOptions options;
  const HttpHandler http;
  const ViewerClientFactory viewers;
  const BlockHandler blocks;  ///< Empty: there is no /ingest.
  /// Null: there is no /frames. Set before anything is served.
  FrameReceiver* frames = nullptr;
  StaticFiles& files;
  NetMetrics& metrics;
  HostList hosts;
  ConnectionPlaces places;

  /// Seconds for which a request from there is to wait for its turn.
  double request_delay_s(const std::string& address, double now_s) {
    const std::lock_guard lock(address_rates_mutex_);
    return request_rates_.of(address).reserve_s(now_s);
  }
  /// Seconds for which the rest of a block from there is to wait, after so many bytes more of it.
  double block_delay_s(const std::string& address, std::size_t size_bytes, double now_s) {
    const std::lock_guard lock(address_rates_mutex_);
    return block_rates_.of(address).reserve_s(now_s, static_cast<double>(size_bytes));
  }

  /// For the messages to viewers.
  const std::shared_ptr<MessageRoom> messages = std::make_shared<MessageRoom>(options.limits.queue_bytes_at_once);

  std::atomic<std::size_t> block_bytes{0};  ///< Of blocks that are being received or answered.

  /// Registers a connection for the staged stop; false when the server is stopping already.
  bool add(const std::shared_ptr<Stoppable>& connection) {
    const std::lock_guard lock(mutex_);
    if (stopping_) return false;
    connections_.insert_or_assign(connection.get(), connection);
    return true;
  }

  void remove(const Stoppable* connection) {
    const std::lock_guard lock(mutex_);
    connections_.erase(connection);
  }

  /// All live connections; from now on add() refuses further ones.
  std::vector<std::shared_ptr<Stoppable>> begin_stop() {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    return live();
  }

  bool has_connections() {
    const std::lock_guard lock(mutex_);
    return !connections_.empty();
  }

  std::vector<std::shared_ptr<Stoppable>> connections() {
    const std::lock_guard lock(mutex_);
    return live();
  }

 private:
  std::vector<std::shared_ptr<Stoppable>> live() const {
    std::vector<std::shared_ptr<Stoppable>> alive;
    for (const auto& [key, weak] : connections_) {
      if (auto connection = weak.lock()) alive.push_back(std::move(connection));
    }
    return alive;
  }

  std::mutex address_rates_mutex_;
  access::AddressRates request_rates_{options.limits.http_requests_per_s,
                                      options.limits.http_requests_per_s* options.limits.message_burst_s};
  access::AddressRates block_rates_{options.limits.block_bytes_per_s,
                                    options.limits.block_bytes_per_s* options.limits.message_burst_s};
  std::mutex mutex_;
  bool stopping_ = false;
  std::map<const Stoppable*, std::weak_ptr<Stoppable>> connections_;
};

/// A connection as the staged stop knows it, from here to the end of the scope, whatever is thrown there.
class Registration {
 public:
  Registration(ServerContext& context, const std::shared_ptr<Stoppable>& connection)
      : context_(context), connection_(connection.get()), is_taken_(context.add(connection)) {}
  ~Registration() {
    if (is_taken_) context_.remove(connection_);
  }
  Registration(const Registration&) = delete;
  Registration& operator=(const Registration&) = delete;

  /// False: the server is stopping already.
  bool is_taken() const { return is_taken_; }

 private:
  ServerContext& context_;
  const Stoppable* const connection_;
  const bool is_taken_;
};

}  // namespace spectra::net
