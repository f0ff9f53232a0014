#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "server/access/token_bucket.hpp"
#include "server/net/ping_watch.hpp"
#include "server/net/server_context.hpp"
#include "server/net/transport.hpp"

namespace spectra::net {

/// One viewer's WebSocket: a reader, a writer and a minder of deadlines as coroutines on one strand. The writer takes the
/// control lane before the frame lane; a read is outstanding all the time; the minder cuts whoever stops taking bytes.
class WebSocketSession final : public ViewerPeer,
                               public Stoppable,
                               public std::enable_shared_from_this<WebSocketSession> {
 public:
  using UpgradeRequest = boost::beast::http::request<boost::beast::http::string_body>;

  /// `stream` is connected and its executor is a strand.
  WebSocketSession(Transport stream, ServerContext& context, HelloForm hello_form, access::AccessControl::Identity who);

  /// Answers the upgrade and serves until the connection ends. To be run on the stream's strand.
  boost::asio::awaitable<void> run(UpgradeRequest request);

  void post(std::function<void()> job) override;
  void wake() override;
  void send(OutgoingText text) override;
  HelloForm hello_form() const override { return hello_form_; }
  access::AccessRole role() const override { return who_.role; }
  double round_trip_ms() const override { return round_trip_ms_; }
  std::size_t queued_bytes() const override { return control_bytes_; }
  std::shared_ptr<const void> room_for(std::size_t size_bytes) override { return share_->take(size_bytes); }

  void begin_stop() override;
  void cut() override;

 private:
  using Clock = std::chrono::steady_clock;
  class Presence;
  class Part;

  /// The last of a session that was registered.
  void finish() noexcept;
  boost::asio::awaitable<void> read_messages();
  /// Until so much may be read.
  boost::asio::awaitable<void> pause(access::TokenBucket& bucket, double count);
  boost::asio::awaitable<void> write_messages();
  boost::asio::awaitable<void> mind_deadlines();
  boost::asio::awaitable<void> ping(std::string payload);
  template <class Buffers>
  boost::asio::awaitable<bool> write(Buffers buffers, bool is_text);
  void close(boost::beast::websocket::close_reason reason);
  /// Closes because the peer leaves messages unread.
  void cut_off();
  /// So many bytes wait no longer.
  void uncount(std::size_t bytes);
  void end(bool is_cut, std::string_view why);
  void notify_writer();
  /// Of a code that RFC 6455 does not know: answers with 1002.
  void refuse_unknown_close();

  boost::beast::websocket::stream<Transport> ws_;
  ServerContext& context_;
  std::shared_ptr<ViewerClient> client_;
  boost::asio::steady_timer writer_signal_;
  boost::asio::steady_timer minder_timer_;
  boost::asio::steady_timer reader_timer_;
  access::TokenBucket messages_;
  access::TokenBucket message_bytes_;
  const HelloForm hello_form_;
  const access::AccessControl::Identity who_;
  std::deque<OutgoingText> control_;
  std::size_t control_bytes_ = 0;            ///< Held by it, with what is being written.
  std::optional<MessageRoom::Share> share_;  ///< From when the client is made.
  bool is_open_ = false;
  bool is_ended_ = false;
  bool is_writing_ = false;
  bool is_close_answered_ = false;  ///< By the control callback; nothing more may be written.
  bool may_have_frame_ = false;
  std::optional<boost::beast::websocket::close_reason> closing_;
  Clock::time_point close_deadline_ = Clock::time_point::max();
  PingWatch pings_{Clock::now()};
  double round_trip_ms_ = 0;
};

}  // namespace spectra::net
