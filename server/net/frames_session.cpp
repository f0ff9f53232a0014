#include "server/net/frames_session.hpp"

#include <spdlog/spdlog.h>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include "protocol/frame_message.hpp"
#include "protocol/jsonrpc.hpp"
#include "server/net/request_right.hpp"
#include "server/net/websocket_setup.hpp"

namespace spectra::net {
namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

FramesSession::FramesSession(Transport stream, ServerContext& context, FrameReceiver& receiver,
                             access::AccessControl::Identity who)
    : ws_(std::move(stream)),
      context_(context),
      receiver_(receiver),
      who_(std::move(who)),
      writer_signal_(ws_.get_executor(), asio::steady_timer::time_point::max()),
      reader_signal_(ws_.get_executor(), asio::steady_timer::time_point::max()),
      minder_timer_(ws_.get_executor()) {}

asio::awaitable<void> FramesSession::run(UpgradeRequest request) {
  using namespace asio::experimental::awaitable_operators;
  const auto self = shared_from_this();
  beast::get_lowest_layer(ws_).expires_never();
  set_up_websocket(ws_, context_.options.limits.header_timeout, protocol::kFramesProtocol, kLargestMessage);
  ws_.control_callback([this](websocket::frame_type kind, beast::string_view payload) {
    if (kind == websocket::frame_type::pong) pings_.answered({payload.data(), payload.size()}, Clock::now());
  });
  const auto [accept_error] = co_await ws_.async_accept(request, kAwait);
  if (accept_error || !context_.add(self)) {
    end(false, "the upgrade was not finished");
    co_return;
  }
  spdlog::info("a robot sends frames");
  try {
    co_await (read_messages() && write_answers() && mind_deadlines());
  } catch (const std::exception& error) {
    spdlog::error("a session of frames failed: {}", error.what());
  }
  end(false, "");
  context_.remove(this);
}

asio::awaitable<void> FramesSession::read_messages() {
  while (!is_ended_ && !closing_) {
    if (answers_.size() >= kMostAnswers) {
      reader_signal_.expires_at(Clock::time_point::max());
      co_await reader_signal_.async_wait(kAwait);
      continue;
    }
    const auto [error, size] = co_await ws_.async_read(buffer_, kAwait);
    if (error) {
      end(false, error.message());
      co_return;
    }
    if (closing_) co_return;
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
  receiver_.take({std::move(head), std::move(message), body_begin}, [self = shared_from_this(), sequence,
                                                                     size_bytes](FrameOutcome outcome) mutable {
    asio::post(self->ws_.get_executor(), [self, sequence, size_bytes, outcome = std::move(outcome)]() mutable {
      self->answer(sequence, size_bytes, std::move(outcome));
    });
  });
}

void FramesSession::answer(std::uint64_t sequence, std::uint64_t size_bytes, FrameOutcome outcome) {
  if (is_ended_) return;
  answers_.push_back({sequence, size_bytes, std::move(outcome)});
  writer_signal_.cancel();
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

asio::awaitable<void> FramesSession::write_answers() {
  const protocol::FramesHello hello{protocol::kFramesProtocol, {kLargestMessage, protocol::kFrameHeadSize}, credit()};
  if (!co_await write(protocol::notification_text("frames.hello", protocol::to_json(hello)))) co_return;
  while (!is_ended_) {
    if (!answers_.empty()) {
      const Answer next = std::move(answers_.front());
      answers_.pop_front();
      reader_signal_.cancel();
      if (!co_await write(text_of(next))) co_return;
      continue;
    }
    if (is_stopping_) close(websocket::close_code::going_away, "the server stops");
    if (closing_) {
      co_await ws_.async_close(*closing_, kAwait);
      end(false, "closed by the server");
      co_return;
    }
    writer_signal_.expires_at(Clock::time_point::max());
    co_await writer_signal_.async_wait(kAwait);
  }
}

asio::awaitable<bool> FramesSession::write(std::string text) {
  ws_.text(true);
  is_writing_ = true;
  const auto [error, size] = co_await ws_.async_write(asio::buffer(text), kAwait);
  is_writing_ = false;
  if (error) end(false, error.message());
  co_return !error;
}

asio::awaitable<void> FramesSession::mind_deadlines() {
  const NetLimits& limits = context_.options.limits;
  const auto& counted = beast::get_lowest_layer(ws_).rate_policy();
  std::uint64_t written_bytes = 0, read_bytes = 0;
  auto last_write_progress = Clock::now(), last_reading = Clock::now();
  while (!is_ended_) {
    minder_timer_.expires_after(limits.tick);
    co_await minder_timer_.async_wait(kAwait);
    if (is_ended_) co_return;
    const auto now = Clock::now();
    if (!is_writing_ || counted.written_bytes() != written_bytes) last_write_progress = now;
    written_bytes = counted.written_bytes();
    if (counted.read_bytes() != read_bytes) last_reading = now;
    read_bytes = counted.read_bytes();
    if (now - last_write_progress >= limits.write_timeout) {
      end(true, "it takes no answers");
    } else if (now - last_reading >= limits.ping_interval + limits.pong_timeout) {
      end(true, "it is silent");
    } else if (now >= close_deadline_) {
      end(false, "the close was not finished in time");
    } else if (closing_) {
      continue;
    } else if (!context_.options.access->is_good(who_)) {
      close(kAccessWithdrawn, "access was withdrawn");
    } else if (auto payload = pings_.next(now, limits.ping_interval)) {
      asio::co_spawn(ws_.get_executor(), ping(std::move(*payload)), asio::detached);
    }
  }
}

asio::awaitable<void> FramesSession::ping(std::string payload) {
  const auto self = shared_from_this();
  co_await ws_.async_ping(websocket::ping_data(payload), kAwait);
  pings_.written();
}

void FramesSession::close(std::uint16_t code, std::string_view reason) {
  if (closing_ || is_ended_) return;
  closing_.emplace(static_cast<websocket::close_code>(code), beast::string_view(reason.data(), reason.size()));
  close_deadline_ = Clock::now() + context_.options.limits.close_timeout;
  writer_signal_.cancel();
  reader_signal_.cancel();
}

void FramesSession::end(bool is_cut, std::string_view why) {
  if (is_ended_) return;
  is_ended_ = true;
  if (is_cut) {
    spdlog::info("a robot that sends frames is cut: {}", why);
  } else {
    spdlog::info("a robot sends no more frames: {}", why);
  }
  receiver_.end();
  beast::get_lowest_layer(ws_).close();
  writer_signal_.cancel();
  reader_signal_.cancel();
  minder_timer_.cancel();
}

void FramesSession::begin_stop() {
  asio::post(ws_.get_executor(), [self = shared_from_this()] {
    self->is_stopping_ = true;
    self->writer_signal_.cancel();
  });
}

void FramesSession::cut() {
  asio::post(ws_.get_executor(), [self = shared_from_this()] { self->end(true, "the server stops"); });
}

}  // namespace spectra::net
