#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "protocol/messages/frames_messages.hpp"
#include "server/net/frame_receiver.hpp"
#include "server/net/ping_watch.hpp"
#include "server/net/server_context.hpp"
#include "server/net/transport.hpp"

namespace spectra::net {

/// The WebSocket of a robot that sends frames (docs/protocol.md, "A stream of frames"): a reader, a writer and a minder of deadlines as
/// coroutines on one strand. Every message is answered; what is wrong with one ends nothing. What is in memory is bounded by the credit:
/// what goes beyond it is dropped and refused, and who takes no answers is not listened to.
class FramesSession final : public Stoppable, public std::enable_shared_from_this<FramesSession> {
 public:
  using UpgradeRequest = boost::beast::http::request<boost::beast::http::string_body>;

  /// `stream` is connected and its executor is a strand; `receiver` has begun and outlives the session.
  FramesSession(Transport stream, ServerContext& context, FrameReceiver& receiver, access::AccessControl::Identity who);

  /// Answers the upgrade and serves until the connection ends. To be run on the stream's strand.
  boost::asio::awaitable<void> run(UpgradeRequest request);

  void begin_stop() override;
  void cut() override;

  static constexpr std::size_t kLargestMessage = std::size_t{64} << 20;
  static constexpr std::uint64_t kCreditMessages = 128;
  static constexpr std::uint64_t kCreditBytes = std::uint64_t{64} << 20;
  /// With more answers waiting nothing is read: whoever keeps to the credit never has so many.
  static constexpr std::size_t kMostAnswers = 2 * kCreditMessages;

 private:
  using Clock = std::chrono::steady_clock;

  struct Answer {
    std::uint64_t sequence = 0;
    std::uint64_t size_bytes = 0;  ///< Of the message.
    FrameOutcome outcome;
  };

  boost::asio::awaitable<void> read_messages();
  void receive(std::string message);
  void answer(std::uint64_t sequence, std::uint64_t size_bytes, FrameOutcome outcome);
  boost::asio::awaitable<void> write_answers();
  boost::asio::awaitable<bool> write(std::string text);
  boost::asio::awaitable<void> mind_deadlines();
  boost::asio::awaitable<void> ping(std::string payload);
  protocol::FramesCredit credit() const;
  std::string text_of(const Answer& answer);
  void close(std::uint16_t code, std::string_view reason);
  void end(bool is_cut, std::string_view why);

  boost::beast::websocket::stream<Transport> ws_;
  ServerContext& context_;
  FrameReceiver& receiver_;
  const access::AccessControl::Identity who_;
  boost::asio::steady_timer writer_signal_;
  boost::asio::steady_timer reader_signal_;  ///< Of answers that have been written.
  boost::asio::steady_timer minder_timer_;
  boost::beast::flat_buffer buffer_;
  std::deque<Answer> answers_;
  std::uint64_t received_messages_ = 0, received_bytes_ = 0;
  std::uint64_t answered_messages_ = 0, answered_bytes_ = 0;  ///< As far as they are written.
  bool is_stopping_ = false;
  bool is_ended_ = false;
  bool is_writing_ = false;
  PingWatch pings_{Clock::now()};
  std::optional<boost::beast::websocket::close_reason> closing_;
  Clock::time_point close_deadline_ = Clock::time_point::max();
};

}  // namespace spectra::net
