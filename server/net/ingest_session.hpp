#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "protocol/ingest_message.hpp"
#include "protocol/messages/ingest_messages.hpp"
#include "server/net/block_change.hpp"
#include "server/net/block_room.hpp"
#include "server/net/ping_watch.hpp"
#include "server/net/server_context.hpp"
#include "server/net/transport.hpp"

namespace spectra::net {

/// The WebSocket of one sender of blocks (docs/protocol.md, "A stream of blocks"): a reader, a writer and a minder of deadlines as
/// coroutines on one strand. A message is read when there is room for it, whole or not at all, and every one is answered. What is
/// in memory is bounded by the room that all senders share, what waits to be answered by the credit.
class IngestSession final : public Stoppable, public std::enable_shared_from_this<IngestSession> {
 public:
  using UpgradeRequest = boost::beast::http::request<boost::beast::http::string_body>;

  /// `stream` is connected and its executor is a strand.
  IngestSession(Transport stream, ServerContext& context, access::AccessControl::Identity who);

  /// Answers the upgrade and serves until the connection ends. To be run on the stream's strand.
  boost::asio::awaitable<void> run(UpgradeRequest request);

  void begin_stop() override;
  void cut() override;

 private:
  using Clock = std::chrono::steady_clock;

  struct Answer {
    std::uint64_t sequence = 0;
    std::uint64_t size_bytes = 0;  ///< Of the message.
    BlockOutcome outcome;
  };
  /// A message as far as it has come.
  struct Incoming {
    protocol::IngestHeader header;
    std::string target;
    std::string body;
    std::shared_ptr<BlockRoom> room;
    bool is_cut_short = false;
  };

  boost::asio::awaitable<void> read_messages();
  /// False: nothing more is to be read.
  boost::asio::awaitable<bool> read_message();
  /// Reads to the end of the buffer or of the message: how much; nothing when the connection has ended.
  boost::asio::awaitable<std::optional<std::size_t>> read_part(char* data, std::size_t size_bytes);
  /// Reads what is left of a message, at most so many bytes, and forgets it; false when the connection has ended, or when the
  /// message is longer, which ends it.
  boost::asio::awaitable<bool> skip_rest(std::uint64_t most_bytes);
  boost::asio::awaitable<bool> wait_for_room(Incoming& incoming);
  void hand_over(Incoming incoming);
  void answer(std::uint64_t sequence, std::uint64_t size_bytes, BlockOutcome outcome);
  boost::asio::awaitable<void> write_answers();
  boost::asio::awaitable<bool> write(std::string text);
  boost::asio::awaitable<void> mind_deadlines();
  boost::asio::awaitable<void> ping(std::string payload);
  protocol::IngestCredit credit() const;
  std::string text_of(const Answer& answer);
  void close(std::uint16_t code, std::string_view reason);
  void end(bool is_cut, std::string_view why);

  boost::beast::websocket::stream<Transport> ws_;
  ServerContext& context_;
  const access::AccessControl::Identity who_;
  boost::asio::steady_timer writer_signal_;
  boost::asio::steady_timer minder_timer_;
  boost::asio::steady_timer reader_timer_;
  std::deque<Answer> answers_;
  std::uint64_t received_blocks_ = 0, received_bytes_ = 0;
  std::uint64_t answered_blocks_ = 0, answered_bytes_ = 0;  ///< As far as they are written.
  std::uint64_t last_sequence_ = 0;
  std::size_t under_way_count_ = 0;  ///< Handed over and not answered.
  bool is_stopping_ = false;
  bool is_ended_ = false;
  bool is_writing_ = false;
  bool is_close_answered_ = false;  ///< By the control callback; nothing more may be written.
  PingWatch pings_{Clock::now()};
  bool is_within_message_ = false;
  bool is_waiting_for_room_ = false;
  Clock::time_point last_payload_;
  std::optional<boost::beast::websocket::close_reason> closing_;
  Clock::time_point close_deadline_ = Clock::time_point::max();
};

}  // namespace spectra::net
