// The /ingest side of the server alone: the map is a list of what was handed over, answered when the test says so.
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>

#include "protocol/ingest_message.hpp"
#include "tests/integration/raw_client.hpp"
#include "tests/integration/test_server.hpp"

namespace spectra::tests {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
constexpr unsigned kBinary = 2;

std::string message(std::uint64_t sequence, std::string_view target, std::string_view body,
                    protocol::IngestKind kind = protocol::IngestKind::Put) {
  const auto header = encoded_header(protocol::IngestHeader{kind, sequence, static_cast<std::uint16_t>(target.size()),
                                                            static_cast<std::uint32_t>(body.size())});
  std::string bytes(reinterpret_cast<const char*>(header.data()), header.size());
  return bytes.append(target).append(body);
}

/// Holds what it is given until it is told to answer.
class HeldBlocks {
 public:
  net::BlockHandler handler() {
    return [this](net::BlockChange change, std::function<void(net::BlockOutcome)> done) {
      const std::lock_guard lock(mutex_);
      held_bytes_ += change.ply ? change.ply->size() : 0;
      most_held_bytes_ = std::max(most_held_bytes_, held_bytes_);
      names_.push_back((change.ply ? "put " : "remove ") + change.id);
      held_.push_back({std::move(change), std::move(done)});
    };
  }

  std::size_t count() {
    const std::lock_guard lock(mutex_);
    return held_.size();
  }
  std::vector<std::string> names() {
    const std::lock_guard lock(mutex_);
    return names_;
  }
  std::size_t most_held_bytes() {
    const std::lock_guard lock(mutex_);
    return most_held_bytes_;
  }

  void answer_first(net::BlockOutcome outcome = net::BlockTaken{}) {
    Held held;
    {
      const std::lock_guard lock(mutex_);
      held = std::move(held_.front());
      held_.pop_front();
      held_bytes_ -= held.change.ply ? held.change.ply->size() : 0;
    }
    held.done(std::move(outcome));
  }

 private:
  struct Held {
    net::BlockChange change;
    std::function<void(net::BlockOutcome)> done;
  };
  std::mutex mutex_;
  std::deque<Held> held_;
  std::vector<std::string> names_;
  std::size_t held_bytes_ = 0, most_held_bytes_ = 0;
};

class IngestSessionTest : public testing::Test {
 protected:
  IngestSessionTest() { start(options()); }
  ~IngestSessionTest() override {
    while (blocks_.count() > 0) blocks_.answer_first();
  }

  static net::NetOptions options() {
    net::NetOptions options = quick_options();
    options.limits.block_size_bytes = 100'000;
    options.limits.ingest_credit_blocks = 4;
    options.limits.ingest_credit_bytes = 50'000;
    options.limits.block_bytes_at_once = 200'000;
    return options;
  }

  void start(net::NetOptions options) {
    server_.reset();
    server_ = std::make_unique<TestServer>(
        std::move(options),
        [](const net::HttpRequest&, const std::function<void(net::HttpReply)>& reply) {
          reply(net::text_reply(200, "ok"));
        },
        [](const std::shared_ptr<net::ViewerPeer>&) { return nullptr; }, std::filesystem::path(), blocks_.handler());
  }

  RawWebSocket sender() const { return RawWebSocket(server_->port(), "", "spectra.ingest.v1", "/ingest"); }

  /// Params of the next text.
  static json next(RawWebSocket& sender, const std::string& method) {
    const auto text = sender.receive_text();
    const json said = text ? json::parse(*text) : json();
    EXPECT_EQ(said.value("method", ""), method) << said;
    return said.value("params", json());
  }

  HeldBlocks blocks_;
  std::unique_ptr<TestServer> server_;
};

TEST_F(IngestSessionTest, GreetsWithLimitsAndCredit) {
  RawWebSocket peer = sender();
  ASSERT_TRUE(peer.is_open()) << peer.upgrade_response();
  EXPECT_NE(peer.upgrade_response().find("Sec-WebSocket-Protocol: spectra.ingest.v1"), std::string::npos);
  EXPECT_EQ(next(peer, "ingest.hello"), json({{"protocol", "spectra.ingest.v1"},
                                              {"limits", {{"max_block_bytes", 100'000}, {"max_target_bytes", 4096}}},
                                              {"credit", {{"blocks", 4}, {"bytes", 50'000}}}}));
}

TEST_F(IngestSessionTest, AnswersACloseCodeThatIsNobodysOnce) {
  for (const std::string& code : {std::string("\x13\x88", 2), std::string("\xff\xff", 2)}) {
    RawWebSocket peer = sender();
    next(peer, "ingest.hello");
    peer.send_frame(8, code);
    EXPECT_EQ(peer.receive_close_code(), 1002U);
    EXPECT_FALSE(peer.receive_text(milliseconds(1000))) << "nothing follows";
    EXPECT_TRUE(eventually([this] { return server_->metrics().connections_open == 0; }));
  }
}

TEST_F(IngestSessionTest, WantsItsSubprotocolAndAnOriginOfItsList) {
  for (const auto* subprotocol : {"", "spectra.v1", "spectra.ingest.v2"}) {
    EXPECT_EQ(status_of(RawWebSocket(server_->port(), "", subprotocol, "/ingest").upgrade_response()), 400);
  }
  EXPECT_EQ(status_of(RawWebSocket(server_->port(), "Origin: http://evil.example\r\n", "spectra.ingest.v1", "/ingest")
                          .upgrade_response()),
            403);
  EXPECT_EQ(
      status_of(http_exchange(server_->port(), "GET /ingest HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")),
      426);
}

TEST_F(IngestSessionTest, HandsOverInOrderAndAnswersAsAnswersCome) {
  RawWebSocket peer = sender();
  next(peer, "ingest.hello");
  peer.send_frame(kBinary, message(1, "a?scale=2", "one"));
  peer.send_frame(kBinary, message(2, "a", "", protocol::IngestKind::Remove));
  peer.send_frame(kBinary, message(9, "a", "two"));
  ASSERT_TRUE(eventually([this] { return blocks_.count() == 3; }));
  EXPECT_EQ(blocks_.names(), (std::vector<std::string>{"put a", "remove a", "put a"}));
  blocks_.answer_first(net::BlockTaken{41, {{"note", 2, "two things"}}});
  const json first = next(peer, "ingest.acknowledged");
  EXPECT_EQ(first["sequence"], 1);
  EXPECT_EQ(first["revision"], 41);
  EXPECT_EQ(first["notes"], json::array({{{"id", "note"}, {"count", 2}, {"message", "two things"}}}));
  EXPECT_EQ(first["credit"], json({{"blocks", 5}, {"bytes", 50'000 + 20 + 9 + 3}}));
  blocks_.answer_first(net::BlockRefusal{404, "not_found", "id", "there is no block", ""});
  const json second = next(peer, "ingest.refused");
  EXPECT_EQ(second["sequence"], 2);
  EXPECT_EQ(second["code"], "not_found");
  EXPECT_EQ(second["credit"]["blocks"], 6);
  blocks_.answer_first();
  EXPECT_EQ(next(peer, "ingest.acknowledged")["sequence"], 9);
}

TEST_F(IngestSessionTest, RefusesABadMessageWithItsSequenceAndLivesOn) {
  RawWebSocket peer = sender();
  next(peer, "ingest.hello");
  const auto refusal = [&](std::uint64_t sequence, const std::string& bytes) {
    peer.send_frame(kBinary, bytes);
    json refused = next(peer, "ingest.refused");
    EXPECT_EQ(refused["sequence"], sequence);
    return std::string(refused["code"]) + ' ' + std::string(refused["field"]);
  };
  EXPECT_EQ(refusal(1, message(1, "a", std::string(100'001, 'x'))), "too_large body");
  EXPECT_EQ(refusal(2, message(2, std::string(4097, 'a'), "")), "bad_request target");
  EXPECT_EQ(refusal(3, message(3, "a", "x", static_cast<protocol::IngestKind>(7))), "bad_request kind");
  EXPECT_EQ(refusal(4, message(4, "a", "x", protocol::IngestKind::Remove)), "bad_request body");
  EXPECT_EQ(refusal(5, message(5, "a?scale=%zz", "x")), "bad_request target");
  EXPECT_EQ(refusal(6, message(6, "a", "x") + "and more"), "bad_request body");
  std::string with_reserved = message(7, "a", "x");
  with_reserved[5] = 1;
  EXPECT_EQ(refusal(7, with_reserved), "bad_request reserved");
  const std::string whole = message(8, "kitchen", "0123456789");
  std::uint64_t sequence = 8;
  for (std::size_t size = protocol::kIngestHeaderSize; size < whole.size(); ++size, ++sequence) {
    EXPECT_EQ(refusal(sequence, message(sequence, "kitchen", "0123456789").substr(0, size)), "bad_request ");
  }
  peer.send_frame(kBinary, message(sequence, "a", "good"));
  ASSERT_TRUE(eventually([this] { return blocks_.count() == 1; }));
  EXPECT_EQ(blocks_.names(), std::vector<std::string>{"put a"});
}

TEST_F(IngestSessionTest, TakesAMessageInPieces) {
  RawWebSocket peer = sender();
  next(peer, "ingest.hello");
  const std::string whole = message(1, "kitchen", "0123456789");
  for (std::size_t i = 0; i < whole.size(); ++i) peer.send_frame(i == 0 ? kBinary : 0, whole.substr(i, 1), false);
  peer.send_frame(0, "");
  ASSERT_TRUE(eventually([this] { return blocks_.count() == 1; }));
  EXPECT_EQ(blocks_.most_held_bytes(), 10U);
}

TEST_F(IngestSessionTest, ClosesWhereNoSequenceIsToBeBelieved) {
  const std::string good = message(5, "a", "x");
  for (std::size_t size = 0; size < protocol::kIngestHeaderSize; ++size) {
    RawWebSocket peer = sender();
    peer.send_frame(kBinary, good.substr(0, size));
    EXPECT_EQ(peer.receive_close_code(), 1002U) << size;
  }
  std::string other_version = good;
  other_version[3] = '2';
  const std::vector<std::string> bad{other_version, std::string(500, 'z'), message(0, "a", "x")};
  for (const std::string& bytes : bad) {
    RawWebSocket peer = sender();
    peer.send_frame(kBinary, bytes);
    EXPECT_EQ(peer.receive_close_code(), 1002U);
  }
  RawWebSocket falling = sender();
  falling.send_frame(kBinary, good);
  falling.send_frame(kBinary, good);
  EXPECT_EQ(falling.receive_close_code(), 1002U);
  RawWebSocket talking = sender();
  talking.send_text("{}");
  EXPECT_EQ(talking.receive_close_code(), 1003U);
}

TEST_F(IngestSessionTest, ClosesWhoSendsBeyondItsCredit) {
  RawWebSocket many = sender();
  for (std::uint64_t i = 1; i <= 5; ++i) many.send_frame(kBinary, message(i, "a", "x"));
  EXPECT_EQ(many.receive_close_code(), 4001U);
  EXPECT_EQ(blocks_.count(), 4U);
  RawWebSocket large = sender();
  large.send_frame(kBinary, message(1, "a", std::string(90'000, 'x')));
  ASSERT_TRUE(eventually([this] { return blocks_.count() == 5; })) << "the last may go beyond";
  large.send_frame(kBinary, message(2, "a", "x"));
  EXPECT_EQ(large.receive_close_code(), 4001U);
}

TEST_F(IngestSessionTest, BoundsWhatAllSendersHaveInMemoryAndDropsNothing) {
  std::vector<RawWebSocket> senders;
  for (int i = 0; i < 8; ++i) senders.push_back(sender());
  std::vector<std::thread> threads;
  for (RawWebSocket& peer : senders) {
    threads.emplace_back([&peer] {
      next(peer, "ingest.hello");
      for (std::uint64_t i = 1; i <= 6; ++i) {
        peer.send_frame(kBinary, message(i, "a", std::string(60'000, 'x')));
        next(peer, "ingest.acknowledged");
      }
    });
  }
  ASSERT_TRUE(eventually([this] { return blocks_.count() == 3; }));
  for (int i = 0; i < 48; ++i) {
    ASSERT_TRUE(eventually([this] { return blocks_.count() > 0; }));
    blocks_.answer_first();
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(blocks_.names().size(), 48U);
  EXPECT_LE(blocks_.most_held_bytes(), 200'000U);
  EXPECT_GE(blocks_.most_held_bytes(), 180'000U);
}

TEST_F(IngestSessionTest, AdmitsSoManySenders) {
  auto few = options();
  few.limits.ingest_sessions = 2;
  start(few);
  const RawWebSocket one = sender();
  {
    const RawWebSocket two = sender();
    EXPECT_TRUE(two.is_open());
    EXPECT_EQ(status_of(sender().upgrade_response()), 503);
  }
  EXPECT_TRUE(eventually([this] { return sender().is_open(); }));
}

TEST_F(IngestSessionTest, CutsWhoStandsStillWithinAMessage) {
  auto quick = options();
  quick.limits.body_timeout = milliseconds(100);
  start(quick);
  RawWebSocket peer = sender();
  next(peer, "ingest.hello");
  peer.send_frame(kBinary, message(1, "a", std::string(50'000, 'x')).substr(0, 40'000), false);
  EXPECT_TRUE(eventually([this] { return server_->metrics().senders == 0; }));
  EXPECT_EQ(blocks_.count(), 0U);
}

TEST_F(IngestSessionTest, CutsWhoAnswersNoPing) {
  auto quick = options();
  quick.limits.ping_interval = milliseconds(40);
  quick.limits.pong_timeout = milliseconds(100);
  start(quick);
  RawWebSocket peer = sender();
  EXPECT_TRUE(eventually([this] { return server_->metrics().senders == 0; }));
}

TEST_F(IngestSessionTest, AnswersWhatIsUnderWayBeforeTheServerStops) {
  RawWebSocket peer = sender();
  next(peer, "ingest.hello");
  peer.send_frame(kBinary, message(1, "a", "x"));
  ASSERT_TRUE(eventually([this] { return blocks_.count() == 1; }));
  std::thread stopping([this] { server_->stop(); });
  std::this_thread::sleep_for(milliseconds(50));
  peer.send_frame(kBinary, message(2, "b", "x"));
  blocks_.answer_first(net::BlockTaken{7, {}});
  EXPECT_EQ(next(peer, "ingest.acknowledged")["revision"], 7);
  EXPECT_EQ(peer.receive_close_code(), 1001U);
  stopping.join();
  EXPECT_EQ(blocks_.count(), 0U) << "nothing is taken that could not be answered";
}

}  // namespace
}  // namespace spectra::tests
