#include "server/net/ingest_session.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/post.hpp>
#include <boost/beast/http/field.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <exception>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "protocol/jsonrpc.hpp"
#include "server/net/request_right.hpp"
#include "server/net/request_target.hpp"
#include "server/net/websocket_setup.hpp"

namespace spectra::net {
namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

namespace {

constexpr std::uint16_t kCreditExceeded = 4001;
/// How often a message that waits for room looks whether there is some.
constexpr std::chrono::milliseconds kRoomPoll{5};

BlockRefusal bad_request(std::string field, std::string reason, std::string limits = "") {
  return {400, "bad_request", std::move(field), std::move(reason), std::move(limits)};
}

}  // namespace

IngestSession::IngestSession(Transport stream, ServerContext& context, access::AccessControl::Identity who)
    : ws_(std::move(stream)),
      context_(context),
      who_(std::move(who)),
      writer_signal_(ws_.get_executor(), asio::steady_timer::time_point::max()),
      minder_timer_(ws_.get_executor()),
      reader_timer_(ws_.get_executor()) {}

asio::awaitable<void> IngestSession::run(UpgradeRequest request) {
  using namespace asio::experimental::awaitable_operators;
  const auto self = shared_from_this();
  beast::get_lowest_layer(ws_).expires_never();
  // A message is read in parts, for which there is room.
  set_up_websocket(ws_, context_.options.limits.header_timeout, protocol::kIngestProtocol, 0);
  ws_.control_callback([this](websocket::frame_type kind, beast::string_view payload) {
    if (kind == websocket::frame_type::pong) pings_.answered({payload.data(), payload.size()}, Clock::now());
    if (kind != websocket::frame_type::close || !has_unknown_close(ws_) || closing_) return;
    close(websocket::close_code::protocol_error, "");
    is_close_answered_ = true;
    ws_.async_close(*closing_, [self = shared_from_this()](const error_code&) {});
  });

  const auto [accept_error] = co_await ws_.async_accept(request, kAwait);
  if (accept_error || !context_.add(self)) {
    beast::get_lowest_layer(ws_).close();
    co_return;
  }
  try {
    co_await (read_messages() && write_answers() && mind_deadlines());
  } catch (const std::exception& error) {
    spdlog::error("a sender's session failed: {}", error.what());
  }
  end(false, "");
  context_.remove(this);
}

asio::awaitable<void> IngestSession::read_messages() {
  bool goes_on = true;
  while (goes_on && !is_ended_ && !closing_ && !is_stopping_) goes_on = co_await read_message();
}

asio::awaitable<std::optional<std::size_t>> IngestSession::read_part(char* data, std::size_t size_bytes) {
  std::size_t read_bytes = 0;
  while (read_bytes < size_bytes && !(is_within_message_ && ws_.is_message_done())) {
    const auto [error, count] =
        co_await ws_.async_read_some(asio::buffer(data + read_bytes, size_bytes - read_bytes), kAwait);
    if (error) {
      end(false, error.message());
      co_return std::nullopt;
    }
    is_within_message_ = true;
    last_payload_ = Clock::now();
    read_bytes += count;
  }
  co_return read_bytes;
}

asio::awaitable<bool> IngestSession::skip_rest(std::uint64_t most_bytes) {
  std::array<char, 16 * 1024> forgotten;
  while (!ws_.is_message_done()) {
    const auto count = co_await read_part(forgotten.data(), forgotten.size());
    if (!count) co_return false;
    if (*count > most_bytes) {
      close(websocket::close_code::protocol_error, "a message is longer than it announces");
      co_return false;
    }
    most_bytes -= *count;
  }
  co_return true;
}

asio::awaitable<bool> IngestSession::read_message() {
  const NetLimits& limits = context_.options.limits;
  is_within_message_ = false;
  std::array<char, protocol::kIngestHeaderSize> head;
  const auto head_bytes = co_await read_part(head.data(), head.size());
  if (!head_bytes || closing_) co_return false;
  if (ws_.got_text()) {
    close(websocket::close_code::unknown_data, "blocks are binary messages");
    co_return false;
  }
  const auto header = protocol::decoded_ingest_header(std::as_bytes(std::span(head.data(), *head_bytes)));
  if (!header) {
    close(websocket::close_code::protocol_error, header.error().message);
    co_return false;
  }
  Incoming incoming;
  incoming.header = header.value();
  if (incoming.header.sequence <= last_sequence_) {
    close(websocket::close_code::protocol_error, "sequence numbers must rise");
    co_return false;
  }
  last_sequence_ = incoming.header.sequence;
  const protocol::IngestCredit granted = credit();
  if (received_blocks_ >= granted.blocks || received_bytes_ >= granted.bytes) {
    close(kCreditExceeded, "more was sent than the credit");
    co_return false;
  }
  received_blocks_ += 1;
  received_bytes_ += incoming.header.message_size_bytes();
  context_.metrics.blocks_received += 1;
  context_.metrics.block_bytes_received += incoming.header.message_size_bytes();

  const std::uint64_t announced = incoming.header.message_size_bytes() - protocol::kIngestHeaderSize;
  std::optional<BlockRefusal> refusal;
  if (incoming.header.body_size_bytes > limits.block_size_bytes) {
    refusal = BlockRefusal{413, "too_large", "body", "the block is larger than a block may be",
                           std::to_string(limits.block_size_bytes) + " bytes"};
  } else if (incoming.header.target_size_bytes > protocol::kIngestTargetSize) {
    refusal = bad_request("target", "the name and what is said of the block are too long",
                          std::to_string(protocol::kIngestTargetSize) + " bytes");
  }
  if (refusal) {
    if (!co_await skip_rest(announced)) co_return false;
    answer(incoming.header.sequence, incoming.header.message_size_bytes(), std::move(*refusal));
    is_within_message_ = false;
    co_return true;
  }
  if (!co_await wait_for_room(incoming)) co_return false;
  incoming.target.resize(incoming.header.target_size_bytes);
  incoming.body.resize(incoming.header.body_size_bytes);
  const auto target_bytes = co_await read_part(incoming.target.data(), incoming.target.size());
  if (!target_bytes) co_return false;
  const auto body_bytes = co_await read_part(incoming.body.data(), incoming.body.size());
  if (!body_bytes) co_return false;
  incoming.is_cut_short = *target_bytes + *body_bytes < announced;
  if (!co_await skip_rest(0)) co_return false;
  is_within_message_ = false;
  if (is_stopping_ || closing_) co_return false;
  hand_over(std::move(incoming));
  co_return true;
}

asio::awaitable<bool> IngestSession::wait_for_room(Incoming& incoming) {
  const auto size_bytes = static_cast<std::size_t>(incoming.header.message_size_bytes());
  is_waiting_for_room_ = true;
  for (;;) {
    if (is_ended_ || closing_ || is_stopping_) co_return false;
    incoming.room = std::make_shared<BlockRoom>(context_, size_bytes);
    if (incoming.room->is_there()) break;
    reader_timer_.expires_after(kRoomPoll);
    co_await reader_timer_.async_wait(kAwait);
  }
  is_waiting_for_room_ = false;
  last_payload_ = Clock::now();
  co_return true;
}

void IngestSession::hand_over(Incoming incoming) {
  const std::uint64_t sequence = incoming.header.sequence;
  const std::uint64_t size_bytes = incoming.header.message_size_bytes();
  const auto refuse = [&](BlockRefusal refusal) { answer(sequence, size_bytes, std::move(refusal)); };
  if (incoming.is_cut_short) return refuse(bad_request("", "the message ends before what it announces is there"));
  const bool is_put = incoming.header.kind == protocol::IngestKind::Put;
  if (!is_put && incoming.header.kind != protocol::IngestKind::Remove) {
    return refuse(bad_request("kind", "that kind of message is not known", "1 = put, 2 = remove"));
  }
  if (!is_put && !incoming.body.empty()) return refuse(bad_request("body", "a block that is taken out has no body"));
  auto target = parsed_target('/' + incoming.target);
  if (!target) return refuse(bad_request("target", "the name and what is said of the block cannot be read"));
  BlockChange change{target->path.substr(1), std::move(target->query), nullptr};
  if (is_put) change.ply = std::make_shared<const std::string>(std::move(incoming.body));
  ++under_way_count_;
  context_.blocks(std::move(change), [self = shared_from_this(), sequence, size_bytes,
                                      room = std::move(incoming.room)](BlockOutcome outcome) mutable {
    asio::post(self->ws_.get_executor(),
               [self, sequence, size_bytes, room = std::move(room), outcome = std::move(outcome)]() mutable {
                 --self->under_way_count_;
                 self->answer(sequence, size_bytes, std::move(outcome));
               });
  });
}

void IngestSession::answer(std::uint64_t sequence, std::uint64_t size_bytes, BlockOutcome outcome) {
  if (std::holds_alternative<BlockRefusal>(outcome)) context_.metrics.blocks_refused += 1;
  answers_.push_back({sequence, size_bytes, std::move(outcome)});
  writer_signal_.cancel();
}

protocol::IngestCredit IngestSession::credit() const {
  const NetLimits& limits = context_.options.limits;
  return {answered_blocks_ + limits.ingest_credit_blocks, answered_bytes_ + limits.ingest_credit_bytes};
}

std::string IngestSession::text_of(const Answer& answer) {
  answered_blocks_ += 1;
  answered_bytes_ += answer.size_bytes;
  if (const auto* refusal = std::get_if<BlockRefusal>(&answer.outcome)) {
    const protocol::IngestRefused refused{answer.sequence, refusal->code,   refusal->field,
                                          refusal->reason, refusal->limits, credit()};
    return protocol::notification_text("ingest.refused", protocol::to_json(refused));
  }
  const auto& taken = std::get<BlockTaken>(answer.outcome);
  protocol::IngestAcknowledged acknowledged{answer.sequence, taken.revision, {}, credit()};
  for (const files::Note& note : taken.notes) acknowledged.notes.push_back({note.id, note.count, note.message});
  return protocol::notification_text("ingest.acknowledged", protocol::to_json(acknowledged));
}

asio::awaitable<void> IngestSession::write_answers() {
  const NetLimits& limits = context_.options.limits;
  const protocol::IngestHello hello{
      protocol::kIngestProtocol, {limits.block_size_bytes, protocol::kIngestTargetSize}, credit()};
  if (!co_await write(protocol::notification_text("ingest.hello", protocol::to_json(hello)))) co_return;
  while (!is_ended_ && !is_close_answered_) {
    if (!answers_.empty()) {
      const Answer next = std::move(answers_.front());
      answers_.pop_front();
      if (!co_await write(text_of(next))) co_return;
      continue;
    }
    if (is_stopping_ && under_way_count_ == 0) close(websocket::close_code::going_away, "the server stops");
    if (closing_) {
      co_await ws_.async_close(*closing_, kAwait);
      end(false, "closed by the server");
      co_return;
    }
    writer_signal_.expires_at(Clock::time_point::max());
    co_await writer_signal_.async_wait(kAwait);
  }
}

asio::awaitable<bool> IngestSession::write(std::string text) {
  ws_.text(true);
  is_writing_ = true;
  const auto [error, size] = co_await ws_.async_write(asio::buffer(text), kAwait);
  is_writing_ = false;
  if (error) end(false, error.message());
  co_return !error;
}

asio::awaitable<void> IngestSession::mind_deadlines() {
  const NetLimits& limits = context_.options.limits;
  const auto& counted = beast::get_lowest_layer(ws_).rate_policy();
  std::uint64_t written_bytes = 0;
  std::uint64_t read_bytes = 0;
  auto last_write_progress = Clock::now();
  auto last_reading = Clock::now();
  while (!is_ended_) {
    minder_timer_.expires_after(limits.tick);
    co_await minder_timer_.async_wait(kAwait);
    if (is_ended_) co_return;
    const auto now = Clock::now();
    if (!is_writing_ || counted.written_bytes() != written_bytes) last_write_progress = now;
    written_bytes = counted.written_bytes();
    // What is not read because there is no room for it is not the sender's silence.
    if (is_waiting_for_room_ || counted.read_bytes() != read_bytes) last_reading = now;
    read_bytes = counted.read_bytes();
    if (now - last_write_progress >= limits.write_timeout) {
      end(true, "it takes no answers");
    } else if (now - last_reading >= limits.ping_interval + limits.pong_timeout) {
      end(true, "it is silent");
    } else if (is_within_message_ && !is_waiting_for_room_ && now - last_payload_ >= limits.body_timeout) {
      end(true, "a message of it stands still");
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

asio::awaitable<void> IngestSession::ping(std::string payload) {
  const auto self = shared_from_this();
  co_await ws_.async_ping(websocket::ping_data(payload), kAwait);
  pings_.written();
}

void IngestSession::close(std::uint16_t code, std::string_view reason) {
  if (closing_ || is_ended_) return;
  closing_.emplace(static_cast<websocket::close_code>(code), beast::string_view(reason.data(), reason.size()));
  close_deadline_ = Clock::now() + context_.options.limits.close_timeout;
  writer_signal_.cancel();
}

void IngestSession::end(bool is_cut, std::string_view why) {
  if (is_ended_) return;
  is_ended_ = true;
  if (is_cut) {
    spdlog::info("a sender of blocks is cut: {}", why);
  } else {
    spdlog::debug("a sender's session ended: {}", why);
  }
  beast::get_lowest_layer(ws_).close();
  writer_signal_.cancel();
  minder_timer_.cancel();
  reader_timer_.cancel();
}

void IngestSession::begin_stop() {
  asio::post(ws_.get_executor(), [self = shared_from_this()] {
    self->is_stopping_ = true;
    self->writer_signal_.cancel();
  });
}

void IngestSession::cut() {
  asio::post(ws_.get_executor(), [self = shared_from_this()] { self->end(true, "the server stops"); });
}

}  // namespace spectra::net
