#include "server/net/ingest_client.hpp"

#include <algorithm>
#include <array>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/field.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <charconv>
#include <exception>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "protocol/ingest_message.hpp"
#include "protocol/jsonrpc.hpp"
#include "server/net/transport.hpp"

namespace spectra::net {
namespace asio = boost::asio;
namespace beast = boost::beast;
namespace ssl = boost::asio::ssl;
namespace websocket = boost::beast::websocket;
using asio::ip::tcp;
using boost::system::error_code;

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kFirstPause{100};
constexpr std::chrono::milliseconds kLongestPause{2'000};
/// After the server said that it is busy.
constexpr std::chrono::milliseconds kBusyPause{500};
constexpr std::size_t kLongestAnswer = 1024 * 1024;
constexpr std::size_t kWriteBufferBytes = 256 * 1024;

/// Why a server refuses, as it says it: the reason of an error as JSON, or a line.
std::string reason_in(const std::string& text) {
  const auto json = nlohmann::json::parse(text, nullptr, false);
  const auto reason = nlohmann::json::json_pointer("/error/reason");
  if (json.is_object() && json.contains(reason) && json[reason].is_string()) return json[reason].get<std::string>();
  return text.substr(0, std::min<std::size_t>(text.find_first_of("\r\n"), 200));
}

/// Why there is no link, or no longer one.
struct LinkFailure {
  std::string why;
  bool is_final = false;  ///< Trying again would not help.
};

/// All of send_blocks; coroutines of one thread.
class Sending {
 public:
  Sending(const IngestAddress& to, const BlocksToSend& blocks, const SendingLimits& limits)
      : to_(to), blocks_(blocks), limits_(limits), pause_(io_), writer_signal_(io_), minder_timer_(io_) {
    for (std::size_t i = 0; i < blocks.count; ++i) to_send_.insert(i);
  }

  std::optional<std::string> run() {
    std::optional<std::string> problem;
    std::exception_ptr thrown;
    asio::co_spawn(io_, send_all(), [&](std::exception_ptr error, std::optional<std::string> outcome) {
      thrown = std::move(error);
      problem = std::move(outcome);
      io_.stop();
    });
    io_.run();
    if (thrown) std::rethrow_exception(thrown);
    return problem;
  }

 private:
  using Stream = websocket::stream<Transport>;

  asio::awaitable<std::optional<std::string>> send_all() {
    bool was_connected = false;
    auto pause = kFirstPause;
    auto last_good = Clock::now();
    while (!is_done()) {
      failure_ = {};
      has_hello_ = false;
      co_await connect();
      if (failure_.why.empty()) co_await serve_link();
      was_connected = was_connected || has_hello_;
      for (const auto& [sequence, index] : under_way_) to_send_.insert(index);
      under_way_.clear();
      if (is_done()) break;
      if (has_hello_) {
        last_good = Clock::now();
        pause = kFirstPause;
      }
      if (!was_connected || failure_.is_final || Clock::now() - last_good >= limits_.patience) {
        co_return failure_.why;
      }
      if (has_hello_) blocks_.broken(failure_.why);
      pause_.expires_after(pause);
      co_await pause_.async_wait(kAwait);
      pause = std::min(2 * pause, kLongestPause);
    }
    co_return std::nullopt;
  }

  asio::awaitable<void> connect() {
    const std::string where = to_.url();
    tcp::resolver resolver(io_);
    const auto [resolve_error, endpoints] = co_await resolver.async_resolve(to_.host, to_.port, kAwait);
    if (resolve_error) {
      failure_ = {where + ": there is no such host (" + resolve_error.message() + ")", false};
      co_return;
    }
    ws_ = std::make_unique<Stream>(io_.get_executor());
    auto& socket = beast::get_lowest_layer(*ws_);
    socket.expires_after(limits_.connect_timeout);
    const auto [connect_error, endpoint] = co_await socket.async_connect(endpoints, kAwait);
    if (connect_error) {
      failure_ = {where + " cannot be reached: " + connect_error.message() + "; is spectra serve running there?",
                  false};
      co_return;
    }
    error_code ignored;
    socket.socket().set_option(tcp::no_delay(true), ignored);
    if (to_.is_encrypted && !co_await encrypt(where)) co_return;
    socket.expires_never();
    websocket::stream_base::timeout timeouts{};
    timeouts.handshake_timeout = limits_.connect_timeout;
    timeouts.idle_timeout = websocket::stream_base::none();  // it does not count the server's pings
    timeouts.keep_alive_pings = false;
    ws_->set_option(timeouts);
    ws_->set_option(websocket::stream_base::decorator([token = limits_.token](websocket::request_type& request) {
      request.set(beast::http::field::sec_websocket_protocol, protocol::kIngestProtocol);
      if (!token.empty()) request.set(beast::http::field::authorization, "Bearer " + token);
    }));
    ws_->read_message_max(kLongestAnswer);
    ws_->auto_fragment(false);
    ws_->write_buffer_bytes(kWriteBufferBytes);
    ws_->binary(true);
    websocket::response_type response;
    const auto [error] = co_await ws_->async_handshake(response, to_.authority(), to_.path, kAwait);
    if (error == websocket::error::upgrade_declined) {
      const unsigned status = response.result_int();
      const std::string said = std::to_string(status) + ' ' + reason_in(response.body());
      constexpr unsigned kNotFound = 404, kBusy = 503;
      failure_ = {status == kNotFound
                      ? where + to_.path + ": there is no such place; a Spectra server that takes blocks has it"
                      : where + to_.path + " takes no blocks: " + said,
                  status != kBusy};
    } else if (error && error.category() == make_error_code(websocket::error::upgrade_declined).category()) {
      failure_ = {where + to_.path + " is not the /ingest of a Spectra server: " + error.message(), true};
    } else if (error) {
      failure_ = {where + to_.path + " does not answer as a server should: " + error.message(), false};
    }
  }

  asio::awaitable<bool> encrypt(const std::string& where) {
    const auto context = std::make_shared<ssl::context>(ssl::context::tls_client);
    SSL_CTX_set_min_proto_version(context->native_handle(), TLS1_2_VERSION);
    error_code error;
    if (limits_.trusted.empty()) {
      context->set_default_verify_paths(error);
    } else {
      context->load_verify_file(limits_.trusted, error);
    }
    if (error) {
      failure_ = {limits_.trusted + ": no certificate in PEM form can be read from it (" + error.message() + ')', true};
      co_return false;
    }
    const auto outcome = co_await ws_->next_layer().begin_handshake(context, to_.host);
    if (!outcome.error) co_return true;
    if (!outcome.distrust.empty()) {
      failure_ = {where + " is not trusted: " + outcome.distrust + "; --ca FILE names the certificate that is", true};
    } else if (outcome.error.category() == asio::error::get_ssl_category()) {
      failure_ = {where + " does not speak TLS as it should: " + outcome.error.message(), true};
    } else {
      failure_ = {where + " cannot be reached: " + outcome.error.message(), false};
    }
    co_return false;
  }

  asio::awaitable<void> serve_link() {
    using namespace asio::experimental::awaitable_operators;
    is_over_ = false;
    next_sequence_ = 1;
    sent_ = {};
    credit_ = {};
    co_await (read_answers() && write_blocks() && mind_silence());
    ws_.reset();
  }

  void end_link(std::string why, bool is_final) {
    if (is_over_) return;
    is_over_ = true;
    failure_ = {std::move(why), is_final};
    beast::get_lowest_layer(*ws_).close();
    writer_signal_.cancel();
    minder_timer_.cancel();
  }

  asio::awaitable<void> mind_silence() {
    const auto& counted = beast::get_lowest_layer(*ws_).rate_policy();
    constexpr int kLooks = 20;
    std::uint64_t read_bytes = 0;
    auto last_reading = Clock::now();
    while (!is_over_) {
      minder_timer_.expires_after(limits_.silence / kLooks);
      co_await minder_timer_.async_wait(kAwait);
      if (is_over_) co_return;
      if (counted.read_bytes() != read_bytes) last_reading = Clock::now();
      read_bytes = counted.read_bytes();
      if (Clock::now() - last_reading >= limits_.silence) end_link("the connection broke: the server is silent", false);
    }
  }

  asio::awaitable<void> read_answers() {
    beast::flat_buffer buffer;
    while (!is_over_) {
      const auto [error, size] = co_await ws_->async_read(buffer, kAwait);
      if (error) {
        end_link_of(error);
        co_return;
      }
      take_answer({static_cast<const char*>(buffer.data().data()), size});
      buffer.consume(buffer.size());
    }
  }

  void end_link_of(const error_code& error) {
    if (error != websocket::error::closed) return end_link("the connection broke: " + error.message(), false);
    const auto& reason = ws_->reason();
    const bool may_come_back = reason.code == websocket::close_code::going_away ||
                               reason.code == websocket::close_code::none ||
                               reason.code == websocket::close_code::service_restart;
    const std::string words(reason.reason.data(), reason.reason.size());
    end_link("the server closed the connection: " + (words.empty() ? "it gave no reason" : words) + " (" +
                 std::to_string(reason.code) + ")",
             !may_come_back);
  }

  void take_answer(std::string_view text) {
    const auto json = protocol::parsed_json(text, {.max_size_bytes = kLongestAnswer});
    if (!json || !json.value().is_object()) return end_link("the server said what is no JSON", true);
    const auto& message = json.value();
    const auto method = message.value("method", nlohmann::json()), params = message.value("params", nlohmann::json());
    if (method == "ingest.hello") {
      if (auto hello = read<protocol::IngestHello>(params)) {
        has_hello_ = true;
        max_block_bytes_ = hello->limits.max_block_bytes;
        credit_ = hello->credit;
      }
    } else if (method == "ingest.acknowledged") {
      if (auto answer = read<protocol::IngestAcknowledged>(params)) {
        credit_ = answer->credit;
        if (const auto index = answered(answer->sequence)) blocks_.acknowledged(*index, *answer);
      }
    } else if (method == "ingest.refused") {
      if (auto answer = read<protocol::IngestRefused>(params)) {
        credit_ = answer->credit;
        const auto index = answered(answer->sequence);
        if (index && answer->code == "busy") {
          to_send_.insert(*index);
          not_before_ = std::max(not_before_, Clock::now() + kBusyPause);
        } else if (index) {
          blocks_.refused(*index, *answer);
        }
      }
    }
    writer_signal_.cancel();
  }

  template <class Message>
  std::optional<Message> read(const nlohmann::json& params) {
    auto message = protocol::from_json<Message>(params);
    if (message) return std::move(message).value();
    end_link("the server's answer cannot be read: " + message.error().message, true);
    return std::nullopt;
  }

  std::optional<std::size_t> answered(std::uint64_t sequence) {
    const auto found = under_way_.find(sequence);
    if (found == under_way_.end()) return std::nullopt;
    const std::size_t index = found->second;
    under_way_.erase(found);
    return index;
  }

  /// When the next block may be sent; nothing: as soon as something changes.
  std::optional<Clock::time_point> next_moment() const {
    const bool has_credit = sent_.blocks < credit_.blocks && sent_.bytes < credit_.bytes;
    if (!has_hello_ || to_send_.empty() || !has_credit) return std::nullopt;
    return not_before_;
  }

  asio::awaitable<void> write_blocks() {
    while (!is_over_ && !is_done()) {
      const auto moment = next_moment();
      if (!moment || *moment > Clock::now()) {
        writer_signal_.expires_at(moment.value_or(Clock::time_point::max()));
        co_await writer_signal_.async_wait(kAwait);
        continue;
      }
      co_await write_one();
    }
    if (is_over_) co_return;
    co_await ws_->async_close(websocket::close_code::normal, kAwait);
    end_link("", false);
  }

  asio::awaitable<void> write_one() {
    const std::size_t index = *to_send_.begin();
    to_send_.erase(to_send_.begin());
    const auto block = blocks_.read(index, max_block_bytes_);
    if (!block) co_return;
    if (limits_.blocks_per_s) {
      const auto interval = std::chrono::duration<double>(1 / *limits_.blocks_per_s);
      not_before_ = std::max(not_before_, Clock::now()) + std::chrono::duration_cast<Clock::duration>(interval);
    }
    const auto kind = block->ply.empty() ? protocol::IngestKind::Remove : protocol::IngestKind::Put;
    const protocol::IngestHeader header{kind, next_sequence_++, static_cast<std::uint16_t>(block->target.size()),
                                        static_cast<std::uint32_t>(block->ply.size())};
    under_way_.emplace(header.sequence, index);
    sent_.blocks += 1;
    sent_.bytes += header.message_size_bytes();
    const auto head = protocol::encoded_header(header);
    const std::array<asio::const_buffer, 3> buffers{asio::buffer(head), asio::buffer(block->target),
                                                    asio::buffer(block->ply)};
    const auto [error, size] = co_await ws_->async_write(buffers, kAwait);
    // Why is told by the reader, who hears what the server says of it.
    if (error && error != websocket::error::closed && error != asio::error::operation_aborted) {
      writer_signal_.expires_after(limits_.connect_timeout);
      co_await writer_signal_.async_wait(kAwait);
      end_link("the connection broke: " + error.message(), false);
    }
  }

  bool is_done() const { return to_send_.empty() && under_way_.empty(); }

  const IngestAddress& to_;
  const BlocksToSend& blocks_;
  const SendingLimits& limits_;
  asio::io_context io_{1};
  asio::steady_timer pause_;
  asio::steady_timer writer_signal_;
  asio::steady_timer minder_timer_;
  std::unique_ptr<Stream> ws_;
  std::set<std::size_t> to_send_;
  std::map<std::uint64_t, std::size_t> under_way_;  ///< By sequence.
  std::uint64_t next_sequence_ = 1;
  std::uint64_t max_block_bytes_ = 0;
  protocol::IngestCredit sent_, credit_;
  Clock::time_point not_before_ = Clock::now();
  bool has_hello_ = false;
  bool is_over_ = true;
  LinkFailure failure_;
};

}  // namespace

std::string IngestAddress::authority() const {
  return (host.find(':') == std::string::npos ? host : '[' + host + ']') + ':' + port;
}

std::string IngestAddress::url() const {
  return (is_encrypted ? "https://" : "http://") + authority();
}

std::variant<IngestAddress, std::string> parsed_ingest_address(std::string_view url) {
  const std::string wrong = std::string(url) + " is not an address such as http://127.0.0.1:8080";
  const auto scheme_end = url.find("://");
  if (scheme_end == std::string_view::npos) return wrong;
  const std::string_view scheme = url.substr(0, scheme_end);
  const bool is_encrypted = scheme == "https" || scheme == "wss";
  if (!is_encrypted && scheme != "http" && scheme != "ws") return wrong;
  url.remove_prefix(scheme_end + 3);
  const auto slash = std::min(url.find('/'), url.size());
  std::string_view authority = url.substr(0, slash);
  std::string path(url.substr(slash));
  while (path.ends_with('/')) path.pop_back();
  if (!path.ends_with("/ingest")) path += "/ingest";
  IngestAddress address{"", is_encrypted ? "443" : "80", std::move(path), is_encrypted};
  const bool is_bracketed = authority.starts_with('[');
  const auto host_end = is_bracketed ? authority.find(']') : std::min(authority.rfind(':'), authority.size());
  if (host_end == std::string_view::npos) return wrong;
  address.host = authority.substr(is_bracketed ? 1 : 0, host_end - (is_bracketed ? 1 : 0));
  authority.remove_prefix(host_end + (is_bracketed ? 1 : 0));
  if (!authority.empty()) {
    std::uint16_t port = 0;
    const auto [end, error] = std::from_chars(authority.data() + 1, authority.data() + authority.size(), port);
    if (authority[0] != ':' || error != std::errc() || end != authority.data() + authority.size() || port == 0)
      return wrong;
    address.port = authority.substr(1);
  }
  const bool has_odd = (address.host + address.path).find_first_of(" ?#@\\\t\r\n") != std::string::npos;
  const bool has_colon = !is_bracketed && address.host.find(':') != std::string::npos;
  if (address.host.empty() || has_odd || has_colon) return wrong;
  return address;
}

std::optional<std::string> send_blocks(const IngestAddress& to, const BlocksToSend& blocks,
                                       const SendingLimits& limits) {
  return Sending(to, blocks, limits).run();
}

}  // namespace spectra::net
