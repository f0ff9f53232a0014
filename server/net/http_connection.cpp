#include "server/net/http_connection.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/detect_ssl.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/error.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/serializer.hpp>
#include <boost/beast/http/span_body.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <exception>
#include <optional>
#include <utility>

#include "protocol/frame_message.hpp"
#include "protocol/ingest_message.hpp"
#include "server/net/block_refusal.hpp"
#include "server/net/block_room.hpp"
#include "server/net/frames_session.hpp"
#include "server/net/ingest_session.hpp"
#include "server/net/request_right.hpp"
#include "server/net/session_api.hpp"
#include "server/net/steady_seconds.hpp"
#include "server/net/tls_identity.hpp"
#include "server/net/websocket_session.hpp"

namespace spectra::net {
namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using boost::system::error_code;

namespace {

constexpr std::string_view kContentSecurityPolicy =
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; connect-src 'self'; "
    "img-src 'self' data: blob:; style-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";

constexpr std::string_view kNoWebClient =
    "<!doctype html><meta charset=utf-8><title>Spectra</title><h1>Spectra</h1>"
    "<p>The server runs, but its web client is not built. Build it with <code>npm ci &amp;&amp; npm run build</code> "
    "in the folder <code>web</code>, or name a built one with <code>spectra serve --web DIR</code>, and load this page "
    "again.</p>";

std::string_view view(beast::string_view text) {
  return {text.data(), text.size()};
}

/// What is wrong with a request, in the form that its path has for errors: JSON where programs ask.
HttpReply refused_request(std::string_view target, unsigned status, const std::string& reason) {
  if (!target.starts_with("/api/")) return text_reply(status, reason + "\n");
  const std::string code = status == 405   ? "method_not_allowed"
                           : status == 413 ? "too_large"
                           : status == 431 ? "header_too_large"
                                           : "bad_request";
  return refused({status, code, status == 400 ? "target" : "", reason, ""});
}

std::size_t count_of(const http::fields& fields, http::field name) {
  const auto [begin, end] = fields.equal_range(name);
  return static_cast<std::size_t>(std::distance(begin, end));
}

/// The values of a header, which may be there several times.
std::string joined(const http::fields& fields, http::field name) {
  std::string all;
  const auto [begin, end] = fields.equal_range(name);
  for (auto it = begin; it != end; ++it) {
    if (it != begin) all += ',';
    all += view(it->value());
  }
  return all;
}

/// What an upgrade asks hello to hold; nothing for a word that means nothing.
std::optional<HelloForm> hello_form_of(const RequestTarget& target) {
  HelloForm form = HelloForm::Full;
  for (const auto& [name, value] : target.query) {
    if (name != "hello") continue;
    if (value != "full" && value != "brief") return std::nullopt;
    form = value == "brief" ? HelloForm::Brief : HelloForm::Full;
  }
  return form;
}

bool is_loopback(const asio::ip::address& address) {
  if (address.is_loopback()) return true;
  return address.is_v6() && address.to_v6().is_v4_mapped() &&
         asio::ip::make_address_v4(asio::ip::v4_mapped, address.to_v6()).is_loopback();
}

/// None, or chunked alone.
bool is_transfer_coding_known(const http::fields& headers) {
  const auto count = headers.count(http::field::transfer_encoding);
  return count == 0 || (count == 1 && beast::iequals(headers[http::field::transfer_encoding], "chunked"));
}

/// PUT or DELETE of a block of the map.
bool is_block_change(const http::request<http::string_body>& request) {
  return (request.method() == http::verb::put || request.method() == http::verb::delete_) &&
         view(request.target()).starts_with(std::string(kBlocksPath) + '/');
}

/// 16 bytes in base64.
bool is_key(std::string_view text) {
  const auto is_digit = [](char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '+' || c == '/';
  };
  return text.size() == 24 && text.ends_with("==") && std::all_of(text.begin(), text.end() - 2, is_digit);
}

std::string_view path_of(std::string_view target) {
  return target.substr(0, target.find('?'));
}

/// Logging in or out, and letting others in.
bool is_session_change(const http::request<http::string_body>& request) {
  const auto path = path_of(view(request.target()));
  return (request.method() == http::verb::post || request.method() == http::verb::delete_) &&
         (path == kSessionPath || path == kCodesPath);
}

/// What was sent in the clear to a server whose connections are encrypted.
HttpReply encrypted_elsewhere(const http::request<http::string_body>& request, std::string_view host) {
  if (request.method() != http::verb::get && request.method() != http::verb::head) {
    return text_reply(403, "this server is spoken to with https:// and wss://\n");
  }
  auto reply = text_reply(308, "this server is spoken to with https:// and wss://\n");
  reply.headers.emplace_back("Location", "https://" + std::string(host) + std::string(view(request.target())));
  return reply;
}

/// A token or a role.
constexpr std::size_t kSessionBodyBytes = 1024;
/// What a body is ahead of its rate by before its reading pauses.
constexpr double kLeastPause_s = 0.02;
/// For a peer who is refused while he is sending.
constexpr std::chrono::seconds kFarewell{1};
constexpr std::size_t kFarewellBytes = std::size_t{4} << 20U;

/// Counts a sender of blocks, as long as it is there.
class SenderPlace {
 public:
  explicit SenderPlace(ServerContext& context) : senders_(context.metrics.senders), count_(++senders_) {}
  ~SenderPlace() { --senders_; }
  SenderPlace(const SenderPlace&) = delete;
  SenderPlace& operator=(const SenderPlace&) = delete;

  std::int64_t count() const { return count_; }

 private:
  std::atomic<std::int64_t>& senders_;
  const std::int64_t count_;
};

/// Counts a connection, as long as it is there.
class OpenConnection {
 public:
  explicit OpenConnection(std::atomic<std::int64_t>& count) : count_(count) { ++count_; }
  ~OpenConnection() { --count_; }
  OpenConnection(const OpenConnection&) = delete;
  OpenConnection& operator=(const OpenConnection&) = delete;

 private:
  std::atomic<std::int64_t>& count_;
};

/// Where a handler leaves its answer; outlives both the connection and the handler.
struct PendingReply {
  explicit PendingReply(const asio::any_io_executor& executor)
      : arrived(executor, asio::steady_timer::time_point::max()) {}
  std::optional<HttpReply> reply;
  asio::steady_timer arrived;
};

/// Posts the answer to the connection's strand; without one when the handler drops it.
class ReplyOnce {
 public:
  explicit ReplyOnce(std::shared_ptr<PendingReply> pending) : pending_(std::move(pending)) {}
  ~ReplyOnce() {
    if (!is_done_) give(text_reply(503, "not answered\n"));
  }
  ReplyOnce(const ReplyOnce&) = delete;
  ReplyOnce& operator=(const ReplyOnce&) = delete;

  void give(HttpReply reply) {
    is_done_ = true;
    asio::post(pending_->arrived.get_executor(), [pending = pending_, reply = std::move(reply)]() mutable {
      pending->reply = std::move(reply);
      pending->arrived.cancel();
    });
  }

 private:
  std::shared_ptr<PendingReply> pending_;
  bool is_done_ = false;
};

}  // namespace

HttpConnection::HttpConnection(ConnectionStream stream, ConnectionPlaces::Place place, ServerContext& context)
    : place_(std::move(place)),
      stream_(std::move(stream)),
      executor_(stream_.get_executor()),
      context_(context),
      buffer_(64 * 1024),
      turn_timer_(executor_) {}

asio::awaitable<void> HttpConnection::run() {
  const auto self = shared_from_this();
  error_code error;
  const auto& socket = stream_.next_layer().socket();
  local_address_ = socket.local_endpoint(error).address().to_string();
  const auto peer = socket.remote_endpoint(error).address();
  peer_address_ = peer.to_string();
  is_from_here_ = is_loopback(peer);
  const OpenConnection open(context_.metrics.connections_open);
  try {
    const Registration registration(context_, self);
    if (registration.is_taken()) {
      stream_.next_layer().expires_after(context_.options.limits.header_timeout);
      bool goes_on = co_await begin_encryption();
      for (bool is_first = true; goes_on; is_first = false) goes_on = co_await serve_one(is_first);
      if (is_body_unread_ && !is_handed_over_ && !is_stopping_) co_await see_off();
    }
  } catch (const std::exception& failure) {
    spdlog::error("a connection failed: {}", failure.what());
  }
  if (!is_handed_over_) stream_.next_layer().close();
}

asio::awaitable<bool> HttpConnection::begin_encryption() {
  if (!context_.options.tls) co_return true;
  is_waiting_for_request_ = true;
  const auto [error, is_tls] = co_await beast::async_detect_ssl(stream_.next_layer(), buffer_, kAwait);
  is_waiting_for_request_ = false;
  if (error || is_stopping_) co_return false;
  is_bare_ = !is_tls;
  if (is_bare_) co_return true;
  const auto failure = co_await stream_.accept_handshake(context_.options.tls->current(), buffer_.data());
  buffer_.clear();
  if (!failure) co_return !is_stopping_;
  context_.metrics.handshakes_failed += 1;
  spdlog::debug("{}: no encryption: {}", peer_address_, failure.message());
  co_return false;
}

asio::awaitable<void> HttpConnection::see_off() {
  error_code failed;
  stream_.next_layer().socket().shutdown(asio::ip::tcp::socket::shutdown_send, failed);
  stream_.next_layer().expires_after(kFarewell);
  for (std::size_t left = kFarewellBytes; !failed && left > 0;) {
    buffer_.clear();
    const auto [error, size] =
        co_await stream_.next_layer().async_read_some(buffer_.prepare(std::min(left, buffer_.max_size())), kAwait);
    failed = error;
    left -= size;
  }
}

asio::awaitable<bool> HttpConnection::serve_one(bool is_first) {
  const NetLimits& limits = context_.options.limits;
  http::request_parser<http::string_body> parser;
  parser.header_limit(static_cast<std::uint32_t>(limits.header_size_bytes));
  parser.body_limit(std::max(limits.body_size_bytes, limits.block_size_bytes));

  if (!is_first) stream_.next_layer().expires_after(limits.header_timeout);
  is_waiting_for_request_ = true;
  auto [error, size] = co_await http::async_read_header(stream_, buffer_, parser, kAwait);
  is_waiting_for_request_ = false;
  // Who only ends the connection asks for nothing.
  if (parser.got_some()) co_await wait_for_turn();
  if (is_stopping_) co_return false;
  const bool is_read_method = parser.get().method() == http::verb::get || parser.get().method() == http::verb::head;
  const bool is_change = is_block_change(parser.get());
  const bool is_session = is_session_change(parser.get());
  const std::size_t largest_body = is_change    ? limits.block_size_bytes
                                   : is_session ? kSessionBodyBytes
                                                : limits.body_size_bytes;
  if (!error) {
    // A body whose end others see elsewhere would let requests be smuggled in.
    if (!is_transfer_coding_known(parser.get())) error = http::error::bad_transfer_encoding;
    if (parser.content_length().value_or(0) > largest_body) error = http::error::body_limit;
    parser.body_limit(largest_body);
  }
  std::optional<HttpReply> refusal;
  if (!error) refusal = refusal_of(parser.get());
  std::optional<BlockRoom> room;
  if (!error && is_change && !refusal) {
    const auto most_bytes =
        static_cast<std::size_t>(parser.content_length().value_or(parser.chunked() ? limits.block_size_bytes : 0));
    room.emplace(context_, most_bytes);
    if (!room->is_there()) {
      context_.metrics.requests_refused += 1;
      is_body_unread_ = true;
      const auto busy = refused({503, "busy", "", "too many bytes of blocks are being received",
                                 std::to_string(limits.block_bytes_at_once) + " bytes at once"});
      co_return co_await write(busy, 11, false, false);
    }
    // Copying what has come into a larger place would keep everybody waiting. Memory is taken as it is filled.
    parser.get().body().reserve(most_bytes);
    std::tie(error, size) = co_await read_body(parser);
  }
  if (!error && is_session && !refusal) std::tie(error, size) = co_await read_body(parser);
  if (!error && is_read_method && !parser.is_done()) {
    // Nobody needs it, but the next request stands behind it; all within the time for the header.
    error = co_await ask_for_body(parser);
    if (!error) std::tie(error, size) = co_await http::async_read(stream_, buffer_, parser, kAwait);
  }
  const bool is_syntax_error = error.category() == http::make_error_code(http::error::bad_method).category() &&
                               error != http::error::end_of_stream && error != http::error::partial_message;
  if (error && !is_syntax_error) co_return false;
  context_.metrics.requests += 1;
  is_body_unread_ = !parser.is_done();
  if (error) {
    context_.metrics.requests_refused += 1;
    if (is_change && error == http::error::body_limit) {
      const auto too_large = refused({413, "too_large", "body", "the block is larger than a block may be",
                                      std::to_string(limits.block_size_bytes) + " bytes"});
      co_return co_await write(too_large, 11, false, false);
    }
    const unsigned status = error == http::error::header_limit || error == http::error::buffer_overflow ? 431U
                            : error == http::error::body_limit                                          ? 413U
                                                                                                        : 400U;
    co_return co_await write(refused_request(view(parser.get().target()), status, error.message()), 11, false, false);
  }

  Request request = parser.release();
  const bool is_head = request.method() == http::verb::head;
  if (refusal) {
    context_.metrics.requests_refused += 1;
    co_return co_await write(*refusal, request.version(), is_head, request.keep_alive() && is_read_method);
  }
  if (is_change) {
    auto body = std::make_shared<const std::string>(std::move(request.body()));
    const HttpRequest change{.target = *parsed_target(view(request.target())),
                             .method = request.method() == http::verb::put ? HttpMethod::Put : HttpMethod::Delete,
                             .body = std::move(body)};
    const HttpReply reply = co_await answer(change);
    co_return co_await write(reply, request.version(), false, request.keep_alive() && !is_stopping_);
  }
  auto target = *parsed_target(view(request.target()));

  if (target.path == kSessionPath || target.path == kCodesPath) {
    using Method = SessionRequest::Method;
    const SessionRequest asked{.path = target.path,
                               .method = request.method() == http::verb::post      ? Method::Post
                                         : request.method() == http::verb::delete_ ? Method::Delete
                                                                                   : Method::Get,
                               .body = request.body(),
                               .address = peer_address_,
                               .is_secure = stream_.is_encrypted()};
    const HttpReply reply = session_reply(*context_.options.access, who_.identity, asked, steady_seconds());
    if (reply.status >= 400) {
      context_.metrics.requests_refused += 1;
      spdlog::info("{} is not let in: {}", peer_address_, reply.status);
    }
    co_return co_await write(reply, request.version(), is_head, request.keep_alive() && !is_stopping_);
  }
  if (target.path == "/ws") {
    co_await serve_viewer(std::move(request), target);
    co_return false;
  }
  if (target.path == "/ingest" && context_.blocks) {
    co_await serve_sender(std::move(request));
    co_return false;
  }

  if (target.path == "/frames" && context_.frames != nullptr) {
    co_await serve_frames(std::move(request));
    co_return false;
  }

  const HttpRequest checked{std::move(target), joined(request, http::field::if_none_match),
                            joined(request, http::field::accept_encoding)};
  const HttpReply reply = co_await answer(checked);
  co_return co_await write(reply, request.version(), is_head, request.keep_alive() && !is_stopping_);
}

asio::awaitable<void> HttpConnection::serve_viewer(Request request, const RequestTarget& target) {
  const auto form = hello_form_of(target);
  auto refused = upgrade_refusal_of(request, "spectra.v1");
  if (!refused && !form) refused = text_reply(400, "hello in the query must be full or brief\n");
  if (refused) {
    co_await refuse_upgrade(request, *refused);
    co_return;
  }
  is_handed_over_ = true;
  const auto session = std::make_shared<WebSocketSession>(std::move(stream_), context_, *form, *who_.identity);
  context_.remove(this);
  co_await session->run(std::move(request));
}

asio::awaitable<void> HttpConnection::serve_sender(Request request) {
  const SenderPlace place(context_);
  const std::size_t most = context_.options.limits.ingest_sessions;
  auto refused = upgrade_refusal_of(request, protocol::kIngestProtocol);
  if (!refused && place.count() > static_cast<std::int64_t>(most)) {
    refused =
        text_reply(503, "too many senders of blocks are connected already: " + std::to_string(most) + " may be\n");
    refused->headers.emplace_back("Retry-After", "1");
  }
  if (refused) {
    co_await refuse_upgrade(request, *refused);
    co_return;
  }
  is_handed_over_ = true;
  const auto session = std::make_shared<IngestSession>(std::move(stream_), context_, *who_.identity);
  context_.remove(this);
  co_await session->run(std::move(request));
}

asio::awaitable<void> HttpConnection::serve_frames(Request request) {
  auto refused = upgrade_refusal_of(request, protocol::kFramesProtocol);
  if (!refused) {
    if (const auto refusal = context_.frames->begin()) refused = net::refused(*refusal);
  }
  if (refused) {
    co_await refuse_upgrade(request, *refused);
    co_return;
  }
  is_handed_over_ = true;
  std::shared_ptr<FramesSession> session;
  try {
    session = std::make_shared<FramesSession>(std::move(stream_), context_, *context_.frames, *who_.identity);
  } catch (...) {
    context_.frames->end();  // For the next robot.
    throw;
  }
  context_.remove(this);
  co_await session->run(std::move(request));
}

asio::awaitable<void> HttpConnection::refuse_upgrade(const Request& request, const HttpReply& reply) {
  context_.metrics.requests_refused += 1;
  co_await write(reply, request.version(), request.method() == http::verb::head, false);
}

asio::awaitable<void> HttpConnection::pause(double delay_s) {
  stream_.next_layer().expires_never();
  turn_timer_.expires_after(
      std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(delay_s)));
  co_await turn_timer_.async_wait(kAwait);
}

asio::awaitable<void> HttpConnection::wait_for_turn() {
  const double delay_s = context_.request_delay_s(peer_address_, steady_seconds());
  if (delay_s <= 0 || is_stopping_) co_return;
  context_.metrics.requests_delayed += 1;
  co_await pause(delay_s);
  stream_.next_layer().expires_after(context_.options.limits.header_timeout);
}

asio::awaitable<error_code> HttpConnection::ask_for_body(const http::request_parser<http::string_body>& parser) {
  if (parser.is_done() || !beast::iequals(parser.get()[http::field::expect], "100-continue")) co_return error_code{};
  static constexpr std::string_view kContinue = "HTTP/1.1 100 Continue\r\n\r\n";
  const auto [error, size] = co_await asio::async_write(stream_, asio::buffer(kContinue), kAwait);
  co_return error;
}

asio::awaitable<std::tuple<error_code, std::size_t>> HttpConnection::read_body(
    http::request_parser<http::string_body>& parser) {
  stream_.next_layer().expires_after(context_.options.limits.write_timeout);
  if (const auto error = co_await ask_for_body(parser)) co_return std::tuple(error, std::size_t{0});
  // Else it is read in pieces of the size that a header needed, each of which costs as much as a large one.
  if (!parser.is_done()) buffer_.reserve(buffer_.max_size());
  bool is_delayed = false;
  while (!parser.is_done()) {
    stream_.next_layer().expires_after(context_.options.limits.body_timeout);
    const auto [error, size] = co_await http::async_read_some(stream_, buffer_, parser, kAwait);
    if (error) co_return std::tuple(error, size);
    const double delay_s = context_.block_delay_s(peer_address_, size, steady_seconds());
    if (parser.is_done() || delay_s < kLeastPause_s || is_stopping_) continue;
    if (!is_delayed) context_.metrics.requests_delayed += 1;
    is_delayed = true;
    co_await pause(delay_s);
  }
  co_return std::tuple(error_code{}, std::size_t{0});
}

std::optional<HttpReply> HttpConnection::refusal_of(const Request& request) {
  if (count_of(request, http::field::host) != 1) return text_reply(400, "exactly one Host header is required\n");
  const auto host = view(request[http::field::host]);
  if (!context_.hosts.allows_host(host, local_address_)) {
    return text_reply(403, "this server does not answer to that host name; see --allow-host\n");
  }
  if (is_bare_) return encrypted_elsewhere(request, host);
  const bool is_change = is_block_change(request);
  if (is_change || is_session_change(request)) {
    // Pages of other origins may not write.
    const auto origins = count_of(request, http::field::origin);
    if (origins > 1 ||
        (origins == 1 && !context_.hosts.allows_origin(view(request[http::field::origin]), local_address_))) {
      return refused({403, "forbidden", "", "pages of that origin may not change the map; see --allow-host", ""});
    }
  } else if (request.method() != http::verb::get && request.method() != http::verb::head) {
    auto reply =
        refused_request(view(request.target()), 405, "only GET and HEAD; blocks of the map also PUT and DELETE");
    reply.headers.emplace_back("Allow", "GET, HEAD");
    return reply;
  }
  const auto target = parsed_target(view(request.target()));
  if (!target) return refused_request(view(request.target()), 400, "bad request target");
  who_ =
      context_.options.access->identify(view(request[http::field::authorization]), joined(request, http::field::cookie),
                                        peer_address_, is_from_here_, steady_seconds());
  if (target->path == "/" && (!who_.identity || !access::may(who_.identity->role, access::Right::Watch))) {
    auto reply = text_reply(303, "log in at /login\n");
    reply.headers.emplace_back("Location", "/login");
    return reply;
  }
  const access::Right right = right_of(target->path, is_change);
  if (right != access::Right::Nothing && (!who_.identity || !access::may(who_.identity->role, right)))
    return access_refusal(who_);
  return std::nullopt;
}

std::optional<HttpReply> HttpConnection::upgrade_refusal_of(const Request& request,
                                                            const std::string& subprotocol) const {
  // RFC 6455, 4.1; what came early is in our buffer and would be lost.
  if (buffer_.size() > 0) return text_reply(400, "nothing may follow an upgrade before it is answered\n");
  if (!beast::websocket::is_upgrade(request)) {
    auto reply = text_reply(426, "a WebSocket upgrade with subprotocol " + subprotocol + " is required\n");
    reply.headers.emplace_back("Upgrade", "websocket");
    return reply;
  }
  const auto origins = count_of(request, http::field::origin);
  if (origins > 1 ||
      (origins == 1 && !context_.hosts.allows_origin(view(request[http::field::origin]), local_address_))) {
    return text_reply(403, "pages of that origin may not connect; see --allow-host\n");
  }
  // A browser says where a page comes from; a program has a token.
  if (origins == 0 && who_.identity->is_by_cookie) {
    return text_reply(403, "with a cookie an Origin is required; programs send Authorization: Bearer TOKEN\n");
  }
  if (count_of(request, http::field::sec_websocket_key) != 1 ||
      !is_key(view(request[http::field::sec_websocket_key]))) {
    return text_reply(400, "one Sec-WebSocket-Key of 16 bytes in base64 is required\n");
  }
  const auto [begin, end] = request.equal_range(http::field::sec_websocket_protocol);
  for (auto it = begin; it != end; ++it) {
    for (const auto& offered : http::token_list(it->value())) {
      if (view(offered) == subprotocol) return std::nullopt;
    }
  }
  return text_reply(400, "the subprotocol " + subprotocol + " is required\n");
}

HttpReply HttpConnection::static_reply(const HttpRequest& request) const {
  std::string path = request.target.path;
  if (path == "/login") path = "/login.html";
  if (path == "/licences") path = "/licences.txt";
  const auto file = context_.files.find(path);
  if (!file) {
    if (path == "/") return text_reply(200, std::string(kNoWebClient), "text/html; charset=utf-8");
    return text_reply(404, "not found\n");
  }
  return file_reply(file, request, file->immutable);
}

asio::awaitable<HttpReply> HttpConnection::answer(const HttpRequest& request) {
  const auto& path = request.target.path;
  const bool is_ours = path.starts_with("/api/") || path == "/healthz" || path == "/readyz" || path == "/metrics";
  if (!is_ours) co_return static_reply(request);

  const auto pending = std::make_shared<PendingReply>(stream_.get_executor());
  {
    const auto once = std::make_shared<ReplyOnce>(pending);
    context_.http(request, [once](HttpReply reply) { once->give(std::move(reply)); });
  }
  while (!pending->reply) co_await pending->arrived.async_wait(kAwait);
  co_return std::move(*pending->reply);
}

asio::awaitable<bool> HttpConnection::write(const HttpReply& reply, unsigned version, bool is_head, bool keep_alive) {
  static const std::string kEmpty;
  const std::string& body = reply.body ? *reply.body : kEmpty;
  http::response<http::span_body<const char>> response;
  response.version(version);
  response.result(reply.status);
  response.set(http::field::server, "Spectra");
  if (reply.status != 304) response.set(http::field::content_type, reply.content_type);
  response.set("Content-Security-Policy", kContentSecurityPolicy);
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  for (const auto& [name, value] : reply.headers) response.set(name, value);
  if (response.count(http::field::cache_control) == 0) response.set(http::field::cache_control, "no-store");
  response.keep_alive(keep_alive);
  if (reply.status != 304) response.content_length(body.size());
  if (!is_head && reply.status != 304) response.body() = {body.data(), body.size()};

  http::response_serializer<http::span_body<const char>> serializer(response);
  serializer.split(is_head || reply.status == 304);
  const NetLimits& limits = context_.options.limits;
  const double begin_s = steady_seconds();
  const double patience_s = std::chrono::duration<double>(limits.download_patience).count();
  double written_bytes = 0;
  while (is_head || reply.status == 304 ? !serializer.is_header_done() : !serializer.is_done()) {
    stream_.next_layer().expires_after(limits.write_timeout);
    const auto [error, size] = co_await http::async_write_some(stream_, serializer, kAwait);
    if (error) co_return false;
    written_bytes += static_cast<double>(size);
    const double passed_s = steady_seconds() - begin_s;
    if (passed_s > patience_s && written_bytes < passed_s * limits.download_bytes_per_s) {
      spdlog::info("a download of {} is cut: it is too slow", peer_address_);
      co_return false;
    }
  }
  if (!keep_alive) {
    // Reading what is still coming lets the peer see the answer instead of a reset.
    stream_.next_layer().expires_after(context_.options.limits.close_timeout);
    co_await stream_.end_writing();
    std::array<char, 4096> rest;
    std::size_t drained = 0;
    while (drained < context_.options.limits.body_size_bytes) {
      const auto [error, size] = co_await stream_.next_layer().async_read_some(asio::buffer(rest), kAwait);
      if (error) break;
      drained += size;
    }
  }
  co_return keep_alive;
}

void HttpConnection::begin_stop() {
  asio::post(executor_, [self = shared_from_this()] {
    self->is_stopping_ = true;
    if (self->is_waiting_for_request_) self->stream_.next_layer().cancel();
    self->turn_timer_.cancel();
  });
}

void HttpConnection::cut() {
  asio::post(executor_, [self = shared_from_this()] {
    if (!self->is_handed_over_) self->stream_.next_layer().close();
  });
}

}  // namespace spectra::net
