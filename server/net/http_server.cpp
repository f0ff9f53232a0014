#include "server/net/http_server.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include <atomic>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/host_name.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <charconv>
#include <condition_variable>
#include <csignal>
#include <exception>
#include <mutex>
#include <new>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "server/net/connection_stream.hpp"
#include "server/net/http_connection.hpp"
#include "server/net/interface_addresses.hpp"
#include "server/net/memory_reserve.hpp"
#include "server/net/server_context.hpp"
#include "server/net/static_files.hpp"

namespace spectra::net {
namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

namespace {

/// Unsent bytes the kernel may hold for a connection: more would only age there.
constexpr int kNotSentLowWaterBytes = 16 * 1024;
/// How long sent bytes may stay unacknowledged before the kernel gives a connection up.
constexpr int kUserTimeoutMs = 20'000;
/// How often the staged stop looks whether everybody has gone.
constexpr std::chrono::milliseconds kStopPoll{20};
constexpr std::chrono::milliseconds kMemoryPause{20};

std::string url_of(std::string_view scheme, const asio::ip::address& address, std::uint16_t port) {
  const std::string host = address.is_v6() ? '[' + address.to_string() + ']' : address.to_string();
  return std::string(scheme) + "://" + host + ':' + std::to_string(port);
}

bool is_shortage(const error_code& error) {
  return error == asio::error::no_descriptors || error == asio::error::no_memory ||
         error == asio::error::no_buffer_space || error.value() == ENFILE;
}

void set_socket_options(tcp::socket& socket) {
  error_code ignored;
  socket.set_option(tcp::no_delay(true), ignored);
  const int descriptor = socket.native_handle();
  setsockopt(descriptor, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &kNotSentLowWaterBytes, sizeof kNotSentLowWaterBytes);
  setsockopt(descriptor, IPPROTO_TCP, TCP_USER_TIMEOUT, &kUserTimeoutMs, sizeof kUserTimeoutMs);
}

/// Belongs to a coroutine, as its parameter: whatever way that ends, it runs no longer. One that finds no memory to wait with is taken apart by
/// Asio without a word to whoever began it.
class Running {
 public:
  explicit Running(std::atomic<bool>& is_running) : is_running_(&is_running) {}
  Running(Running&& other) noexcept : is_running_(std::exchange(other.is_running_, nullptr)) {}
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;
  Running& operator=(Running&&) = delete;
  ~Running() {
    if (is_running_ != nullptr) *is_running_ = false;
  }

 private:
  std::atomic<bool>* is_running_;
};

}  // namespace

std::optional<ListenAddress> parsed_listen_address(std::string_view text) {
  const auto colon = text.rfind(':');
  if (colon == std::string_view::npos) return std::nullopt;
  std::string_view host = text.substr(0, colon);
  const std::string_view port_text = text.substr(colon + 1);
  const bool is_bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';
  if (is_bracketed) host = host.substr(1, host.size() - 2);
  if (host == "localhost") host = "127.0.0.1";
  error_code error;
  const auto address = asio::ip::make_address(std::string(host), error);
  if (error || address.is_v6() != is_bracketed) return std::nullopt;
  ListenAddress listen{address.to_string(), 0};
  const auto [end, parse_error] = std::from_chars(port_text.data(), port_text.data() + port_text.size(), listen.port);
  if (port_text.empty() || parse_error != std::errc{} || end != port_text.data() + port_text.size()) {
    return std::nullopt;
  }
  return listen;
}

bool is_loopback(const ListenAddress& listen) {
  error_code error;
  return asio::ip::make_address(listen.address, error).is_loopback() && !error;
}

struct HttpServer::State {
  State(NetOptions options, HttpHandler http, ViewerClientFactory viewers, std::filesystem::path web_root,
        BlockHandler blocks)
      : files(std::move(web_root)),
        context(std::move(options), std::move(http), std::move(viewers), std::move(blocks), files, metrics),
        io(static_cast<int>(context.options.io_thread_count)),
        acceptor(asio::make_strand(io)),
        accept_timer(acceptor.get_executor()),
        signals(acceptor.get_executor()),
        hangups(acceptor.get_executor()) {}

  void listen();
  /// To be called again and again: begins to accept, or to stop, also where that has ended for lack of memory, and fills the reserve.
  /// Thread-safe.
  void keep_going();
  asio::awaitable<void> accept_connections(Running running);
  /// What is short, in words; empty when nothing is.
  asio::awaitable<std::string> accept_one();
  asio::awaitable<void> stop_in_stages(Running running);
  /// Says why, as far as the peer takes it at once, and closes.
  void refuse(tcp::socket& socket, std::string_view why);
  void begin_stop();
  void reload_on_hangup();

  NetMetrics metrics;
  StaticFiles files;
  ServerContext context;
  asio::io_context io;
  /// Until it stops: nobody may be waited for, for a moment, when memory is short.
  std::optional<asio::executor_work_guard<asio::io_context::executor_type>> running_work{asio::make_work_guard(io)};
  tcp::acceptor acceptor;
  asio::steady_timer accept_timer;
  asio::signal_set signals;
  asio::signal_set hangups;
  tcp::endpoint endpoint;
  std::atomic<bool> is_stopping = false;
  std::atomic<bool> is_accepting = false, is_ending = false;
};

void HttpServer::State::listen() {
  const auto& options = context.options;
  endpoint = {asio::ip::make_address(options.address), options.port};
  error_code error;
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error && endpoint.address().is_v6()) acceptor.set_option(asio::ip::v6_only(false), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(tcp::acceptor::max_listen_connections, error);
  if (error) {
    const std::string where = options.address + ':' + std::to_string(options.port);
    if (error == asio::error::address_in_use) {
      throw std::runtime_error("cannot listen on " + where + ": the port is in use; choose another with --listen");
    }
    throw std::runtime_error("cannot listen on " + where + ": " + error.message());
  }
  endpoint = acceptor.local_endpoint();
  if (endpoint.address().is_unspecified()) {
    for (const auto& address : interface_addresses(endpoint.address().is_v6())) {
      context.hosts.add(address.to_string());
    }
  } else {
    context.hosts.add(endpoint.address().to_string());
  }
  context.hosts.add_machine(asio::ip::host_name(error));
  for (const auto& name : options.allowed_hosts) {
    if (!context.hosts.add(name)) throw std::runtime_error("not a host name: " + name);
  }
}

void HttpServer::State::refuse(tcp::socket& socket, std::string_view why) {
  metrics.connections_refused += 1;
  error_code ignored;
  if (!context.options.tls) {
    const std::string answer = "HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\nContent-Length: " +
                               std::to_string(why.size() + 1) + "\r\nRetry-After: 1\r\nConnection: close\r\n\r\n" +
                               std::string(why) + '\n';
    socket.non_blocking(true, ignored);
    socket.write_some(asio::buffer(answer), ignored);
  }
  socket.shutdown(tcp::socket::shutdown_send, ignored);
}

asio::awaitable<void> HttpServer::State::accept_connections(Running /*while it is there*/) {
  bool was_short = false;
  while (!is_stopping) {
    std::string shortage;
    try {
      shortage = co_await accept_one();
      if (shortage.empty()) {
        was_short = false;
        continue;
      }
      if (!std::exchange(was_short, true)) spdlog::warn("cannot accept connections for the moment: {}", shortage);
      accept_timer.expires_after(context.options.limits.accept_backoff);
      co_await accept_timer.async_wait(kAwait);
    } catch (const std::bad_alloc&) {
      // It costs a connection, or not even that; whoever has memory needs a moment to give it back.
      metrics.accept_failures += 1;
      std::this_thread::sleep_for(kMemoryPause);
    }
  }
}

asio::awaitable<std::string> HttpServer::State::accept_one() {
  const NetLimits& limits = context.options.limits;
  tcp::socket socket(asio::make_strand(io));
  const auto [error] = co_await acceptor.async_accept(socket, kAwait);
  if (is_stopping) co_return "";
  if (error) {
    // Else the peer was gone before it was accepted; the next one is none the worse for it.
    if (!is_shortage(error)) co_return "";
    metrics.accept_failures += 1;
    co_return error.message();
  }
  metrics.connections_accepted += 1;
  if (metrics.connections_open >= static_cast<std::int64_t>(limits.max_connections)) {
    refuse(socket, "too many connections");
    co_return "";
  }
  if (!refill_memory_reserve()) {
    refuse(socket, "out of memory");
    co_return "there is no memory for more";
  }
  try {
    error_code unknown;
    const auto address = socket.remote_endpoint(unknown).address().to_string();
    auto place = context.places.take(access::who_counts(address), limits.connections_per_address);
    if (!place) {
      refuse(socket, "too many connections from your address");
      co_return "";
    }
    set_socket_options(socket);
    const auto executor = socket.get_executor();
    const auto connection =
        std::make_shared<HttpConnection>(ConnectionStream(std::move(socket)), std::move(*place), context);
    asio::co_spawn(executor, connection->run(), asio::detached);
  } catch (const std::bad_alloc&) {
    metrics.connections_refused += 1;  // It costs this connection.
  }
  co_return "";
}

void HttpServer::State::keep_going() {
  // Those who are there take of the reserve, too, whether anybody comes or not.
  refill_memory_reserve();
  const auto keep = [this](std::atomic<bool>& is_running, auto coroutine) {
    if (is_running.exchange(true)) return;
    asio::co_spawn(acceptor.get_executor(), (this->*coroutine)(Running(is_running)), asio::detached);
  };
  if (is_stopping) {
    keep(is_ending, &State::stop_in_stages);
  } else {
    keep(is_accepting, &State::accept_connections);
  }
}

asio::awaitable<void> HttpServer::State::stop_in_stages(Running /*while it is there*/) {
  error_code ignored;
  acceptor.close(ignored);
  accept_timer.cancel();
  signals.cancel(ignored);
  hangups.cancel(ignored);
  for (const auto& connection : context.begin_stop()) connection->begin_stop();
  const auto deadline = std::chrono::steady_clock::now() + context.options.limits.stop_timeout;
  asio::steady_timer timer(acceptor.get_executor());
  while (context.has_connections()) {
    if (std::chrono::steady_clock::now() >= deadline) {
      for (const auto& connection : context.connections()) connection->cut();
      timer.expires_after(kStopPoll);
      co_await timer.async_wait(kAwait);
      // Whoever waits for an answer that is still being computed waits no longer.
      io.stop();
      co_return;
    }
    timer.expires_after(kStopPoll);
    co_await timer.async_wait(kAwait);
  }
  running_work.reset();
}

void HttpServer::State::begin_stop() {
  is_stopping = true;
  keep_going();
}

void HttpServer::State::reload_on_hangup() {
  hangups.async_wait([this](const error_code& error, int) {
    if (error) return;
    context.options.reload();
    reload_on_hangup();
  });
}

HttpServer::HttpServer(NetOptions options, HttpHandler http, ViewerClientFactory viewers,
                       std::filesystem::path web_root, BlockHandler blocks)
    : state_(std::make_unique<State>(std::move(options), std::move(http), std::move(viewers), std::move(web_root),
                                     std::move(blocks))) {
  state_->listen();
}

HttpServer::~HttpServer() = default;

void HttpServer::set_frame_receiver(FrameReceiver& receiver) {
  state_->context.frames = &receiver;
}

void HttpServer::run() {
  State& state = *state_;
  if (state.context.options.stop_on_signals) {
    state.signals.add(SIGINT);
    state.signals.add(SIGTERM);
    state.signals.async_wait([&state](const error_code& error, int) {
      if (!error) state.begin_stop();
    });
  }
  if (state.context.options.reload) {
    state.hangups.add(SIGHUP);
    state.reload_on_hangup();
  }
  state.keep_going();
  // Coroutines that were lost are begun anew by a thread that needs no memory to wait.
  const std::jthread keeper([&state](const std::stop_token& is_over) {
    std::mutex mutex;
    std::condition_variable_any over;
    std::unique_lock lock(mutex);
    while (!over.wait_for(lock, is_over, state.context.options.limits.tick, [&] { return is_over.stop_requested(); })) {
      try {
        state.keep_going();
      } catch (const std::bad_alloc&) {
        // There may be some at the next tick.
      }
    }
  });
  const auto work = [&state] {
    for (;;) {
      try {
        return static_cast<void>(state.io.run());
      } catch (const std::exception& error) {
        // Of one connection, or of none: the others go on, after a moment in which memory may be given back.
        spdlog::error("something on the network failed: {}", error.what());
        std::this_thread::sleep_for(kMemoryPause);
      }
    }
  };
  std::vector<std::jthread> threads;
  for (unsigned i = 1; i < state.context.options.io_thread_count; ++i) threads.emplace_back(work);
  work();
}

void HttpServer::stop() {
  asio::post(state_->acceptor.get_executor(), [this] { state_->begin_stop(); });
}

std::uint16_t HttpServer::port() const {
  return state_->endpoint.port();
}

std::vector<std::string> HttpServer::urls() const {
  const auto& endpoint = state_->endpoint;
  const std::string_view scheme = state_->context.options.tls ? "https" : "http";
  if (!endpoint.address().is_unspecified()) return {url_of(scheme, endpoint.address(), endpoint.port())};
  std::vector<std::string> urls;
  for (const auto& address : interface_addresses(endpoint.address().is_v6())) {
    urls.push_back(url_of(scheme, address, endpoint.port()));
  }
  return urls;
}

const NetMetrics& HttpServer::metrics() const {
  return state_->metrics;
}

}  // namespace spectra::net
