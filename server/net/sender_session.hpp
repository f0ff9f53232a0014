#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "server/net/ping_watch.hpp"
#include "server/net/server_context.hpp"
#include "server/net/transport.hpp"

namespace spectra::net {

/// The WebSocket of a robot that sends and is answered (docs/protocol.md, "A stream of blocks" and "A stream of frames"): a reader, a
/// writer of answers and a minder of deadlines as coroutines on one strand. How messages are read and answered is the business of
/// who derives.
class SenderSession : public Stoppable, public std::enable_shared_from_this<SenderSession> {
 public:
  using UpgradeRequest = boost::beast::http::request<boost::beast::http::string_body>;

  /// Answers the upgrade and serves until the connection ends. To be run on the stream's strand.
  boost::asio::awaitable<void> run(UpgradeRequest request);

  void begin_stop() override;
  void cut() override;

 protected:
  using Clock = std::chrono::steady_clock;

  /// What it is and how it is spoken of.
  struct Kind {
    std::string_view name;         ///< "a sender of blocks".
    std::string_view subprotocol;  ///< That is agreed on.
    std::size_t largest_message;   ///< Bytes; 0 = the reader bounds them itself.
  };

  /// `stream` is connected and its executor is a strand.
  SenderSession(Transport stream, ServerContext& context, access::AccessControl::Identity who, Kind kind);

  // The part of who derives; called on the strand.
  /// Reads until nothing more is to be read.
  virtual boost::asio::awaitable<void> read_messages() = 0;
  /// The first thing that is written.
  virtual std::string hello_text() = 0;
  /// The next answer that waits; nothing without one.
  virtual std::optional<std::string> next_answer() = 0;
  /// Nothing that was taken waits for its outcome: a session that is to stop may close.
  virtual bool is_all_answered() const = 0;
  /// Nothing is read at present for a reason that is not the sender's.
  virtual bool is_reading_held_up() const { return false; }
  /// Why a sender is to be cut that neither is silent nor keeps answers waiting; empty for none.
  virtual std::string_view fault(Clock::time_point) const { return {}; }
  /// The connection has ended.
  virtual void ended() {}

  /// There is an answer, or something else to do for the writer.
  void notify_writer() { writer_signal_.cancel(); }
  /// The reader waits until the time is over or it is called.
  boost::asio::awaitable<void> pause_reading(Clock::time_point until);
  void resume_reading() { reader_timer_.cancel(); }
  void close(std::uint16_t code, std::string_view reason);
  void end(bool is_cut, std::string_view why);
  /// Nothing more is to be read.
  bool is_over() const { return is_ended_ || closing_; }
  bool is_stopping() const { return is_stopping_; }
  template <class Self>
  std::shared_ptr<Self> shared_as() {
    return std::static_pointer_cast<Self>(shared_from_this());
  }

  boost::beast::websocket::stream<Transport> ws_;
  ServerContext& context_;

 private:
  class Part;
  boost::asio::awaitable<void> whole(boost::asio::awaitable<void> work);
  boost::asio::awaitable<void> write_answers();
  boost::asio::awaitable<bool> write(std::string text);
  boost::asio::awaitable<void> mind_deadlines();
  boost::asio::awaitable<void> ping(std::string payload);
  void control_received(boost::beast::websocket::frame_type kind, std::string_view payload);

  const access::AccessControl::Identity who_;
  const Kind kind_;
  boost::asio::steady_timer writer_signal_;
  boost::asio::steady_timer minder_timer_;
  boost::asio::steady_timer reader_timer_;
  PingWatch pings_{Clock::now()};
  bool is_stopping_ = false;
  bool is_ended_ = false;
  bool is_writing_ = false;
  bool is_close_answered_ = false;  ///< By the control callback; nothing more may be written.
  std::optional<boost::beast::websocket::close_reason> closing_;
  Clock::time_point close_deadline_ = Clock::time_point::max();
};

}  // namespace spectra::net
