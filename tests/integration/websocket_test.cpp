// The WebSocket side of the server alone: a viewer whose application only echoes, over real sockets.
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <atomic>
#include <mutex>
#include <new>
#include <string>
#include <vector>

#include "protocol/tile_frame.hpp"
#include "tests/integration/raw_client.hpp"
#include "tests/integration/test_server.hpp"

namespace spectra::tests {
namespace {

using std::chrono::milliseconds;
using stream::OutgoingFrame;

/// What the tests see of all sessions together.
struct Record {
  std::atomic<int> opened{0};
  std::atomic<int> closed{0};
  std::atomic<bool> closes_without_memory{false};
  std::atomic<int> binaries{0};
  std::atomic<int> frames_left{0};
  std::atomic<std::size_t> frame_size_bytes{1000};
};

/// Echoes texts; sends the record's frames as fast as they are taken.
class EchoViewer final : public net::ViewerClient {
 public:
  EchoViewer(std::shared_ptr<net::ViewerPeer> peer, Record& record) : peer_(std::move(peer)), record_(record) {}
  void opened() override {
    record_.opened += 1;
    peer_.lock()->send(std::string("hello"));
    peer_.lock()->wake();
  }
  void text_received(std::string_view text) override { peer_.lock()->send(std::string(text)); }
  void binary_received() override { record_.binaries += 1; }
  std::optional<OutgoingFrame> next_frame() override {
    if (record_.frames_left <= 0) return std::nullopt;
    record_.frames_left -= 1;
    OutgoingFrame frame{};
    frame.payload = std::make_shared<const std::vector<std::byte>>(record_.frame_size_bytes);
    return frame;
  }
  void ticked() override {}
  void closed() override {
    record_.closed += 1;
    if (record_.closes_without_memory) throw std::bad_alloc();
  }

 private:
  std::weak_ptr<net::ViewerPeer> peer_;
  Record& record_;
};

class WebSocketTest : public testing::Test {
 protected:
  explicit WebSocketTest(net::NetOptions options = quick_options()) { start(std::move(options)); }

  void start(net::NetOptions options) {
    server_ = std::make_unique<TestServer>(
        std::move(options),
        [](const net::HttpRequest&, const std::function<void(net::HttpReply)>& reply) {
          reply(net::text_reply(200, "ok"));
        },
        [this](const std::shared_ptr<net::ViewerPeer>& peer) { return std::make_shared<EchoViewer>(peer, record_); });
  }

  std::uint16_t port() const { return server_->port(); }

  Record record_;
  std::unique_ptr<TestServer> server_;
};

TEST_F(WebSocketTest, GreetsFirstAndEchoes) {
  RawWebSocket viewer(port());
  ASSERT_TRUE(viewer.is_open()) << viewer.upgrade_response();
  EXPECT_NE(viewer.upgrade_response().find("Sec-WebSocket-Protocol: spectra.v1"), std::string::npos);
  EXPECT_EQ(viewer.receive_text(), "hello");
  viewer.send_text("one");
  EXPECT_EQ(viewer.receive_text(), "one");
}

TEST_F(WebSocketTest, OffersNoCompression) {
  RawWebSocket viewer(port(), "Sec-WebSocket-Extensions: permessage-deflate; client_max_window_bits\r\n");
  ASSERT_TRUE(viewer.is_open());
  EXPECT_EQ(viewer.upgrade_response().find("Sec-WebSocket-Extensions"), std::string::npos);
}

TEST_F(WebSocketTest, WantsItsSubprotocol) {
  for (const auto* subprotocol : {"", "spectra.v2", "chat", "spectra", "SPECTRA.V1"}) {
    RawWebSocket viewer(port(), "", subprotocol);
    EXPECT_EQ(status_of(viewer.upgrade_response()), 400) << subprotocol;
  }
  EXPECT_TRUE(RawWebSocket(port(), "", "chat, spectra.v1").is_open());
  EXPECT_TRUE(eventually([this] { return record_.opened == 1; }));
}

TEST_F(WebSocketTest, KnowsTheFormsOfHello) {
  for (const auto* target : {"/ws?hello=short", "/ws?hello=", "/ws?hello=brief&hello=BRIEF"}) {
    const RawWebSocket viewer(port(), "", "spectra.v1", target);
    EXPECT_EQ(status_of(viewer.upgrade_response()), 400) << target;
  }
  for (const auto* target : {"/ws?hello=full", "/ws?hello=brief", "/ws?another=x"}) {
    EXPECT_TRUE(RawWebSocket(port(), "", "spectra.v1", target).is_open()) << target;
  }
}

TEST_F(WebSocketTest, WantsAnOriginOfItsList) {
  for (const auto* origin :
       {"http://evil.example", "https://localhost.evil.example", "null", "", "file://", "http://localhost:x",
        "ftp://localhost", "http://", "localhost", "http://localhost@evil.example", "http://localhost/"}) {
    RawWebSocket viewer(port(), "Origin: " + std::string(origin) + "\r\n");
    EXPECT_EQ(status_of(viewer.upgrade_response()), 403) << origin;
  }
  EXPECT_EQ(
      status_of(RawWebSocket(port(), "Origin: http://localhost\r\nOrigin: http://localhost\r\n").upgrade_response()),
      403);
  for (const auto* origin : {"http://localhost", "http://127.0.0.1:8080", "https://[::1]:99"}) {
    EXPECT_TRUE(RawWebSocket(port(), "Origin: " + std::string(origin) + "\r\n").is_open()) << origin;
  }
  EXPECT_TRUE(RawWebSocket(port()).is_open()) << "a client that is no browser sends none";
}

TEST_F(WebSocketTest, AnswersABadUpgradeWithAnError) {
  const auto status = [this](const std::string& lines) {
    return status_of(
        http_exchange(port(), "GET /ws HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" + lines + "\r\n"));
  };
  EXPECT_EQ(status(""), 426);
  const std::string upgrade =
      "GET /ws HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
      "Sec-WebSocket-Protocol: spectra.v1\r\n";
  EXPECT_EQ(status_of(http_exchange(port(), upgrade + "Sec-WebSocket-Version: 12\r\nSec-WebSocket-Key: "
                                                      "dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n")) /
                100,
            4);
  EXPECT_EQ(status_of(http_exchange(port(), upgrade + "Sec-WebSocket-Version: 13\r\n\r\n")) / 100, 4);
  const std::string key = "Sec-WebSocket-Key: ";
  for (const auto& keys :
       {key + "YWJj\r\n", key + "dGhlIHNhbXBsZSBub25jZQ==\r\n" + key + "dGhlIHNhbXBsZSBub25jZQ==\r\n",
        key + "dGhlIHNhbXBsZSBub25jZQ!=\r\n", key + "dGhlIHNhbXBsZSBub25jZTEy\r\n", key + "\r\n"}) {
    EXPECT_EQ(status_of(http_exchange(port(), upgrade + "Sec-WebSocket-Version: 13\r\n" + keys + "\r\n")), 400) << keys;
  }
  EXPECT_EQ(status_of(http_exchange(port(), upgrade +
                                                "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: "
                                                "dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n" +
                                                masked_frame(1, "too early"))),
            400);
  EXPECT_EQ(record_.opened, 0);
}

TEST_F(WebSocketTest, AcceptsAMessageAtTheLimitAndClosesBeyondIt) {
  RawWebSocket viewer(port());
  ASSERT_EQ(viewer.receive_text(), "hello");
  const std::string largest(64 * 1024, 'x');
  viewer.send_text(largest);
  EXPECT_EQ(viewer.receive_text(), largest);
  viewer.send_text(largest + "x");
  EXPECT_EQ(viewer.receive_close_code(), 1009U);
  EXPECT_TRUE(eventually([this] { return record_.closed == 1; }));
}

TEST_F(WebSocketTest, CountsFragmentsTogether) {
  RawWebSocket viewer(port());
  ASSERT_EQ(viewer.receive_text(), "hello");
  viewer.send_frame(1, "frag", false);
  viewer.send_frame(9, "between");
  viewer.send_frame(0, "ments", true);
  EXPECT_EQ(viewer.receive_text(), "fragments");
  viewer.send_frame(1, std::string(40 * 1024, 'x'), false);
  viewer.send_frame(0, std::string(40 * 1024, 'x'), true);
  EXPECT_EQ(viewer.receive_close_code(), 1009U);
}

TEST_F(WebSocketTest, AnswersBrokenFramesWithTheirCloseCodes) {
  struct Case {
    const char* what;
    std::string bytes;
    unsigned code;
  };
  std::vector<Case> cases{
      {"not masked", std::string("\x81\x02hi", 4), 1002},
      {"reserved bit", std::string("\xC1\x82\0\0\0\0hi", 8), 1002},
      {"reserved opcode", masked_frame(3, "hi"), 1002},
      {"reserved control opcode", masked_frame(11, "hi"), 1002},
      {"continuation of nothing", masked_frame(0, "hi"), 1002},
      {"message inside a message", masked_frame(1, "hi", false) + masked_frame(1, "hi"), 1002},
      {"ping in fragments", masked_frame(9, "hi", false), 1002},
      {"ping too long", masked_frame(9, std::string(126, 'x')), 1002},
      {"text that is not UTF-8", masked_frame(1, "\xff\xfe"), 1007},
      {"text that ends inside a character", masked_frame(1, "\xe2\x82"), 1007},
      {"close with half a code", masked_frame(8, "\x03"), 1002},
      {"close with a reserved code", masked_frame(8, std::string("\x03\xed", 2)), 1002},
      {"close with a reason that is not UTF-8", masked_frame(8, std::string("\x03\xe8\xff", 3)), 1002},
      {"close with a code beyond all", masked_frame(8, std::string("\x13\x88", 2)), 1002},
      {"close with the largest code", masked_frame(8, std::string("\xff\xff", 2)), 1002},
      {"close with a code of one's own", masked_frame(8, std::string("\x13\x87", 2)), 4999},
      {"close as it should be", masked_frame(8, std::string("\x03\xe8", 2)), 1000},
      {"continuation after the end", masked_frame(1, "h", false) + masked_frame(0, "i") + masked_frame(0, "!"), 1002},
      {"binary inside a text", masked_frame(1, "h", false) + masked_frame(2, "i"), 1002},
      {"ping inside a message, then a message in it",
       masked_frame(1, "h", false) + masked_frame(9, "") + masked_frame(1, "i"), 1002},
      {"pong in fragments", masked_frame(10, "hi", false), 1002},
      {"close in fragments", masked_frame(8, std::string("\x03\xe8", 2), false), 1002},
      {"pong too long", masked_frame(10, std::string(126, 'x')), 1002},
      {"close too long", masked_frame(8, "\x03\xe8" + std::string(124, 'x')), 1002},
      {"not masked and binary", std::string("\x82\x02hi", 4), 1002},
      {"not masked and empty", std::string("\x81\0", 2), 1002},
      {"ping that is not masked", std::string("\x89\0", 2), 1002},
      {"close that is not masked", std::string("\x88\x02\x03\xe8", 4), 1002},
      {"overlong UTF-8", masked_frame(1, "\xc0\xaf"), 1007},
      {"a surrogate", masked_frame(1, "\xed\xa0\x80"), 1007},
      {"beyond all characters", masked_frame(1, "\xf4\x90\x80\x80"), 1007},
      {"a byte that begins no character", masked_frame(1, "\xf5"), 1007},
      {"the middle of a character", masked_frame(1, "\x80"), 1007},
      {"half a character, and the rest is none", masked_frame(1, "\xe2\x82", false) + masked_frame(0, "x"), 1007},
      {"close with half a character", masked_frame(8, std::string("\x03\xe8\xe2\x82", 4)), 1002},
  };
  for (const unsigned opcode : {4U, 5U, 6U, 7U, 12U, 13U, 14U, 15U}) {
    cases.push_back({"another reserved opcode", masked_frame(opcode, ""), 1002});
  }
  for (const char first : {'\xA1', '\x91', '\xF1', '\xC2', '\xC9', '\xC8'}) {
    cases.push_back({"another reserved bit", std::string({first, '\x80', 0, 0, 0, 0}), 1002});
  }
  const auto close_frame = [](unsigned code) {
    return masked_frame(8, std::string({static_cast<char>(code >> 8U), static_cast<char>(code & 255U)}));
  };
  // RFC 6455, 7.4, and the registry of IANA.
  for (const unsigned code : {0U, 999U, 1004U, 1006U, 1015U, 1016U, 1100U, 2000U, 2999U, 6000U}) {
    cases.push_back({"close with a code that may not be sent", close_frame(code), 1002});
  }
  for (const unsigned code : {1001U, 1003U, 1007U, 1008U, 1009U, 1010U, 1011U, 3000U, 3999U, 4000U}) {
    cases.push_back({"close with a code that may", close_frame(code), code});
  }
  EXPECT_GE(cases.size(), 60U);
  for (const auto& [what, bytes, code] : cases) {
    RawWebSocket viewer(port());
    ASSERT_EQ(viewer.receive_text(), "hello");
    viewer.client().send(bytes);
    EXPECT_EQ(viewer.receive_close_code(), code) << what;
  }
  EXPECT_TRUE(eventually([&] { return record_.closed == static_cast<int>(cases.size()); }));
}

TEST_F(WebSocketTest, AnswersPings) {
  RawWebSocket viewer(port());
  ASSERT_EQ(viewer.receive_text(), "hello");
  viewer.send_frame(9, "are you there");
  const auto pong = viewer.receive();
  ASSERT_TRUE(pong);
  EXPECT_EQ(pong->opcode, 10U);
  EXPECT_EQ(pong->payload, "are you there");
}

TEST_F(WebSocketTest, HandsBinaryMessagesOn) {
  RawWebSocket viewer(port());
  ASSERT_EQ(viewer.receive_text(), "hello");
  viewer.send_frame(2, "bytes");
  EXPECT_TRUE(eventually([this] { return record_.binaries == 1; }));
  viewer.send_text("still here");
  EXPECT_EQ(viewer.receive_text(), "still here");
}

TEST_F(WebSocketTest, SendsAFrameAsOneBinaryMessage) {
  record_.frames_left = 3;
  record_.frame_size_bytes = 200'000;
  RawWebSocket viewer(port());
  ASSERT_EQ(viewer.receive_text(), "hello");
  for (int i = 0; i < 3; ++i) {
    const auto frame = viewer.receive();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->opcode, 2U);
    EXPECT_TRUE(frame->is_final);
    EXPECT_EQ(frame->payload.size(), protocol::kTileFrameHeaderSize + 200'000);
  }
}

TEST_F(WebSocketTest, SurvivesADisconnectInsideAFrame) {
  record_.frames_left = 1000;
  record_.frame_size_bytes = 1'000'000;
  for (int i = 0; i < 20; ++i) {
    RawWebSocket viewer(port());
    ASSERT_TRUE(viewer.is_open());
    viewer.client().receive_some();
  }
  EXPECT_TRUE(eventually([this] { return record_.closed == 20; }));
  EXPECT_TRUE(eventually([this] { return server_->metrics().viewers == 0; }));
  EXPECT_TRUE(RawWebSocket(port()).is_open());
}

TEST_F(WebSocketTest, CutsAViewerThatReadsNoFrames) {
  record_.frames_left = 1000;
  record_.frame_size_bytes = 1'000'000;
  RawWebSocket viewer(port());
  ASSERT_TRUE(viewer.is_open());
  viewer.client().set_receive_buffer(4096);
  EXPECT_TRUE(eventually([this] { return server_->metrics().viewers_cut == 1; }));
  EXPECT_TRUE(eventually([this] { return record_.closed == 1; }));
}

TEST_F(WebSocketTest, CutsAViewerThatTalksButNeverReads) {
  RawWebSocket viewer(port());
  ASSERT_TRUE(viewer.is_open());
  const std::string message = masked_frame(1, std::string(60'000, 'x'));
  const auto begin = std::chrono::steady_clock::now();
  while (record_.closed == 0 && std::chrono::steady_clock::now() - begin < std::chrono::seconds(10)) {
    viewer.client().send_some(message);
    std::this_thread::sleep_for(milliseconds(1));
  }
  EXPECT_EQ(record_.closed, 1);
  EXPECT_GE(server_->metrics().viewers_cut, 1U);
}

// All that he is sent fits the buffers of the kernels, so that no write ever waits for him.
TEST_F(WebSocketTest, CutsAViewerThatTalksAndIsOwedLittleButNeverReads) {
  auto options = quick_options();
  options.limits.ping_interval = milliseconds(50);
  options.limits.pong_timeout = milliseconds(250);
  start(std::move(options));
  record_.frames_left = 2;
  record_.frame_size_bytes = 10'000;
  RawWebSocket viewer(port());
  ASSERT_TRUE(viewer.is_open());
  const auto begin = std::chrono::steady_clock::now();
  while (record_.closed == 0 && std::chrono::steady_clock::now() - begin < std::chrono::seconds(10)) {
    viewer.client().send_some(masked_frame(1, "still here"));
    std::this_thread::sleep_for(milliseconds(10));
  }
  EXPECT_EQ(record_.closed, 1);
  EXPECT_EQ(server_->metrics().viewers_cut, 1U);
}

TEST_F(WebSocketTest, PongsThatNobodyAskedForKeepNobody) {
  auto options = quick_options();
  options.limits.ping_interval = milliseconds(50);
  options.limits.pong_timeout = milliseconds(250);
  start(std::move(options));
  RawWebSocket viewer(port());
  ASSERT_TRUE(viewer.is_open());
  const auto begin = std::chrono::steady_clock::now();
  while (record_.closed == 0 && std::chrono::steady_clock::now() - begin < std::chrono::seconds(10)) {
    viewer.client().send_some(masked_frame(10, ""));
    std::this_thread::sleep_for(milliseconds(10));
  }
  EXPECT_EQ(record_.closed, 1);
  EXPECT_EQ(server_->metrics().viewers_cut, 1U);
}

// He is owed more than the kernels hold, so that a ping waits behind it for as long as he does not read.
TEST_F(WebSocketTest, StopsBesideAPingThatCannotBeWritten) {
  auto options = quick_options();
  options.limits.ping_interval = milliseconds(30);
  options.limits.pong_timeout = std::chrono::seconds(30);
  options.limits.write_timeout = std::chrono::seconds(30);
  start(std::move(options));
  record_.frames_left = 40;
  record_.frame_size_bytes = 1'000'000;
  RawWebSocket viewer(port());
  ASSERT_TRUE(viewer.is_open());
  for (int i = 0; i < 50; ++i) {
    viewer.client().send_some(masked_frame(10, ""));
    std::this_thread::sleep_for(milliseconds(10));
  }
  ASSERT_EQ(record_.closed, 0);
  const auto begin = std::chrono::steady_clock::now();
  server_->stop();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
  EXPECT_EQ(record_.closed, 1);
}

TEST_F(WebSocketTest, KeepsAViewerThatReadsSlowlyAndSaysNothing) {
  auto options = quick_options();
  options.limits.write_timeout = milliseconds(800);
  options.limits.ping_interval = milliseconds(100);
  options.limits.pong_timeout = milliseconds(800);
  start(std::move(options));
  constexpr int kFrames = 4;
  record_.frame_size_bytes = 1'000'000;
  record_.frames_left = kFrames;
  RawWebSocket slow(port());
  ASSERT_TRUE(slow.is_open());
  slow.client().set_receive_buffer(128 * 1024);
  // About 1.2 MB/s: the whole takes several times the write timeout, but never stands still for it.
  std::size_t received = 0;
  // The upgrade may have brought the first of them along.
  while (received < kFrames * 1'000'000U - 70'000U) {
    std::string bytes(12'000, 0);
    const auto count = recv(slow.client().descriptor(), bytes.data(), bytes.size(), 0);
    ASSERT_GT(count, 0) << "after " << received << " bytes";
    received += static_cast<std::size_t>(count);
    std::this_thread::sleep_for(milliseconds(10));
  }
  EXPECT_EQ(server_->metrics().viewers_cut, 0U);
}

TEST_F(WebSocketTest, CutsASilentPeer) {
  auto options = quick_options();
  options.limits.idle_timeout = milliseconds(200);
  start(std::move(options));
  RawWebSocket viewer(port());
  ASSERT_EQ(viewer.receive_text(), "hello");
  EXPECT_TRUE(eventually([this] { return server_->metrics().viewers_cut == 1; }));
}

TEST_F(WebSocketTest, PingsAndMeasuresTheRoundTrip) {
  auto options = quick_options();
  options.limits.ping_interval = milliseconds(40);
  options.limits.pong_timeout = milliseconds(200);
  options.limits.idle_timeout = milliseconds(400);
  start(std::move(options));
  RawWebSocket viewer(port());
  ASSERT_EQ(viewer.receive_text(), "hello");
  for (int i = 0; i < 15; ++i) {
    const auto frame = viewer.receive();
    ASSERT_TRUE(frame) << "a peer that answers pings is never cut";
    ASSERT_EQ(frame->opcode, 9U);
    viewer.send_frame(10, frame->payload);
  }
  EXPECT_EQ(server_->metrics().viewers_cut, 0U);
}

TEST_F(WebSocketTest, ClosesPolitelyOnStop) {
  RawWebSocket viewer(port());
  RawClient idle(port());
  ASSERT_EQ(viewer.receive_text(), "hello");
  std::thread stopper([this] { server_->stop(); });
  EXPECT_EQ(viewer.receive_close_code(), 1001U);
  viewer.send_frame(8, std::string("\x03\xe9", 2));
  stopper.join();
  EXPECT_EQ(record_.closed, 1);
}

TEST_F(WebSocketTest, NothingStaysOfAViewerWhoseEndFails) {
  server_->stop();
  auto options = quick_options();
  options.limits.stop_timeout = std::chrono::seconds(10);
  start(std::move(options));
  record_.closes_without_memory = true;
  for (int i = 0; i < 3; ++i) {
    RawWebSocket viewer(port());
    ASSERT_EQ(viewer.receive_text(), "hello");
  }
  ASSERT_TRUE(eventually([this] { return record_.closed == 3; }));
  const auto& of_role = server_->metrics().of(access::AccessRole::Admin);
  EXPECT_TRUE(eventually([this] { return server_->metrics().viewers == 0; }, milliseconds(2000)));
  EXPECT_TRUE(eventually([&of_role] { return of_role.viewers == 0 && of_role.queued_bytes == 0; }, milliseconds(2000)));
  const auto begin = std::chrono::steady_clock::now();
  server_->stop();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(5)) << "it waits for nobody";
}

TEST_F(WebSocketTest, StopsInTimeWithPeersThatDoNotAnswer) {
  record_.frames_left = 1000;
  record_.frame_size_bytes = 1'000'000;
  std::vector<RawWebSocket> deaf;
  for (int i = 0; i < 5; ++i) deaf.emplace_back(port());
  ASSERT_TRUE(eventually([this] { return record_.opened == 5; }));
  const auto begin = std::chrono::steady_clock::now();
  server_->stop();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(5));
  EXPECT_EQ(record_.closed, 5);
}

TEST_F(WebSocketTest, GivesEverythingBackAfterManyConnections) {
  for (int i = 0; i < 500; ++i) {
    RawWebSocket viewer(port());
    ASSERT_TRUE(viewer.is_open());
  }
  EXPECT_TRUE(eventually([this] { return record_.closed == 500; }));
  EXPECT_TRUE(eventually([this] { return server_->metrics().connections_open == 0; }));
}

}  // namespace
}  // namespace spectra::tests
