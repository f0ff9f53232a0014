#pragma once

#include <boost/beast/http/field.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <boost/beast/websocket/stream_base.hpp>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

namespace spectra::net {

/// What every WebSocket that the server accepts has in common. `subprotocol` is what it agrees to, empty for none; a message of more than
/// `message_max` bytes ends it (1009), 0 = of any length.
template <class Stream>
void set_up_websocket(Stream& ws, std::chrono::milliseconds handshake_timeout, std::string subprotocol,
                      std::size_t message_max) {
  namespace websocket = boost::beast::websocket;
  // Beast's own idle timeout takes a slow reader for a dead one; sessions watch progress instead.
  websocket::stream_base::timeout timeouts{};
  timeouts.handshake_timeout = handshake_timeout;
  timeouts.idle_timeout = websocket::stream_base::none();
  timeouts.keep_alive_pings = false;
  ws.set_option(timeouts);
  ws.set_option(
      websocket::stream_base::decorator([agreed = std::move(subprotocol)](websocket::response_type& response) {
        if (!agreed.empty()) response.set(boost::beast::http::field::sec_websocket_protocol, agreed);
        response.set(boost::beast::http::field::server, "Spectra");
      }));
  ws.read_message_max(message_max);
  ws.auto_fragment(false);
}

/// Whether the peer's close carries a code that RFC 6455 gives to nobody. Beast would send it back: to be answered with 1002 instead, from the
/// control callback.
template <class Stream>
bool has_unknown_close(const Stream& ws) {
  constexpr std::uint16_t kLastCode = 4999;
  return ws.reason().code > kLastCode;
}

}  // namespace spectra::net
