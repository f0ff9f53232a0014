#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/beast/core/error.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <memory>
#include <string>
#include <tuple>

#include "server/access/access_control.hpp"
#include "server/net/connection_stream.hpp"
#include "server/net/server_context.hpp"
#include "server/net/transport.hpp"

namespace spectra::net {

/// One TCP connection from its first byte: checks every request, answers HTTP, and hands an upgrade over to a
/// WebSocketSession (/ws) or an IngestSession (/ingest). Runs on its strand.
class HttpConnection final : public Stoppable, public std::enable_shared_from_this<HttpConnection> {
 public:
  /// `stream` is connected and its executor is a strand.
  HttpConnection(ConnectionStream stream, ConnectionPlaces::Place place, ServerContext& context);

  boost::asio::awaitable<void> run();

  void begin_stop() override;
  void cut() override;

 private:
  using Request = boost::beast::http::request<boost::beast::http::string_body>;

  /// Where connections are encrypted: what this peer begins with. False: the connection is of no use.
  boost::asio::awaitable<bool> begin_encryption();
  /// `is_first`: its time runs since the connection began.
  boost::asio::awaitable<bool> serve_one(bool is_first);
  /// Ends towards a peer who may still be sending, so that he sees the answer: bytes that come after a close would take it from him.
  boost::asio::awaitable<void> see_off();
  /// The connection becomes a session, or the upgrade is refused; it ends in any case.
  boost::asio::awaitable<void> serve_viewer(Request request, const RequestTarget& target);
  boost::asio::awaitable<void> serve_sender(Request request);
  boost::asio::awaitable<void> serve_frames(Request request);
  boost::asio::awaitable<void> refuse_upgrade(const Request& request, const HttpReply& reply);
  boost::asio::awaitable<HttpReply> answer(const HttpRequest& request);
  boost::asio::awaitable<bool> write(const HttpReply& reply, unsigned version, bool is_head, bool keep_alive);
  boost::asio::awaitable<void> pause(double delay_s);
  /// Waits as long as others of the address, and earlier requests, go before.
  boost::asio::awaitable<void> wait_for_turn();
  /// Tells who waits for it that the body may come.
  boost::asio::awaitable<boost::beast::error_code> ask_for_body(
      const boost::beast::http::request_parser<boost::beast::http::string_body>& parser);
  /// The rest of a request whose header was read and is good.
  boost::asio::awaitable<std::tuple<boost::beast::error_code, std::size_t>> read_body(
      boost::beast::http::request_parser<boost::beast::http::string_body>& parser);
  HttpReply static_reply(const HttpRequest& request) const;
  /// Why the request is refused before anything looks at what it asks for. Finds out who asks.
  std::optional<HttpReply> refusal_of(const Request& request);
  std::optional<HttpReply> upgrade_refusal_of(const Request& request, const std::string& subprotocol) const;

  const ConnectionPlaces::Place place_;
  Transport stream_;
  const ConnectionStream::executor_type executor_;  ///< Of the stream, which a session may have taken over.
  ServerContext& context_;
  boost::beast::flat_buffer buffer_;
  boost::asio::steady_timer turn_timer_;
  std::string local_address_;
  std::string peer_address_;
  access::AccessControl::Outcome who_;  ///< Asks now.
  bool is_from_here_ = false;           ///< The peer is on this machine.
  bool is_bare_ = false;                ///< Not encrypted where connections are to be.
  bool is_body_unread_ = false;         ///< The answer went before it had come.
  bool is_handed_over_ = false;         ///< The stream is a session's.
  bool is_stopping_ = false;
  bool is_waiting_for_request_ = false;
};

}  // namespace spectra::net
