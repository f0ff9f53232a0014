#include "server/net/frames_session.hpp"

#include <boost/asio/post.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <nlohmann/json.hpp>
#include <utility>

#include "protocol/frame_message.hpp"
#include "protocol/jsonrpc.hpp"

namespace spectra::net {
namespace asio = boost::asio;
namespace beast = boost::beast;

FramesSession::FramesSession(Transport stream, ServerContext& context, FrameReceiver& receiver,
                             access::AccessControl::Identity who)
    : SenderSession(std::move(stream), context, std::move(who),
                    {"a robot that sends frames", protocol::kFramesProtocol, kLargestMessage}),
      receiver_(receiver) {}

asio::awaitable<void> FramesSession::read_messages() {
  while (!is_over()) {
    if (answers_.size() >= kMostAnswers) {
      co_await pause_reading(Clock::time_point::max());
      continue;
    }
    const auto [error, size] = co_await ws_.async_read(buffer_, kAwait);
    if (error) {
      end(false, error.message());
      co_return;
    }
    if (is_over()) co_return;
    std::string message = beast::buffers_to_string(buffer_.data());
    buffer_.consume(buffer_.size());
    receive(std::move(message));
  }
}

void FramesSession::receive(std::string message) {
  const std::uint64_t size_bytes = message.size();
  const protocol::FramesCredit granted = credit();
  const bool is_beyond = received_messages_ >= granted.messages || received_bytes_ >= granted.bytes;
  received_messages_ += 1;
  received_bytes_ += size_bytes;
  const auto refuse = [&](std::uint64_t sequence, std::string code, std::string field, std::string reason) {
    answer(sequence, size_bytes, BlockRefusal{400, std::move(code), std::move(field), std::move(reason), ""});
  };
  if (ws_.got_text()) return refuse(0, "bad_request", "head", "frames are binary messages");
  auto decoded = protocol::decoded_frame_message(message);
  if (!decoded) return refuse(0, "bad_request", decoded.error().field, decoded.error().message);
  auto& [head, body_begin] = decoded.value();
  const std::uint64_t sequence = head.sequence;
  if (is_beyond) return refuse(sequence, "credit", "", "more was sent than the credit; it is left out");
  receiver_.take({std::move(head), std::move(message), body_begin}, [self = shared_as<FramesSession>(), sequence,
                                                                     size_bytes](FrameOutcome outcome) mutable {
    asio::post(self->ws_.get_executor(), [self, sequence, size_bytes, outcome = std::move(outcome)]() mutable {
      self->answer(sequence, size_bytes, std::move(outcome));
    });
  });
}

void FramesSession::answer(std::uint64_t sequence, std::uint64_t size_bytes, FrameOutcome outcome) {
  answers_.push_back({sequence, size_bytes, std::move(outcome)});
  notify_writer();
}

protocol::FramesCredit FramesSession::credit() const {
  return {answered_messages_ + kCreditMessages, answered_bytes_ + kCreditBytes};
}

std::string FramesSession::text_of(const Answer& answer) {
  answered_messages_ += 1;
  answered_bytes_ += answer.size_bytes;
  if (const auto* refusal = std::get_if<BlockRefusal>(&answer.outcome)) {
    return protocol::notification_text(
        "frames.refused", protocol::to_json(protocol::FramesRefused{answer.sequence, refusal->code, refusal->field,
                                                                    refusal->reason, credit()}));
  }
  const auto& taken = std::get<FrameTaken>(answer.outcome);
  protocol::FramesTaken message{answer.sequence, {}, taken.pictures_per_s, credit()};
  if (taken.is_skipped) message.skipped = true;
  return protocol::notification_text("frames.taken", protocol::to_json(message));
}

std::string FramesSession::hello_text() {
  const protocol::FramesHello hello{protocol::kFramesProtocol, {kLargestMessage, protocol::kFrameHeadSize}, credit()};
  return protocol::notification_text("frames.hello", protocol::to_json(hello));
}

std::optional<std::string> FramesSession::next_answer() {
  if (answers_.empty()) return std::nullopt;
  const Answer next = std::move(answers_.front());
  answers_.pop_front();
  resume_reading();
  return text_of(next);
}

}  // namespace spectra::net
