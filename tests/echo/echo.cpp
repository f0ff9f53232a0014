#include <CLI/CLI.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/strand.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <csignal>
#include <cstdio>
#include <memory>

#include "server/net/http_server.hpp"
#include "server/net/transport.hpp"
#include "server/net/websocket_setup.hpp"

namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = boost::beast::websocket;
using namespace spectra;

/// As conformance suites send them; a viewer's are bounded more tightly.
constexpr std::size_t kMostBytes = std::size_t{16} * 1024 * 1024;

/// One connection, until it ends.
asio::awaitable<void> echo(asio::ip::tcp::socket socket) {
  const auto ws =
      std::make_shared<websocket::stream<net::Transport>>(net::Transport(net::ConnectionStream(std::move(socket))));
  beast::get_lowest_layer(*ws).expires_never();
  net::set_up_websocket(*ws, net::NetLimits().header_timeout, "", kMostBytes);
  bool is_closing = false;
  ws->control_callback([&ws, &is_closing](websocket::frame_type kind, beast::string_view) {
    if (kind != websocket::frame_type::close || !net::has_unknown_close(*ws)) return;
    is_closing = true;
    ws->async_close(websocket::close_code::protocol_error, [ws](const beast::error_code&) {});
  });
  if (const auto [error] = co_await ws->async_accept(net::kAwait); error) co_return;
  beast::flat_buffer buffer;
  while (!is_closing) {
    const auto [read_error, size] = co_await ws->async_read(buffer, net::kAwait);
    if (read_error) co_return;
    ws->text(ws->got_text());
    const auto [write_error, written] = co_await ws->async_write(buffer.cdata(), net::kAwait);
    if (write_error) co_return;
    buffer.consume(buffer.size());
  }
}

asio::awaitable<void> accept(asio::ip::tcp::acceptor& acceptor) {
  for (;;) {
    asio::ip::tcp::socket socket(asio::make_strand(acceptor.get_executor()));
    const auto [error] = co_await acceptor.async_accept(socket, net::kAwait);
    if (error == asio::error::operation_aborted) co_return;
    if (error) continue;
    const auto executor = socket.get_executor();
    asio::co_spawn(executor, echo(std::move(socket)), asio::detached);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::string listen = "127.0.0.1:9001";
  CLI::App app("Sends back every WebSocket message that it is sent");
  app.add_option("--listen", listen, "Where to listen, ADDRESS:PORT; port 0 picks a free one")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const auto address = net::parsed_listen_address(listen);
  if (!address) {
    std::fprintf(stderr, "spectra-echo: --listen %s: ADDRESS:PORT is wanted\n", listen.c_str());
    return 2;
  }
  try {
    asio::io_context io(1);
    asio::ip::tcp::acceptor acceptor(io, {asio::ip::make_address(address->address), address->port});
    std::printf("listening on ws://%s:%u\n", address->address.c_str(), acceptor.local_endpoint().port());
    std::fflush(stdout);
    asio::signal_set signals(io, SIGINT, SIGTERM);
    signals.async_wait([&io](const beast::error_code&, int) { io.stop(); });
    asio::co_spawn(io, accept(acceptor), asio::detached);
    io.run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "spectra-echo: %s\n", error.what());
    return 1;
  }
  return 0;
}
