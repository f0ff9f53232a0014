#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "protocol/messages/frames_messages.hpp"
#include "server/net/frame_receiver.hpp"
#include "server/net/sender_session.hpp"

namespace spectra::net {

/// The WebSocket of a robot that sends frames (docs/protocol.md, "A stream of frames"). Every message is answered; what is wrong
/// with one ends nothing. What is in memory is bounded by the credit: what goes beyond it is dropped and refused, and who takes no
/// answers is not listened to.
class FramesSession final : public SenderSession {
 public:
  /// `stream` is connected and its executor is a strand; `receiver` has begun and outlives the session.
  FramesSession(Transport stream, ServerContext& context, FrameReceiver& receiver, access::AccessControl::Identity who);

  static constexpr std::size_t kLargestMessage = std::size_t{64} << 20;
  static constexpr std::uint64_t kCreditMessages = 128;
  static constexpr std::uint64_t kCreditBytes = std::uint64_t{64} << 20;
  /// With more answers waiting nothing is read: whoever keeps to the credit never has so many.
  static constexpr std::size_t kMostAnswers = 2 * kCreditMessages;

 private:
  struct Answer {
    std::uint64_t sequence = 0;
    std::uint64_t size_bytes = 0;  ///< Of the message.
    FrameOutcome outcome;
  };

  boost::asio::awaitable<void> read_messages() override;
  std::string hello_text() override;
  std::optional<std::string> next_answer() override;
  /// A picture may wait for its pose longer than the server may take to stop.
  bool is_all_answered() const override { return true; }
  void ended() override { receiver_.end(); }

  void receive(std::string message);
  void answer(std::uint64_t sequence, std::uint64_t size_bytes, FrameOutcome outcome);
  protocol::FramesCredit credit() const;
  std::string text_of(const Answer& answer);

  FrameReceiver& receiver_;
  boost::beast::flat_buffer buffer_;
  std::deque<Answer> answers_;
  std::uint64_t received_messages_ = 0, received_bytes_ = 0;
  std::uint64_t answered_messages_ = 0, answered_bytes_ = 0;  ///< As far as they are written.
};

}  // namespace spectra::net
