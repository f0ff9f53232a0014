#pragma once

#include <boost/asio/awaitable.hpp>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "protocol/ingest_message.hpp"
#include "protocol/messages/ingest_messages.hpp"
#include "server/net/block_change.hpp"
#include "server/net/block_room.hpp"
#include "server/net/sender_session.hpp"

namespace spectra::net {

/// The WebSocket of one sender of blocks (docs/protocol.md, "A stream of blocks"). A message is read when there is room for it,
/// whole or not at all, and every one is answered. What is in memory is bounded by the room that all senders share, what waits to
/// be answered by the credit.
class IngestSession final : public SenderSession {
 public:
  /// `stream` is connected and its executor is a strand.
  IngestSession(Transport stream, ServerContext& context, access::AccessControl::Identity who);

 private:
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

  boost::asio::awaitable<void> read_messages() override;
  std::string hello_text() override;
  std::optional<std::string> next_answer() override;
  bool is_all_answered() const override { return under_way_count_ == 0; }
  bool is_reading_held_up() const override { return is_waiting_for_room_; }
  std::string_view fault(Clock::time_point now) const override;

  /// False: nothing more is to be read.
  boost::asio::awaitable<bool> read_message();
  /// Reads to the end of the buffer or of the message: how much; nothing when the connection has ended.
  boost::asio::awaitable<std::optional<std::size_t>> read_part(char* data, std::size_t size_bytes);
  /// Reads what is left of a message and forgets it: how many bytes; nothing when the connection has ended, or when they are more than any
  /// message may have, which ends it.
  boost::asio::awaitable<std::optional<std::uint64_t>> skip_rest();
  /// Reads over the rest of a message of which `read_bytes` behind its header are read, and refuses it.
  boost::asio::awaitable<bool> refuse_message(const protocol::IngestHeader& header, std::uint64_t read_bytes,
                                              BlockRefusal refusal);
  boost::asio::awaitable<bool> wait_for_room(Incoming& incoming);
  void hand_over(Incoming incoming);
  void answer(std::uint64_t sequence, std::uint64_t size_bytes, BlockOutcome outcome);
  protocol::IngestCredit credit() const;
  std::string text_of(const Answer& answer);

  std::deque<Answer> answers_;
  std::uint64_t received_blocks_ = 0, received_bytes_ = 0;
  std::uint64_t answered_blocks_ = 0, answered_bytes_ = 0;  ///< As far as they are written.
  std::uint64_t last_sequence_ = 0;
  std::size_t under_way_count_ = 0;  ///< Handed over and not answered.
  bool is_within_message_ = false;
  bool is_waiting_for_room_ = false;
  Clock::time_point last_payload_;
};

}  // namespace spectra::net
