#include "server/net/ingest_session.hpp"

#include <algorithm>
#include <array>
#include <boost/asio/post.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <chrono>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "protocol/jsonrpc.hpp"
#include "server/net/request_target.hpp"

namespace spectra::net {
namespace asio = boost::asio;
namespace websocket = boost::beast::websocket;

namespace {

constexpr std::uint16_t kCreditExceeded = 4001;
/// How often a message that waits for room looks whether there is some.
constexpr std::chrono::milliseconds kRoomPoll{5};

BlockRefusal bad_request(std::string field, std::string reason, std::string limits = "") {
  return {400, "bad_request", std::move(field), std::move(reason), std::move(limits)};
}

}  // namespace

// A message is read in parts, for which there is room.
IngestSession::IngestSession(Transport stream, ServerContext& context, access::AccessControl::Identity who)
    : SenderSession(std::move(stream), context, std::move(who), {"a sender of blocks", protocol::kIngestProtocol, 0}) {}

asio::awaitable<void> IngestSession::read_messages() {
  bool goes_on = true;
  while (goes_on && !is_over() && !is_stopping()) goes_on = co_await read_message();
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

asio::awaitable<std::optional<std::uint64_t>> IngestSession::skip_rest() {
  constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 32U;
  std::array<char, 16 * 1024> forgotten;
  std::uint64_t skipped = 0;
  while (!ws_.is_message_done()) {
    const auto count = co_await read_part(forgotten.data(), forgotten.size());
    if (!count) co_return std::nullopt;
    skipped += *count;
    if (skipped > kMostBytes + protocol::kIngestTargetSize) {
      close(websocket::close_code::protocol_error, "a message is longer than any may be");
      co_return std::nullopt;
    }
  }
  co_return skipped;
}

asio::awaitable<bool> IngestSession::refuse_message(const protocol::IngestHeader& header, std::uint64_t read_bytes,
                                                    BlockRefusal refusal) {
  const auto skipped = co_await skip_rest();
  if (!skipped) co_return false;
  const std::uint64_t announced = header.message_size_bytes();
  const std::uint64_t size_bytes = std::max(announced, protocol::kIngestHeaderSize + read_bytes + *skipped);
  // What came beyond what was announced counts, too.
  received_bytes_ += size_bytes - announced;
  answer(header.sequence, size_bytes, std::move(refusal));
  is_within_message_ = false;
  co_return true;
}

asio::awaitable<bool> IngestSession::read_message() {
  const NetLimits& limits = context_.options.limits;
  is_within_message_ = false;
  std::array<char, protocol::kIngestHeaderSize> head;
  const auto head_bytes = co_await read_part(head.data(), head.size());
  if (!head_bytes || is_over()) co_return false;
  if (ws_.got_text()) {
    close(websocket::close_code::unknown_data, "blocks are binary messages");
    co_return false;
  }
  // Where that byte is not 0, the message is of another version perhaps, but its sequence and end are known.
  constexpr std::size_t kReservedByte = 5;
  const bool has_reserved = *head_bytes > kReservedByte && head[kReservedByte] != 0;
  if (has_reserved) head[kReservedByte] = 0;
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
  if (has_reserved) {
    refusal = bad_request("reserved", "byte 5 of the message is not 0", "0");
  } else if (incoming.header.body_size_bytes > limits.block_size_bytes) {
    refusal = BlockRefusal{413, "too_large", "body", "the block is larger than a block may be",
                           std::to_string(limits.block_size_bytes) + " bytes"};
  } else if (incoming.header.target_size_bytes > protocol::kIngestTargetSize) {
    refusal = bad_request("target", "the name and what is said of the block are too long",
                          std::to_string(protocol::kIngestTargetSize) + " bytes");
  }
  if (refusal) {
    co_return co_await refuse_message(incoming.header, 0, std::move(*refusal));
  }
  if (!co_await wait_for_room(incoming)) co_return false;
  incoming.target.resize(incoming.header.target_size_bytes);
  incoming.body.resize(incoming.header.body_size_bytes);
  const auto target_bytes = co_await read_part(incoming.target.data(), incoming.target.size());
  if (!target_bytes) co_return false;
  const auto body_bytes = co_await read_part(incoming.body.data(), incoming.body.size());
  if (!body_bytes) co_return false;
  incoming.is_cut_short = *target_bytes + *body_bytes < announced;
  const auto excess = co_await skip_rest();
  if (!excess) co_return false;
  if (*excess > 0) {
    co_return co_await refuse_message(incoming.header, announced + *excess,
                                      bad_request("body", "the message is longer than it announces",
                                                  std::to_string(incoming.header.message_size_bytes()) + " bytes"));
  }
  is_within_message_ = false;
  if (is_stopping() || is_over()) co_return false;
  hand_over(std::move(incoming));
  co_return true;
}

asio::awaitable<bool> IngestSession::wait_for_room(Incoming& incoming) {
  const auto size_bytes = static_cast<std::size_t>(incoming.header.message_size_bytes());
  is_waiting_for_room_ = true;
  for (;;) {
    if (is_over() || is_stopping()) co_return false;
    incoming.room = std::make_shared<BlockRoom>(context_, size_bytes);
    if (incoming.room->is_there()) break;
    co_await pause_reading(Clock::now() + kRoomPoll);
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
  context_.blocks(std::move(change), [self = shared_as<IngestSession>(), sequence, size_bytes,
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
  notify_writer();
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

std::string IngestSession::hello_text() {
  const NetLimits& limits = context_.options.limits;
  const protocol::IngestHello hello{
      protocol::kIngestProtocol, {limits.block_size_bytes, protocol::kIngestTargetSize}, credit()};
  return protocol::notification_text("ingest.hello", protocol::to_json(hello));
}

std::optional<std::string> IngestSession::next_answer() {
  if (answers_.empty()) return std::nullopt;
  const Answer next = std::move(answers_.front());
  answers_.pop_front();
  return text_of(next);
}

std::string_view IngestSession::fault(Clock::time_point now) const {
  const bool stands_still =
      is_within_message_ && !is_waiting_for_room_ && now - last_payload_ >= context_.options.limits.body_timeout;
  return stands_still ? "a message of it stands still" : "";
}

}  // namespace spectra::net
