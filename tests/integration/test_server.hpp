#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "server/net/http_server.hpp"

namespace spectra::tests {

/// Options for a server of a test: a free port, short times.
inline net::NetOptions quick_options() {
  net::NetOptions options;
  options.port = 0;
  options.limits.header_timeout = std::chrono::milliseconds(300);
  options.limits.write_timeout = std::chrono::milliseconds(300);
  options.limits.close_timeout = std::chrono::milliseconds(200);
  options.limits.stop_timeout = std::chrono::milliseconds(500);
  options.limits.tick = std::chrono::milliseconds(20);
  return options;
}

/// Runs a server in a thread of its own and stops it in the end.
class TestServer {
 public:
  TestServer(net::NetOptions options, net::HttpHandler http, net::ViewerClientFactory viewers,
             std::filesystem::path web_root = {}, net::BlockHandler blocks = {})
      : server_(std::move(options), std::move(http), std::move(viewers), std::move(web_root), std::move(blocks)),
        thread_([this] { server_.run(); }) {}
  ~TestServer() { stop(); }

  void stop() {
    if (!thread_.joinable()) return;
    server_.stop();
    thread_.join();
  }

  std::uint16_t port() const { return server_.port(); }
  const net::NetMetrics& metrics() const { return server_.metrics(); }

 private:
  net::HttpServer server_;
  std::thread thread_;
};

/// Waits until a condition that another thread brings about holds; false after `timeout`.
inline bool eventually(const std::function<bool()>& holds,
                       std::chrono::milliseconds timeout = std::chrono::seconds(10)) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (!holds()) {
    if (std::chrono::steady_clock::now() >= deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

}  // namespace spectra::tests
