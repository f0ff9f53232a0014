// The application's side of a viewer over real sockets: what is said and answered, on a small generated scene.
#include "server/session/viewer_session.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <future>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "fusion/demo/demo_scene.hpp"
#include "protocol/codec/draco_codec.hpp"
#include "protocol/tile_frame.hpp"
#include "server/api/http_api.hpp"
#include "server/jobs/priority.hpp"
#include "tests/integration/raw_client.hpp"
#include "tests/integration/test_server.hpp"

namespace spectra::tests {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;

/// A wavy sheet of `side` x `side` vertices, warmer to the right; every 50th vertex has no temperature.
mesh::MultispectralMesh sheet(std::uint32_t side, bool with_temperature = true) {
  mesh::MultispectralMesh mesh;
  mesh.name = "sheet";
  mesh.has_visible = true;
  mesh.has_temperature = with_temperature;
  mesh.resize_vertices(std::size_t{side} * side);
  for (std::uint32_t y = 0; y < side; ++y) {
    for (std::uint32_t x = 0; x < side; ++x) {
      const std::size_t i = std::size_t{y} * side + x;
      const auto u = static_cast<float>(x) / static_cast<float>(side);
      const auto v = static_cast<float>(y) / static_cast<float>(side);
      mesh.positions()[i] = {u, v, 0.05F * std::sin(9 * u)};
      mesh.visible()[i] = {static_cast<std::uint8_t>(255 * v), 100, 50};
      if (with_temperature) {
        mesh.temperature_celsius()[i] = i % 50 == 0 ? std::numeric_limits<float>::quiet_NaN() : 15 + 20 * u;
      }
      if (x + 1 < side && y + 1 < side) {
        const auto a = static_cast<std::uint32_t>(i);
        mesh.triangles().push_back({a, a + 1, a + side});
        mesh.triangles().push_back({a + 1, a + side + 1, a + side});
      }
    }
  }
  return mesh;
}

/// A client that speaks the protocol.
class Viewer {
 public:
  explicit Viewer(std::uint16_t port, std::string_view target = "/ws") : socket_(port, "", "spectra.v1", target) {}

  bool is_open() const { return socket_.is_open(); }
  RawWebSocket& socket() { return socket_; }

  /// Reads one message; frames are kept and acknowledged, texts returned.
  std::optional<json> receive() {
    for (;;) {
      const auto message = socket_.receive();
      if (!message) return std::nullopt;
      if (message->opcode == 1) return json::parse(message->payload);
      if (message->opcode == 9) socket_.send_frame(10, message->payload);
      if (message->opcode == 2) take_frame(message->payload);
    }
  }

  /// Reads until a notification of this method, keeping nothing else but frames.
  std::optional<json> wait_for(const std::string& method) {
    while (auto message = receive()) {
      if (message->value("method", "") == method) return (*message)["params"];
    }
    return std::nullopt;
  }

  void send(const json& message) { socket_.send_text(message.dump()); }

  /// Sends a request without waiting; returns its id.
  int request(const std::string& method, const json& params = json::object()) {
    send({{"jsonrpc", "2.0"}, {"id", ++last_id_}, {"method", method}, {"params", params}});
    return last_id_;
  }

  /// The response to a request, with `result` or `error`.
  json response(int id) {
    while (auto message = receive()) {
      if (message->contains("id") && (*message)["id"] == id) return *message;
      if (message->contains("method")) notifications_[(*message)["method"]] = (*message)["params"];
    }
    return {};
  }

  json call(const std::string& method, const json& params = json::object()) {
    return response(request(method, params));
  }

  /// The last params of a notification that came while a response was waited for.
  json notification(const std::string& method) { return notifications_[method]; }

  /// Subscribes and reads until everything is there.
  json subscribe_and_complete() {
    EXPECT_TRUE(call("scene.subscribe", {{"channels", {"fused"}}}).contains("result"));
    return wait_for("stream.complete").value_or(json{});
  }

  /// Fused colours per tile, as decoded from the newest colour frame of each.
  const std::map<protocol::TileId, std::vector<protocol::codec::ColourBytes>>& colours() const { return colours_; }
  std::size_t geometry_frames() const { return geometry_frames_; }
  std::uint32_t newest_generation() const { return newest_generation_; }
  std::uint32_t oldest_generation() const { return oldest_generation_; }

 private:
  void take_frame(const std::string& bytes) {
    const auto frame = protocol::decoded_frame(std::as_bytes(std::span(bytes))).value();
    if (frame.header.kind == protocol::FrameKind::Geometry) ++geometry_frames_;
    if (frame.header.kind == protocol::FrameKind::Colours) {
      colours_[frame.header.tile] = protocol::codec::decoded_colours(frame.payload).value();
      EXPECT_GE(frame.header.generation, newest_generation_);
      newest_generation_ = frame.header.generation;
      oldest_generation_ = std::min(oldest_generation_, frame.header.generation);
    }
    EXPECT_EQ(frame.header.sequence, ++last_sequence_);
    send({{"jsonrpc", "2.0"}, {"method", "stream.ack"}, {"params", {{"sequence", frame.header.sequence}}}});
  }

  RawWebSocket socket_;
  int last_id_ = 0;
  std::uint32_t last_sequence_ = 0;
  std::size_t geometry_frames_ = 0;
  std::uint32_t newest_generation_ = 0;
  std::uint32_t oldest_generation_ = std::numeric_limits<std::uint32_t>::max();
  std::map<protocol::TileId, std::vector<protocol::codec::ColourBytes>> colours_;
  std::map<std::string, json> notifications_;
};

class ViewerSessionTest : public testing::Test {
 protected:
  static constexpr int kThreads = 2;

  explicit ViewerSessionTest()
      : served_(kThreads, 64U << 20U), map_(served_.scenes, served_.pool, nullptr), api_(served_, map_) {
    served_.mark_baseline = [this](sources::BaselineDone done) { map_.mark_baseline(std::move(done)); };
    start(quick_options());
  }

  void start(net::NetOptions options) {
    options.limits.write_timeout = std::chrono::seconds(5);
    const auto limits = options.limits;
    server_ = std::make_unique<TestServer>(
        std::move(options), [this](const auto& request, const auto& reply) { api_.handle(request, reply); },
        [this, limits](const std::shared_ptr<net::ViewerPeer>& peer) {
          return std::make_shared<session::ViewerSession>(peer, served_, limits);
        });
    api_.set_metrics(server_->metrics());
  }
  ~ViewerSessionTest() override { server_->stop(); }

  /// The server again, with other limits.
  template <class Change>
  void restart(const Change& change) {
    server_->stop();
    auto options = quick_options();
    change(options.limits);
    start(std::move(options));
  }

  /// Nothing is prepared, made or encoded until `go` is set.
  void hold_pool(std::promise<void>& go) {
    const std::shared_future<void> gate = go.get_future().share();
    for (int thread = 0; thread < kThreads; ++thread) served_.pool.post([gate] { gate.wait(); }, jobs::kAnswerPriority);
  }

  void serve(mesh::MultispectralMesh mesh) { served_.scenes.replace(std::move(mesh), served_.pool); }
  std::string get(const std::string& target) const {
    return http_exchange(server_->port(),
                         "GET " + target + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  }

  std::unique_ptr<TestServer> server_;  // outlives the pool, whose jobs answer through it
  session::ServedScene served_;
  sources::MapKeeper map_;
  api::HttpApi api_;
};

TEST_F(ViewerSessionTest, TakesBlocksWhenTheMapIsOpen) {
  const std::string body =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 "
      "3\n";
  const auto put = [&] {
    return status_of(http_exchange(server_->port(),
                                   "PUT /api/v1/blocks/a HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
                                   "Content-Length: " +
                                       std::to_string(body.size()) + "\r\n\r\n" + body));
  };
  EXPECT_EQ(put(), 503) << "nothing is lost in a map that is replaced by the file that is still being read";
  EXPECT_EQ(status_of(get("/api/v1/blocks")), 503) << "nobody knows yet what is there";
  EXPECT_EQ(status_of(get("/api/v1/blocks/a")), 503);
  ASSERT_EQ(map_.restore(), std::nullopt);
  EXPECT_EQ(status_of(get("/api/v1/blocks")), 200);
  EXPECT_EQ(status_of(get("/api/v1/blocks/a")), 404);
  EXPECT_EQ(put(), 200);
  EXPECT_EQ(served_.scenes.current()->vertex_count(), 1U);
  map_.end();
  EXPECT_EQ(put(), 503);
}

TEST_F(ViewerSessionTest, ABurstOfLargeAnswersIsRefusedInPartAndCutsNobody) {
  serve(demo::demo_scene({.vertex_count = 20'000, .seed = 3}));
  RawWebSocket viewer(server_->port());
  viewer.client().set_receive_buffer(4096);
  ASSERT_TRUE(viewer.receive_text());
  constexpr int kBurst = 16;
  for (int i = 1; i <= kBurst; ++i) {
    viewer.send_text(
        json{{"jsonrpc", "2.0"}, {"id", i}, {"method", "scene.histogram"}, {"params", {{"bins", 4096}}}}.dump());
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  int answered = 0, refused = 0;
  while (answered + refused < kBurst) {
    const auto text = viewer.receive_text();
    ASSERT_TRUE(text) << "cut after " << answered << " answers and " << refused << " refusals";
    const auto message = json::parse(*text);
    if (!message.contains("id")) continue;
    if (message.contains("result")) {
      ++answered;
    } else {
      EXPECT_EQ(message["error"]["code"], -32003);
      ++refused;
    }
  }
  EXPECT_GT(answered, 0);
  EXPECT_GT(refused, 0);
}

TEST_F(ViewerSessionTest, AnswersThatNobodyReadsAreBoundedForAllTogether) {
  restart([](net::NetLimits& limits) { limits.queue_bytes_at_once = 1'000'000; });
  serve(demo::demo_scene({.vertex_count = 20'000, .seed = 3}));
  const auto ask = [](int id) {
    return json{{"jsonrpc", "2.0"}, {"id", id}, {"method", "scene.histogram"}, {"params", {{"bins", 4096}}}}.dump();
  };
  RawWebSocket reader(server_->port());
  ASSERT_TRUE(reader.receive_text());
  const auto code = [&reader, &ask](int id) {
    reader.send_text(ask(id));
    for (;;) {
      const auto text = reader.receive_text();
      if (!text) return -1;
      const auto message = json::parse(*text);
      if (message.contains("id")) return message.contains("result") ? 0 : message["error"]["code"].get<int>();
    }
  };
  ASSERT_EQ(code(1), 0);
  const auto& metrics = server_->metrics();
  const auto& of_role = metrics.of(access::AccessRole::Admin);
  std::vector<std::unique_ptr<RawWebSocket>> silent;
  std::int64_t most_bytes = 0;
  // The kernel takes much of what they do not read.
  while (metrics.viewers_cut < 5 && silent.size() < 60) {
    silent.push_back(std::make_unique<RawWebSocket>(server_->port()));
    silent.back()->client().set_receive_buffer(4096);
    for (int i = 0; i < 12; ++i) silent.back()->send_text(ask(i));
    std::this_thread::sleep_for(milliseconds(20));
    most_bytes = std::max(most_bytes, of_role.queued_bytes.load());
    ASSERT_EQ(code(2), 0) << "who reads is answered, also beside " << silent.size() << " who do not";
  }
  EXPECT_GE(metrics.viewers_cut, 5U) << "of " << silent.size();
  EXPECT_GT(most_bytes, 300'000);
  EXPECT_LT(most_bytes, 1'500'000) << "those who have given way until they see it, too";
  silent.clear();
  EXPECT_EQ(code(3), 0);
  EXPECT_TRUE(eventually([&] { return of_role.queued_bytes == 0; }));
}

TEST_F(ViewerSessionTest, WhatIsSharedOfGreetingsTakesNoRoom) {
  restart([](net::NetLimits& limits) { limits.queue_bytes_at_once = 400'000; });
  serve(sheet(40));
  // Greetings of 150 kB each that nobody reads.
  std::vector<std::unique_ptr<RawWebSocket>> silent;
  for (int i = 0; i < 12; ++i) {
    silent.push_back(std::make_unique<RawWebSocket>(server_->port()));
    silent.back()->client().set_receive_buffer(4096);
  }
  Viewer viewer(server_->port());
  EXPECT_TRUE(viewer.call("scene.histogram", {{"bins", 64}}).contains("result"));
  EXPECT_EQ(server_->metrics().viewers_cut, 0U);
}

TEST_F(ViewerSessionTest, RefusedTextsAreCountedBeforeTheyAreRead) {
  restart([](net::NetLimits& limits) {
    limits.message_bytes_per_s = 20'000;
    limits.message_burst_s = 1;
  });
  Viewer flood(server_->port()), other(server_->port());
  ASSERT_TRUE(flood.wait_for("hello"));
  ASSERT_TRUE(other.wait_for("hello"));
  const auto before = server_->metrics().messages_received.load();
  const auto begin = std::chrono::steady_clock::now();
  const std::string rubbish = "[" + std::string(9'998, '1') + "]";
  for (int i = 0; i < 30; ++i) flood.socket().send_text(rubbish);
  std::this_thread::sleep_for(milliseconds(500));
  EXPECT_TRUE(other.call("fusion.get").contains("result"));
  const auto read = static_cast<double>(server_->metrics().messages_received - before - 1);
  const double passed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  EXPECT_GE(read, 1);
  EXPECT_LE(read, 1 + (1 + passed_s) * 20'000 / 10'000) << "texts of 10 kB at 20 kB a second";
}

TEST_F(ViewerSessionTest, AFileThatIsBeingSentIsNotMadeAgainAndHindersNobody) {
  serve(demo::demo_scene({.vertex_count = 300'000, .seed = 3}));
  const auto ask = [](const std::string& query) {
    return "GET /api/v1/scene.ply?method=visible_only" + query + " HTTP/1.1\r\nHost: localhost\r\n\r\n";
  };
  // Many who do not read on, of a few files.
  std::vector<RawClient> slow;
  for (int i = 0; i < 6; ++i) {
    slow.emplace_back(server_->port());
    slow.back().set_receive_buffer(4096);
    slow.back().send(ask(""));
    const auto begin = slow.back().receive_some();
    ASSERT_TRUE(begin);
    EXPECT_EQ(status_of(*begin), 200) << i;
  }
  EXPECT_EQ(status_of(get("/api/v1/scene.ply?method=thermal_only")), 200);
  const auto whole = get("/api/v1/scene.ply?method=visible_only");
  EXPECT_EQ(status_of(whole), 200);
  EXPECT_GT(whole.size(), 300'000U * 12);
}

TEST_F(ViewerSessionTest, BlocksBeyondTheBoundAreRefusedBeforeTheyAreRead) {
  restart([](net::NetLimits& limits) {
    limits.block_size_bytes = 2000;
    limits.block_bytes_at_once = 3000;
  });
  ASSERT_EQ(map_.restore(), std::nullopt);
  const auto head = [](std::size_t size) {
    return "PUT /api/v1/blocks/a HTTP/1.1\r\nHost: localhost\r\nContent-Length: " + std::to_string(size) + "\r\n\r\n";
  };
  const auto too_large = http_exchange(server_->port(), head(2001));
  EXPECT_EQ(status_of(too_large), 413);
  EXPECT_NE(too_large.find("\"limits\":\"2000 bytes\""), std::string::npos);
  RawClient slow(server_->port());
  slow.send_some(head(1800));
  const auto refused = http_exchange(server_->port(), head(1800));
  EXPECT_EQ(status_of(refused), 503);
  EXPECT_NE(refused.find("\"code\":\"busy\""), std::string::npos);
  EXPECT_NE(refused.find("Retry-After"), std::string::npos);
}

TEST_F(ViewerSessionTest, ARefusalReachesWhoIsStillSending) {
  restart([](net::NetLimits& limits) { limits.block_size_bytes = 2000; });
  ASSERT_EQ(map_.restore(), std::nullopt);
  const std::string body(1'000'000, 'x');
  for (int i = 0; i < 10; ++i) {
    RawClient sender(server_->port());
    sender.send("PUT /api/v1/blocks/a HTTP/1.1\r\nHost: localhost\r\nContent-Length: " + std::to_string(body.size()) +
                "\r\n\r\n" + body);
    EXPECT_EQ(status_of(sender.receive_all().value_or("")), 413);
  }
}

TEST_F(ViewerSessionTest, BlocksAreReadMoreSlowlyFromWhoSendsTooMuch) {
  restart([](net::NetLimits& limits) {
    limits.block_bytes_per_s = 1e6;
    limits.message_burst_s = 0.1;
  });
  ASSERT_EQ(map_.restore(), std::nullopt);
  const auto put = [&](std::size_t size) {
    RawClient sender(server_->port());
    sender.send("PUT /api/v1/blocks/a HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Length: " +
                std::to_string(size) + "\r\n\r\n" + std::string(size, 'x'));
    return status_of(sender.receive_all().value_or(""));
  };
  EXPECT_EQ(put(90'000), 422) << "is no PLY";
  EXPECT_EQ(server_->metrics().requests_delayed, 0U);
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(put(400'000), 422) << "is read to its end";
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(200));
  EXPECT_EQ(server_->metrics().requests_delayed, 1U);
}

TEST_F(ViewerSessionTest, GreetsWithEverythingAClientNeeds) {
  serve(sheet(60));
  Viewer viewer(server_->port());
  const auto message = viewer.receive();
  ASSERT_TRUE(message);
  EXPECT_EQ((*message)["method"], "hello");
  const json hello = (*message)["params"];
  EXPECT_EQ(hello["protocol"], "spectra.v1");
  EXPECT_EQ(hello["scene"]["vertex_count"], 3600);
  EXPECT_EQ(hello["scene"]["temperature"]["missing_count"], 72);
  EXPECT_GE(hello["methods"].size(), 10U);
  EXPECT_GE(hello["palettes"].size(), 15U);
  EXPECT_EQ(hello["fusion"]["method"], "histogram_distribution");
  EXPECT_EQ(hello["fusion"]["range"]["mode"], "percentile");
  EXPECT_EQ(hello["fusion"]["range"]["low"], 0.5);
  EXPECT_EQ(hello["fusion"]["range"]["high"], 99.5);
  EXPECT_EQ(hello["limits"]["max_message_bytes"], 65536);
}

TEST_F(ViewerSessionTest, ABriefHelloTellsWhereMethodsAndPalettesAre) {
  const auto body_of = [](const std::string& response) {
    const auto end = response.find("\r\n\r\n");
    return end == std::string::npos ? json() : json::parse(response.substr(end + 4));
  };
  serve(sheet(60));
  json full = *Viewer(server_->port()).wait_for("hello");
  json brief = *Viewer(server_->port(), "/ws?hello=brief").wait_for("hello");
  EXPECT_FALSE(full.contains("catalogue"));
  EXPECT_LT(brief.dump().size(), 3000U);
  const auto path = brief["catalogue"].get<std::string>();

  const auto named = get("/" + path);
  EXPECT_EQ(status_of(named), 200);
  EXPECT_NE(named.find("Cache-Control: public, max-age=31536000, immutable\r\n"), std::string::npos);
  EXPECT_EQ(body_of(named), (json{{"methods", full["methods"]}, {"palettes", full["palettes"]}}));
  const auto newest = get("/api/v1/catalogue");
  EXPECT_EQ(status_of(newest), 200);
  EXPECT_NE(newest.find("Cache-Control: no-cache\r\n"), std::string::npos);
  EXPECT_EQ(body_of(newest), body_of(named));
  for (const auto* other : {"/api/v1/catalogue/", "/api/v1/catalogue/0", "/api/v1/catalogues"}) {
    EXPECT_EQ(status_of(get(other)), 404) << other;
  }

  for (const auto* field : {"methods", "palettes", "session_id"}) full.erase(field);
  for (const auto* field : {"catalogue", "session_id"}) brief.erase(field);
  EXPECT_EQ(brief, full) << "all else is the same";
}

TEST_F(ViewerSessionTest, ServesBeforeThereIsAScene) {
  EXPECT_EQ(status_of(get("/healthz")), 200);
  EXPECT_EQ(status_of(get("/readyz")), 503);
  EXPECT_EQ(status_of(get("/api/v1/scene")), 503);
  Viewer viewer(server_->port());
  EXPECT_TRUE((*viewer.wait_for("hello"))["scene"].is_null());
  EXPECT_EQ(viewer.call("scene.get")["error"]["code"], -32004);
  EXPECT_EQ(viewer.call("scene.probe", {{"position", {0, 0, 0}}})["error"]["code"], -32004);
  EXPECT_EQ(viewer.call("scene.histogram", {{"bins", 8}})["error"]["code"], -32004);
  EXPECT_EQ(viewer.call("scene.extremes")["error"]["code"], -32004);
  EXPECT_TRUE(viewer.call("scene.subscribe", {{"channels", {"fused"}}}).contains("result"));
  EXPECT_TRUE(viewer.call("fusion.set", {{"method", "thermal_only"}}).contains("result"));

  served_.progress.set("Reading it");
  EXPECT_EQ((*viewer.wait_for("status"))["message"], "Reading it");
  served_.progress.set(std::nullopt);
  EXPECT_TRUE((*viewer.wait_for("status"))["message"].is_null());

  serve(sheet(60));
  EXPECT_EQ((*viewer.wait_for("scene.changed"))["scene"]["vertex_count"], 3600);
  const auto changed = viewer.wait_for("fusion.changed");
  ASSERT_TRUE(changed);
  EXPECT_EQ((*changed)["fusion"]["method"], "thermal_only") << "what was chosen before holds";
  EXPECT_GE((*changed)["fusion"]["range"]["min"], 15);
  EXPECT_LT((*changed)["fusion"]["range"]["min"], 16);
  EXPECT_TRUE(viewer.wait_for("stream.complete"));
  EXPECT_EQ(status_of(get("/readyz")), 200);
}

TEST_F(ViewerSessionTest, ASceneBringsItsFirstViewToThoseWhoHaveChangedNothing) {
  Viewer changed(server_->port());
  Viewer unchanged(server_->port());
  EXPECT_EQ((*unchanged.wait_for("hello"))["fusion"]["method"], "visible_only");
  ASSERT_TRUE(changed.wait_for("hello"));
  ASSERT_TRUE(changed.call("fusion.set", {{"palette", "turbo"}}).contains("result"));
  serve(sheet(60));
  EXPECT_EQ((*unchanged.wait_for("fusion.changed"))["fusion"]["method"], "histogram_distribution");
  EXPECT_EQ((*changed.wait_for("fusion.changed"))["fusion"]["method"], "visible_only");
  serve(sheet(60, false));
  EXPECT_EQ((*unchanged.wait_for("fusion.changed"))["fusion"]["method"], "visible_only");
}

TEST_F(ViewerSessionTest, WhoTellsOfItsColoursIsToldOfTheirsAlsoWhereNothingIsKnown) {
  json request = {{"channels", {"fused"}},
                  {"resume",
                   {{"session_id", "0123456789abcdef"},
                    {"tiles", json::array({{0, 0, 0, 0, 1}})},
                    {"colours", json::array({{0, 1}})}}}};
  Viewer early(server_->port());
  EXPECT_EQ(early.call("scene.subscribe", request)["result"],
            json({{"resumed_tiles", 0}, {"current_colours", json::array()}, {"generation", 0}}));
  serve(sheet(40));
  Viewer late(server_->port());
  const json reply = late.call("scene.subscribe", request)["result"];
  EXPECT_EQ(reply["current_colours"], json::array());
  EXPECT_EQ(reply["generation"], late.call("fusion.get")["result"]["generation"]);
  EXPECT_GT(reply["generation"], 0);
  request["resume"].erase("colours");
  Viewer silent(server_->port());
  EXPECT_EQ(silent.call("scene.subscribe", request)["result"], json({{"resumed_tiles", 0}}));
}

TEST_F(ViewerSessionTest, SaysHowMuchIsHighlighted) {
  serve(sheet(60));
  Viewer viewer(server_->port());
  ASSERT_TRUE(viewer.wait_for("hello"));
  const auto share_of = [&](const json& change) {
    EXPECT_TRUE(viewer.call("fusion.set", change).contains("result")) << change;
    return viewer.call("scene.histogram", {{"bins", 8}})["result"].value("highlighted_share", -1.0);
  };
  EXPECT_EQ(share_of({{"method", "colour_mapped_threshold"}, {"params", {{"threshold", 1000}}}}), 0)
      << "a threshold beyond the data is taken";
  EXPECT_GT(share_of({{"params", {{"threshold", -1000}}}}), 0.9);
  EXPECT_EQ(share_of({{"method", "thermal_only"}}), -1) << "it shows all temperatures alike";
}

TEST_F(ViewerSessionTest, SendsGeometryOnceAndColoursAfterEachChange) {
  serve(sheet(120));
  Viewer viewer(server_->port());
  const auto first = viewer.subscribe_and_complete();
  ASSERT_EQ(first["tiles"], viewer.colours().size());
  const auto geometry_frames = viewer.geometry_frames();
  EXPECT_GT(geometry_frames, 0U);

  const auto set = viewer.call("fusion.set", {{"method", "thermal_only"}, {"palette", "turbo"}});
  const auto generation = set["result"]["generation"];
  const auto complete = viewer.wait_for("stream.complete");
  ASSERT_TRUE(complete);
  EXPECT_EQ((*complete)["generation"], generation);
  EXPECT_EQ(viewer.newest_generation(), generation);
  EXPECT_EQ(viewer.geometry_frames(), geometry_frames);
}

TEST_F(ViewerSessionTest, AStreamThatIsAskedForBehindChangesBeginsInTheirColours) {
  serve(sheet(120));
  Viewer viewer(server_->port());
  ASSERT_TRUE(viewer.wait_for("hello"));
  std::promise<void> go;
  hold_pool(go);
  const int first = viewer.request("fusion.set", {{"method", "thermal_only"}});
  const int second = viewer.request("fusion.set", {{"palette", "turbo"}});
  const int begun = viewer.request("scene.subscribe", {{"channels", {"fused"}}});
  const int ended = viewer.request("scene.unsubscribe");
  const int begun_again = viewer.request("scene.subscribe", {{"channels", {"fused"}}});
  EXPECT_TRUE(viewer.call("scene.get").contains("result")) << "what has nothing to do with it does not wait";
  go.set_value();
  std::vector<int> answered;
  json generation;
  for (auto message = viewer.receive(); message; message = viewer.receive()) {
    if (message->contains("id")) answered.push_back((*message)["id"]);
    if (message->contains("id") && (*message)["id"] == second) generation = (*message)["result"]["generation"];
    if (message->value("method", "") == "stream.complete") break;
  }
  EXPECT_EQ(answered, (std::vector<int>{first, second, begun, ended, begun_again}));
  EXPECT_EQ(viewer.oldest_generation(), generation);
}

TEST_F(ViewerSessionTest, FewRequestsForAStreamWaitBehindAChange) {
  serve(sheet(20));
  Viewer viewer(server_->port());
  ASSERT_TRUE(viewer.wait_for("hello"));
  std::promise<void> go;
  hold_pool(go);
  const int change = viewer.request("fusion.set", {{"method", "thermal_only"}});
  int last = 0;
  for (int i = 0; i < 5; ++i) last = viewer.request("scene.unsubscribe");
  EXPECT_EQ(viewer.response(last)["error"]["code"], -32003);
  go.set_value();
  EXPECT_TRUE(viewer.response(change).contains("result"));
  EXPECT_TRUE(viewer.response(last - 1).contains("result"));
  EXPECT_TRUE(viewer.subscribe_and_complete().contains("generation"));
}

TEST_F(ViewerSessionTest, GivesEachViewerItsOwnSettings) {
  serve(sheet(80));
  Viewer one(server_->port());
  Viewer two(server_->port());
  one.subscribe_and_complete();
  two.subscribe_and_complete();
  const auto before = two.colours();
  EXPECT_EQ(one.colours(), before);
  ASSERT_TRUE(one.call("fusion.set", {{"method", "thermal_only"}}).contains("result"));
  ASSERT_TRUE(one.wait_for("stream.complete"));
  EXPECT_NE(one.colours(), before);
  EXPECT_EQ(two.call("fusion.get")["result"]["fusion"]["method"], "histogram_distribution");
  EXPECT_EQ(two.colours(), before);
}

TEST_F(ViewerSessionTest, AnswersEveryChangeInOrderWhileTheyCoalesce) {
  serve(sheet(120));
  Viewer viewer(server_->port());
  viewer.subscribe_and_complete();
  std::vector<int> ids;
  for (int i = 0; i <= 100; ++i) ids.push_back(viewer.request("fusion.set", {{"params", {{"alpha", i / 100.0}}}}));
  std::int64_t last_generation = 0;
  for (const int id : ids) {
    const auto response = viewer.response(id);
    ASSERT_TRUE(response.contains("result")) << response;
    EXPECT_GE(response["result"]["generation"], last_generation);
    last_generation = response["result"]["generation"];
    EXPECT_EQ(response["result"]["fusion"]["params"]["alpha"], (id - ids.front()) / 100.0);
  }
  EXPECT_EQ(viewer.call("fusion.get")["result"]["fusion"]["params"]["alpha"], 1);
  EXPECT_EQ(viewer.call("fusion.get")["result"]["generation"], last_generation);
}

TEST_F(ViewerSessionTest, ARefusedChangeAmongOthersChangesNothing) {
  serve(sheet(40));
  Viewer viewer(server_->port());
  ASSERT_TRUE(viewer.wait_for("hello"));
  const int good = viewer.request("fusion.set", {{"params", {{"alpha", 0.25}}}});
  const int bad = viewer.request("fusion.set", {{"method", "thermal_only"}, {"palette", "no_such"}});
  const int last = viewer.request("fusion.set", {{"palette", "turbo"}});
  EXPECT_TRUE(viewer.response(good).contains("result"));
  EXPECT_EQ(viewer.response(bad)["error"]["data"]["field"], "palette");
  const auto fusion = viewer.response(last)["result"]["fusion"];
  EXPECT_EQ(fusion["method"], "histogram_distribution");
  EXPECT_EQ(fusion["params"]["alpha"], 0.25);
  EXPECT_EQ(fusion["palette"], "turbo");
}

TEST_F(ViewerSessionTest, NamesTheFieldThatIsWrong) {
  serve(sheet(40));
  Viewer viewer(server_->port());
  ASSERT_TRUE(viewer.wait_for("hello"));
  struct Case {
    const char* method;
    json params;
    const char* field;
  };
  const std::vector<Case> cases{
      {"fusion.set", {{"method", "no_such"}}, "method"},
      {"fusion.set", {{"method", 7}}, "method"},
      {"fusion.set", {{"params", {{"alpha", 2}}}}, "params.alpha"},
      {"fusion.set", {{"params", {{"alpha", "much"}}}}, "params.alpha"},
      {"fusion.set", {{"params", {{"gamma", 1}}}}, "params.gamma"},
      {"fusion.set", {{"palette", "no_such"}}, "palette"},
      {"fusion.set", {{"range", {{"mode", "manual"}, {"min", 3}, {"max", 1}}}}, "range"},
      {"fusion.set", {{"range", {{"mode", "percentile"}, {"low", 60}, {"high", 40}}}}, "range.low"},
      {"fusion.set", {{"range", {{"mode", "percentile"}, {"high", 101}}}}, "range.high"},
      {"fusion.set", {{"range", {{"mode", "percentile"}, {"low", "few"}}}}, "range.low"},
      {"fusion.set", {{"missing", "red"}}, "missing"},
      {"scene.subscribe", {{"channels", {"infrared"}}}, "channels"},
      {"quality.set", {{"position_step_mm", 1e300}}, "position_step_mm"},
      {"quality.set", {{"position_step_mm", 1'000'001}}, "position_step_mm"},
      {"scene.histogram", {{"bins", 0}}, "bins"},
      {"scene.histogram", json::object(), "bins"},
      {"scene.probe", {{"position", {1, 2}}}, "position"},
      {"quality.set", {{"colour_bits", 3}}, "colour_bits"},
      {"camera.set", {{"eye", {0, 0, 0}}}, "target"},
      {"stream.ack", {{"sequence", -1}}, "sequence"},
  };
  for (const auto& [method, params, field] : cases) {
    const auto response = viewer.call(method, params);
    EXPECT_EQ(response["error"]["code"], -32602) << method << ' ' << params << ' ' << response;
    EXPECT_TRUE(response["error"]["data"]["field"].get<std::string>().starts_with(field)) << response;
    EXPECT_FALSE(response["error"]["data"]["reason"].get<std::string>().empty());
  }
  EXPECT_EQ(viewer.call("fusion.get")["result"]["fusion"]["params"]["alpha"], 1);
}

TEST_F(ViewerSessionTest, RefusesBadMessagesAndLivesOn) {
  serve(sheet(40));
  Viewer viewer(server_->port());
  ASSERT_TRUE(viewer.wait_for("hello"));
  const auto code_of = [&viewer](const std::string& text) -> json {
    viewer.socket().send_text(text);
    const auto answer = viewer.receive();
    return answer ? (*answer)["error"]["code"] : json{};
  };
  EXPECT_EQ(code_of("this is not JSON"), -32700);
  EXPECT_EQ(code_of(""), -32700);
  EXPECT_EQ(code_of(std::string(60'000, '[')), -32700);
  EXPECT_EQ(code_of(R"({"a":)" + std::string(20, '[') + std::string(20, ']') + "}"), -32700);
  EXPECT_EQ(code_of(R"([{"jsonrpc":"2.0","id":1,"method":"fusion.get"}])"), -32600);
  EXPECT_EQ(code_of(R"({"jsonrpc":"1.0","id":1,"method":"fusion.get"})"), -32600);
  EXPECT_EQ(code_of(R"({"jsonrpc":"2.0","id":{},"method":"fusion.get"})"), -32600);
  EXPECT_EQ(code_of(R"({"jsonrpc":"2.0","id":1})"), -32600);
  EXPECT_EQ(code_of(R"({"jsonrpc":"2.0","id":1,"method":"fusion.get","params":[]})"), -32602);
  EXPECT_EQ(code_of(R"({"jsonrpc":"2.0","id":1,"method":"no.such"})"), -32601);
  viewer.socket().send_frame(2, "binary");
  EXPECT_EQ((*viewer.receive())["error"]["code"], -32600);
  EXPECT_TRUE(viewer.call("fusion.get").contains("result"));
}

TEST_F(ViewerSessionTest, BoundsOfMessagesAreSettings) {
  auto options = quick_options();
  options.limits.json_depth = 8;
  options.limits.json_elements = 100;
  start(std::move(options));
  Viewer viewer(server_->port());
  const auto hello = viewer.wait_for("hello");
  ASSERT_TRUE(hello);
  EXPECT_EQ((*hello)["limits"]["max_depth"], 8);
  const auto code_of = [&viewer](const std::string& value) -> json {
    viewer.socket().send_text(R"({"jsonrpc":"2.0","id":1,"method":"no.such","params":{"a":)" + value + "}}");
    const auto answer = viewer.receive();
    return answer ? (*answer)["error"]["code"] : json{};
  };
  const auto nested = [](std::size_t depth) { return std::string(depth, '[') + std::string(depth, ']'); };
  const auto list = [](int count) {
    std::string text = "[0";
    for (int i = 1; i < count; ++i) text += ",0";
    return text + "]";
  };
  EXPECT_EQ(code_of(nested(6)), -32601);
  EXPECT_EQ(code_of(nested(7)), -32700);
  EXPECT_EQ(code_of(list(90)), -32601);
  EXPECT_EQ(code_of(list(100)), -32700);
}

TEST_F(ViewerSessionTest, LimitsTheRateOfRequests) {
  auto options = quick_options();
  options.limits.requests_per_s = 50;
  options.limits.message_burst_s = 1;
  start(std::move(options));
  Viewer viewer(server_->port());
  ASSERT_TRUE(viewer.wait_for("hello"));
  std::vector<int> ids;
  for (int i = 0; i < 200; ++i) ids.push_back(viewer.request("fusion.get"));
  int busy = 0;
  for (const int id : ids) {
    const auto response = viewer.response(id);
    if (response.contains("error")) {
      EXPECT_EQ(response["error"]["code"], -32003);
      ++busy;
    }
  }
  EXPECT_GT(busy, 50);
  EXPECT_LT(busy, 151);
  std::this_thread::sleep_for(milliseconds(100));
  EXPECT_TRUE(viewer.call("fusion.get").contains("result"));
}

TEST_F(ViewerSessionTest, AnswersQuestionsAboutTheScene) {
  serve(sheet(50));
  Viewer viewer(server_->port());
  ASSERT_TRUE(viewer.wait_for("hello"));
  EXPECT_EQ(viewer.call("scene.get")["result"]["vertex_count"], 2500);

  const auto histogram = viewer.call("scene.histogram", {{"bins", 10}})["result"];
  EXPECT_EQ(histogram["edges"].size(), 11U);
  std::uint64_t counted = 0;
  for (const auto& count : histogram["counts"]) counted += count.get<std::uint64_t>();
  EXPECT_EQ(counted, 2450U);

  const auto probe = viewer.call("scene.probe", {{"position", {0.0, 0.5, 0.0}}})["result"];
  EXPECT_EQ(probe["vertex_index"], 25 * 50);
  EXPECT_TRUE(probe["temperature"].is_null()) << "every 50th vertex has none, this is one";
  EXPECT_EQ(probe["fused"], probe["visible"]);

  const auto extremes = viewer.call("scene.extremes")["result"];
  EXPECT_GT(extremes["hottest"]["temperature"], extremes["coldest"]["temperature"]);
  // From afar everything is in view, with the back to it nothing is.
  const json back{
      {"eye", {0, 0, 50}}, {"target", {0, 0, 60}}, {"up", {0, 1, 0}}, {"fov_y_deg", 45}, {"viewport", {900, 600}}};
  json whole = back;
  whole["target"] = {0, 0, 0};
  EXPECT_EQ(viewer.call("scene.extremes", {{"camera", whole}})["result"], extremes);
  EXPECT_TRUE(viewer.call("scene.extremes", {{"camera", back}})["result"]["hottest"].is_null());
  EXPECT_EQ(viewer.call("scene.extremes", {{"window", {0.5, 0, 0.5, 1}}})["error"]["data"]["field"], "window");

  const auto quality = viewer.call("quality.set", {{"colour_bits", 6}, {"position_step_mm", 3}})["result"]["quality"];
  EXPECT_EQ(quality["colour_bits"], 6);
  EXPECT_LE(quality["position_step_mm"], 3);
  EXPECT_GT(quality["position_step_mm"], 2);
}

TEST_F(ViewerSessionTest, WarnsWhenAMethodCannotShowWhatItShould) {
  serve(sheet(40, false));
  Viewer viewer(server_->port());
  EXPECT_EQ((*viewer.wait_for("hello"))["fusion"]["method"], "visible_only");
  viewer.request("fusion.set", {{"method", "thermal_only"}});
  const auto status = viewer.wait_for("status");
  ASSERT_TRUE(status);
  EXPECT_EQ((*status)["id"], "no_temperature");
  EXPECT_TRUE(viewer.call("fusion.get")["result"]["fusion"]["range"]["min"].is_null());
  viewer.request("fusion.set", {{"method", "visible_only"}});
  const auto cleared = viewer.wait_for("status");
  ASSERT_TRUE(cleared);
  EXPECT_TRUE((*cleared)["message"].is_null());

  serve(sheet(40));
  viewer.request("fusion.set", {{"method", "intensity_hue"}, {"palette", "white_hot"}});
  const auto unsafe = viewer.wait_for("status");
  ASSERT_TRUE(unsafe);
  EXPECT_EQ((*unsafe)["id"], "palette_not_fusion_safe");
}

TEST_F(ViewerSessionTest, WhatIsBeyondTheSensorEverywhereIsShownAndNotSaidToBeWithoutTemperatures) {
  auto fire = sheet(40);
  std::ranges::fill(fire.temperature_celsius(), std::numeric_limits<float>::infinity());
  serve(std::move(fire));
  Viewer viewer(server_->port());
  viewer.request("fusion.set", {{"method", "thermal_only"}});
  viewer.request("fusion.set", {{"method", "intensity_hue"}, {"palette", "white_hot"}});
  for (json id; id != "palette_not_fusion_safe";) {
    const auto status = viewer.wait_for("status");
    ASSERT_TRUE(status);
    id = (*status)["id"];
    EXPECT_NE(id, "no_temperature");
  }
}

TEST_F(ViewerSessionTest, TellsWhatWasNoticedInTheSceneAndTakesItBack) {
  files::LoadedScene loaded{sheet(40), {}};
  loaded.mesh.up = base::UpAxis::MinusY;
  loaded.core_bounds = base::Bounds{{0, 0, 0}, {0.5F, 0.5F, 0}};
  loaded.notes.push_back({"stray_points", 2, "2 are astray"});
  loaded.notes.push_back({"may_be_millimetres", 1, "so large", true});
  served_.scenes.replace(std::move(loaded), served_.pool);
  Viewer viewer(server_->port());
  const auto hello = viewer.wait_for("hello");
  ASSERT_TRUE(hello);
  const json& scene = (*hello)["scene"];
  EXPECT_EQ(scene["up"], "-y");
  EXPECT_EQ(scene["core_bounds"]["max"], (json{0.5, 0.5, 0}));
  EXPECT_EQ(scene["notes"], (json{{{"id", "stray_points"}, {"count", 2}, {"message", "2 are astray"}},
                                  {{"id", "may_be_millimetres"}, {"count", 1}, {"message", "so large"}}}));
  EXPECT_EQ(*viewer.wait_for("status"),
            (json{{"id", "scene.stray_points"}, {"level", "info"}, {"message", "2 are astray"}}));
  EXPECT_EQ(*viewer.wait_for("status"),
            (json{{"id", "scene.may_be_millimetres"}, {"level", "warning"}, {"message", "so large"}}));

  serve(sheet(50));
  std::map<std::string, json> cleared;
  for (int i = 0; i < 2; ++i) {
    const auto status = viewer.wait_for("status");
    ASSERT_TRUE(status);
    cleared[(*status)["id"]] = (*status)["message"];
  }
  EXPECT_EQ(cleared,
            (std::map<std::string, json>{{"scene.stray_points", nullptr}, {"scene.may_be_millimetres", nullptr}}));
}

TEST_F(ViewerSessionTest, SendsStatisticsToASubscriber) {
  serve(sheet(40));
  Viewer viewer(server_->port());
  viewer.subscribe_and_complete();
  const auto stats = viewer.wait_for("stream.stats");
  ASSERT_TRUE(stats);
  EXPECT_EQ((*stats)["viewers"], 1);
  EXPECT_EQ((*stats)["accuracy"]["colour_levels"], 256);
}

TEST_F(ViewerSessionTest, LivesThroughAChangeOfScene) {
  serve(sheet(60));
  Viewer viewer(server_->port());
  viewer.subscribe_and_complete();
  for (int i = 0; i < 5; ++i) {
    serve(sheet(static_cast<std::uint32_t>(50 + 10 * i)));
    ASSERT_TRUE(viewer.wait_for("scene.changed"));
    ASSERT_TRUE(viewer.call("fusion.set", {{"params", {{"alpha", 0.1 * i}}}}).contains("result"));
  }
  const auto complete = viewer.wait_for("stream.complete");
  ASSERT_TRUE(complete);
}

TEST_F(ViewerSessionTest, ADisconnectInMidstreamHarmsNobody) {
  serve(sheet(250));
  Viewer stays(server_->port());
  for (int i = 0; i < 20; ++i) {
    Viewer leaves(server_->port());
    leaves.request("scene.subscribe", {{"channels", {"fused"}}});
    leaves.request("fusion.set", {{"params", {{"alpha", 0.03 * i}}}});
    leaves.socket().client().receive_some();
  }
  EXPECT_TRUE(stays.subscribe_and_complete().contains("tiles"));
  EXPECT_TRUE(eventually([this] { return server_->metrics().viewers == 1; }));
}

TEST_F(ViewerSessionTest, ExportsTheSameAsItShows) {
  serve(sheet(40));
  const auto response = get("/api/v1/scene.ply?method=thermal_only&palette=turbo&range=10:40&missing=%23ff00ff");
  EXPECT_EQ(status_of(response), 200);
  const auto body = response.substr(response.find("\r\n\r\n") + 4);
  EXPECT_TRUE(body.starts_with("ply\n"));
  EXPECT_NE(body.find("element vertex 1600\n"), std::string::npos);
  EXPECT_EQ(status_of(get("/api/v1/scene.glb")), 200);
  EXPECT_EQ(status_of(get("/api/v1/scene.drc")), 200);
  for (const auto* target : {"/api/v1/scene.ply?alpha=2", "/api/v1/scene.ply?method=x", "/api/v1/scene.ply?palette=x",
                             "/api/v1/scene.ply?range=2:1", "/api/v1/scene.ply?range=1", "/api/v1/scene.ply?missing=1",
                             "/api/v1/scene.ply?nothing=1"}) {
    EXPECT_EQ(status_of(get(target)), 400) << target;
  }
  for (const auto* target :
       {"/api/v1/scene.obj", "/api/v1/scene.", "/api/v1/", "/api/v1/scene.ply.ply", "/api/v2/scene"}) {
    EXPECT_EQ(status_of(get(target)), 404) << target;
  }
}

TEST_F(ViewerSessionTest, CountsForPrometheus) {
  serve(sheet(40));
  Viewer viewer(server_->port());
  viewer.subscribe_and_complete();
  const auto metrics = get("/metrics");
  EXPECT_EQ(status_of(metrics), 200);
  EXPECT_NE(metrics.find("\nspectra_viewers 1\n"), std::string::npos);
  EXPECT_NE(metrics.find("\nspectra_scene_vertices 1600\n"), std::string::npos);
  EXPECT_NE(metrics.find("\nprocess_open_fds "), std::string::npos);
}

}  // namespace
}  // namespace spectra::tests
