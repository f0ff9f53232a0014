#include "server/net/http_server.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "server/net/memory_reserve.hpp"
#include "tests/integration/raw_client.hpp"
#include "tests/integration/test_server.hpp"

namespace spectra::tests {
namespace {

using net::HttpReply;
using net::HttpRequest;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

void answer_path(const HttpRequest& request, const std::function<void(HttpReply)>& reply) {
  reply(net::text_reply(200, request.target.path));
}

std::shared_ptr<net::ViewerClient> no_viewer(const std::shared_ptr<net::ViewerPeer>&) {
  throw std::runtime_error("no viewer is expected here");
}

class HttpServerTest : public testing::Test {
 protected:
  HttpServerTest() {
    web_ = std::filesystem::temp_directory_path() / ("spectra_web_" + std::to_string(getpid()));
    std::filesystem::create_directories(web_ / "assets");
    std::ofstream(web_ / "index.html") << "<!doctype html>client";
    std::ofstream(web_ / "assets/app-1a2b3c.js") << "run()";
    std::ofstream(web_ / "draco.wasm") << "wasm";
    std::ofstream(web_.string() + ".secret") << "secret";
    std::filesystem::create_symlink(web_.string() + ".secret", web_ / "link.txt");
    server_ = std::make_unique<TestServer>(quick_options(), answer_path, no_viewer, web_);
  }
  ~HttpServerTest() override {
    server_.reset();
    std::filesystem::remove_all(web_);
    std::filesystem::remove(web_.string() + ".secret");
  }

  std::string get(const std::string& target, const std::string& host = "localhost",
                  const std::string& method = "GET") const {
    return http_exchange(server_->port(),
                         method + " " + target + " HTTP/1.1\r\nHost: " + host + "\r\nConnection: close\r\n\r\n");
  }

  std::filesystem::path web_;
  std::unique_ptr<TestServer> server_;
};

TEST_F(HttpServerTest, AnswersThroughTheHandler) {
  const auto response = get("/healthz");
  EXPECT_EQ(status_of(response), 200);
  EXPECT_TRUE(response.ends_with("\r\n\r\n/healthz"));
}

TEST_F(HttpServerTest, ServesFilesWithTypeAndSecurityHeaders) {
  const auto index = get("/");
  EXPECT_EQ(status_of(index), 200);
  EXPECT_NE(index.find("Content-Type: text/html"), std::string::npos);
  EXPECT_NE(index.find("Content-Security-Policy: default-src 'none'; script-src 'self' 'wasm-unsafe-eval'"),
            std::string::npos);
  EXPECT_NE(index.find("X-Content-Type-Options: nosniff"), std::string::npos);
  EXPECT_NE(index.find("Cache-Control: no-cache"), std::string::npos);
  EXPECT_TRUE(index.ends_with("client"));
  EXPECT_NE(get("/draco.wasm").find("Content-Type: application/wasm"), std::string::npos);
  EXPECT_NE(get("/assets/app-1a2b3c.js").find("immutable"), std::string::npos);
}

TEST_F(HttpServerTest, AnswersAnUnchangedFileWith304) {
  const auto index = get("/");
  const auto begin = index.find("ETag: ") + 6;
  const auto etag = index.substr(begin, index.find("\r\n", begin) - begin);
  const auto again = http_exchange(
      server_->port(), "GET / HTTP/1.1\r\nHost: localhost\r\nIf-None-Match: " + etag + "\r\nConnection: close\r\n\r\n");
  EXPECT_EQ(status_of(again), 304);
  EXPECT_TRUE(again.ends_with("\r\n\r\n"));
}

TEST_F(HttpServerTest, HeadHasTheHeadersOfGetAndNoBody) {
  const auto response = get("/", "localhost", "HEAD");
  EXPECT_EQ(status_of(response), 200);
  EXPECT_NE(response.find("Content-Length: 21"), std::string::npos);
  EXPECT_TRUE(response.ends_with("\r\n\r\n"));
}

TEST_F(HttpServerTest, ServesAnAssetInTheCodingThatIsAccepted) {
  std::ofstream(web_ / "assets/app-1a2b3c.js.br") << "br()";
  const auto ask = [&](const std::string& method, const std::string& headers) {
    return http_exchange(server_->port(), method + " /assets/app-1a2b3c.js HTTP/1.1\r\nHost: localhost\r\n" + headers +
                                              "Connection: close\r\n\r\n");
  };
  const auto coded = ask("GET", "Accept-Encoding: gzip\r\nAccept-Encoding: br\r\n");
  EXPECT_EQ(status_of(coded), 200);
  EXPECT_TRUE(coded.ends_with("\r\n\r\nbr()"));
  for (const auto* header : {"Content-Encoding: br", "Vary: Accept-Encoding", "Content-Length: 4", "immutable",
                             "Content-Type: text/javascript"}) {
    EXPECT_NE(coded.find(header), std::string::npos) << header;
  }
  const auto plain = ask("GET", "Accept-Encoding: br;q=0\r\n");
  EXPECT_TRUE(plain.ends_with("\r\n\r\nrun()"));
  EXPECT_EQ(plain.find("Content-Encoding"), std::string::npos);
  EXPECT_NE(plain.find("Vary: Accept-Encoding"), std::string::npos);
  const auto tag_of = [](const std::string& reply) {
    const auto begin = reply.find("ETag: ") + 6;
    return reply.substr(begin, reply.find("\r\n", begin) - begin);
  };
  EXPECT_NE(tag_of(coded), tag_of(plain));

  const auto head = ask("HEAD", "Accept-Encoding: br\r\n");
  EXPECT_TRUE(head.ends_with("\r\n\r\n"));
  EXPECT_NE(head.find("Content-Length: 4"), std::string::npos);
  EXPECT_NE(head.find("Content-Encoding: br"), std::string::npos);
  const auto same = ask("GET", "Accept-Encoding: br\r\nIf-None-Match: " + tag_of(coded) + "\r\n");
  EXPECT_EQ(status_of(same), 304);
  EXPECT_NE(same.find("Vary: Accept-Encoding"), std::string::npos);
  EXPECT_EQ(status_of(ask("GET", "If-None-Match: " + tag_of(coded) + "\r\n")), 200) << "a tag of another version";
  EXPECT_EQ(status_of(ask("GET", "Accept-Encoding: identity;q=0, gzip\r\n")), 406);
}

TEST_F(HttpServerTest, RefusesOtherMethods) {
  for (const auto* method : {"POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "CONNECT", "FROBNICATE"}) {
    const auto response = get("/", "localhost", method);
    EXPECT_EQ(status_of(response), 405) << method;
    EXPECT_NE(response.find("Allow: GET, HEAD"), std::string::npos);
  }
}

TEST_F(HttpServerTest, RefusesForeignHosts) {
  for (const auto* host :
       {"evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "192.168.77.1", "0", "2130706433", "[::2]",
        "localhost:", "localhost:x", "local host", "localhost@evil.example"}) {
    EXPECT_EQ(status_of(get("/", host)), 403) << host;
  }
  for (const auto* host : {"localhost", "LOCALHOST:80", "127.0.0.1", "127.0.0.1:1234", "[::1]", "[::1]:99"}) {
    EXPECT_EQ(status_of(get("/", host)), 200) << host;
  }
}

TEST_F(HttpServerTest, WantsExactlyOneHost) {
  EXPECT_EQ(status_of(http_exchange(server_->port(), "GET / HTTP/1.1\r\nConnection: close\r\n\r\n")), 400);
  EXPECT_EQ(status_of(http_exchange(
                server_->port(), "GET / HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\nConnection: close\r\n\r\n")),
            400);
}

TEST_F(HttpServerTest, GivesNothingFromOutsideItsFolder) {
  const std::string secret = web_.filename().string() + ".secret";
  const std::vector<std::string> targets{
      "/../" + secret,
      "/..%2f" + secret,
      "/%2e%2e/" + secret,
      "/%2e%2e%2f" + secret,
      "/.%2e/" + secret,
      "/%2E./" + secret,
      "/..%5c" + secret,
      "/..\\" + secret,
      "/%252e%252e/" + secret,
      "/%252e%252e%252f" + secret,
      "/%c0%ae%c0%ae/" + secret,
      "/%c0%af../" + secret,
      "/..%c0%af" + secret,
      "/%e0%80%ae%e0%80%ae/" + secret,
      "/..%00/" + secret,
      "/index.html%00/../" + secret,
      "/index.html%00",
      "/assets/../../" + secret,
      "/assets/..%2f..%2f" + secret,
      "/assets/%2e%2e/%2e%2e/" + secret,
      "/assets/....//....//" + secret,
      "/assets/..;/..;/" + secret,
      "/./../" + secret,
      "/././" + secret,
      "//../" + secret,
      "///" + secret,
      "//etc/passwd",
      "/../../../../../../etc/passwd",
      "/..%2f..%2f..%2f..%2fetc%2fpasswd",
      "/%2fetc/passwd",
      "/etc/passwd",
      "/proc/self/environ",
      "/link.txt",
      "/assets",
      "/assets/",
      "/assets/.",
      "/?/../" + secret,
      "/%",
      "/%2",
      "/%zz",
      "/%0d%0aSet-Cookie:x=1",
      "/~root/.ssh/id_rsa",
      "/.git/config",
      "file:///etc/passwd",
      "http://localhost/../" + secret,
      "*",
      "/assets/app-1a2b3c.js/",
      "/INDEX.HTML",
  };
  for (const auto& target : targets) {
    const auto response = get(target);
    const auto body = response.substr(std::min(response.size(), response.find("\r\n\r\n")));
    EXPECT_EQ(body.find("secret"), std::string::npos) << target;
    EXPECT_EQ(body.find("root:"), std::string::npos) << target;
    const int status = status_of(response);
    const bool is_index = target.starts_with("/?");
    EXPECT_TRUE(is_index ? status == 200 : status == 400 || status == 404) << target << " gave " << status;
  }
}

TEST_F(HttpServerTest, SaysHowToBuildAMissingClient) {
  TestServer bare(quick_options(), answer_path, no_viewer);
  const auto response = http_exchange(bare.port(), "GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_EQ(status_of(response), 200);
  EXPECT_NE(response.find("npm run build"), std::string::npos);
}

TEST_F(HttpServerTest, ServesARebuiltClientWithoutARestart) {
  ASSERT_TRUE(get("/").ends_with("client"));
  std::ofstream(web_ / "index.html") << "<!doctype html>rebuilt";
  std::filesystem::last_write_time(web_ / "index.html",
                                   std::filesystem::file_time_type::clock::now() + std::chrono::seconds(5));
  EXPECT_TRUE(get("/").ends_with("rebuilt"));
}

TEST_F(HttpServerTest, RefusesABigHeader) {
  const std::string big(9000, 'x');
  const auto response = http_exchange(server_->port(), "GET / HTTP/1.1\r\nHost: localhost\r\nX: " + big + "\r\n\r\n");
  EXPECT_EQ(status_of(response), 431);
}

TEST_F(HttpServerTest, RefusesTransferCodingsThatOthersMayReadOtherwise) {
  const std::string smuggled = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
  for (const std::string coding :
       {"Transfer-Encoding: xchunked", "Transfer-Encoding: chunked, identity", "Transfer-Encoding: identity",
        "Transfer-Encoding: identity\r\nTransfer-Encoding: chunked"}) {
    for (const std::string request : {"GET / HTTP/1.1", "PUT /api/v1/blocks/a HTTP/1.1"}) {
      const auto response =
          http_exchange(server_->port(), request + "\r\nHost: localhost\r\n" + coding + "\r\n\r\n" + smuggled);
      EXPECT_EQ(status_of(response), 400) << request << ' ' << coding;
      EXPECT_EQ(response.find("HTTP/1.1 200"), std::string::npos) << "nothing after it is a request";
    }
  }
}

TEST_F(HttpServerTest, RefusesABigBody) {
  const auto response =
      http_exchange(server_->port(), "GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 2000000\r\n\r\nx");
  EXPECT_EQ(status_of(response), 413);
}

TEST_F(HttpServerTest, AsksForTheBodyOfAGetThatWaitsForIt) {
  RawClient client(server_->port());
  client.send(
      "GET /api/x HTTP/1.1\r\nHost: localhost\r\nExpect: 100-continue\r\nContent-Length: 3\r\nConnection: "
      "close\r\n\r\n");
  EXPECT_EQ(status_of(client.receive_some().value_or("")), 100);
  client.send("abc");
  EXPECT_EQ(status_of(client.receive_all().value_or("")), 200);
}

TEST_F(HttpServerTest, CutsWhoReadsALongAnswerTooSlowly) {
  net::NetOptions options = quick_options();
  options.limits.write_timeout = std::chrono::seconds(20);
  options.limits.download_patience = std::chrono::milliseconds(300);
  options.limits.download_bytes_per_s = 1e8;
  const std::size_t size = std::size_t{64} << 20U;
  const TestServer server(
      std::move(options),
      [body = std::make_shared<const std::string>(size, 'x')](const net::HttpRequest&,
                                                              const std::function<void(net::HttpReply)>& reply) {
        reply({200, "text/plain", body, {}});
      },
      no_viewer);
  RawClient slow(server.port());
  slow.send("GET /api/x HTTP/1.1\r\nHost: localhost\r\n\r\n");
  std::size_t read = 0;
  while (const auto part = slow.receive_some(std::chrono::seconds(5))) {
    read += part->size();
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_GT(read, 0U);
  EXPECT_LT(read, size);
}

TEST_F(HttpServerTest, GivesOneAddressSoManyConnectionsAndSaysSo) {
  net::NetOptions options = quick_options();
  options.limits.header_timeout = std::chrono::seconds(20);
  options.limits.connections_per_address = 3;
  const TestServer server(
      std::move(options),
      [](const net::HttpRequest&, const std::function<void(net::HttpReply)>& reply) {
        reply({200, "text/plain", std::make_shared<const std::string>("ok"), {}});
      },
      no_viewer);
  std::vector<RawClient> idle;
  for (int i = 0; i < 3; ++i) idle.emplace_back(server.port());
  ASSERT_TRUE(eventually([&server] { return server.metrics().connections_open == 3; }));
  RawClient refused(server.port());
  const auto words = refused.receive_all().value_or("");
  EXPECT_EQ(status_of(words), 503);
  EXPECT_NE(words.find("too many connections from your address"), std::string::npos);
  EXPECT_EQ(server.metrics().connections_refused, 1U);
  idle.pop_back();
  ASSERT_TRUE(eventually([&server] { return server.metrics().connections_open == 2; }));
  EXPECT_TRUE(eventually([&server] {
    return status_of(http_exchange(server.port(),
                                   "GET /api/x HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")) == 200;
  }));
}

TEST_F(HttpServerTest, ReadsMoreSlowlyFromWhoAsksTooOften) {
  net::NetOptions options = quick_options();
  options.limits.http_requests_per_s = 100;
  options.limits.message_burst_s = 0.1;
  const TestServer server(std::move(options), answer_path, no_viewer);
  const auto ask_on_two_connections = [&server](int times) {
    RawClient one(server.port()), other(server.port());
    const auto begin = steady_clock::now();
    for (int i = 0; i < times; ++i) {
      EXPECT_TRUE(one.send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"));
      EXPECT_TRUE(other.send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"));
      EXPECT_EQ(status_of(one.receive_some().value_or("")), 200) << "refused is nothing";
      EXPECT_EQ(status_of(other.receive_some().value_or("")), 200);
    }
    return steady_clock::now() - begin;
  };
  ask_on_two_connections(5);
  EXPECT_EQ(server.metrics().requests_delayed, 0U);
  EXPECT_GE(ask_on_two_connections(15), milliseconds(150));
  EXPECT_GE(server.metrics().requests_delayed, 15U);
}

TEST_F(HttpServerTest, AnswersGarbageWith400) {
  EXPECT_EQ(status_of(http_exchange(server_->port(), "\x16\x03\x01\x02\r\n\r\n")), 400);
  EXPECT_EQ(status_of(http_exchange(server_->port(), "GET / HTTP/9.9\r\nHost: localhost\r\n\r\n")), 400);
  EXPECT_EQ(status_of(http_exchange(server_->port(), "GET /\r\n\r\n")), 400);
}

TEST_F(HttpServerTest, KeepsAConnectionForFurtherRequests) {
  RawClient client(server_->port());
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(client.send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"));
    EXPECT_EQ(status_of(client.receive_some().value_or("")), 200);
  }
}

TEST_F(HttpServerTest, ClosesSlowHeadersWhileOthersAreServed) {
  std::vector<RawClient> slow;
  for (int i = 0; i < 200; ++i) {
    slow.emplace_back(server_->port());
    ASSERT_TRUE(slow.back().send("GET / HTTP/1.1\r\nHost: loc"));
  }
  EXPECT_EQ(status_of(get("/")), 200);
  const auto begin = steady_clock::now();
  for (auto& client : slow) EXPECT_TRUE(client.receive_all(milliseconds(5000)).has_value());
  EXPECT_LT(steady_clock::now() - begin, milliseconds(5000));
  EXPECT_TRUE(eventually([this] { return server_->metrics().connections_open == 0; }));
}

TEST_F(HttpServerTest, PicksAFreePortAndSaysWhenOneIsTaken) {
  EXPECT_NE(server_->port(), 0);
  auto options = quick_options();
  options.port = server_->port();
  try {
    net::HttpServer second(options, answer_path, no_viewer, {});
    FAIL() << "two servers on one port";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("in use"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find(std::to_string(options.port)), std::string::npos);
  }
}

TEST_F(HttpServerTest, AnswersADroppedReplyWith503) {
  TestServer silent(
      quick_options(), [](const HttpRequest&, const std::function<void(HttpReply)>&) {}, no_viewer);
  const auto response =
      http_exchange(silent.port(), "GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_EQ(status_of(response), 503);
}

TEST_F(HttpServerTest, StopsWhileAnAnswerIsStillBeingMade) {
  std::atomic<bool> is_asked = false;
  std::function<void(net::HttpReply)> kept;  // before the server, whose handler puts it there
  TestServer server(
      quick_options(),
      [&](const net::HttpRequest&, const std::function<void(net::HttpReply)>& reply) {
        kept = reply;
        is_asked = true;
      },
      no_viewer);
  RawClient waiting(server.port());
  waiting.send("GET /api/v1/scene.ply HTTP/1.1\r\nHost: localhost\r\n\r\n");
  ASSERT_TRUE(eventually([&is_asked] { return is_asked.load(); }));
  const auto begin = std::chrono::steady_clock::now();
  server.stop();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(5));
  kept = nullptr;  // Who drops an answer says so to a server that is there.
}

TEST_F(HttpServerTest, CutsWhoStopsReadingALongAnswer) {
  const auto body = std::make_shared<const std::string>(64U * 1024 * 1024, 'x');
  TestServer big(
      quick_options(),
      [&body](const HttpRequest&, const std::function<void(HttpReply)>& reply) {
        reply({200, "text/plain", body, {}});
      },
      no_viewer);
  RawClient client(big.port());
  client.set_receive_buffer(4096);
  ASSERT_TRUE(client.send("GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n"));
  ASSERT_TRUE(eventually([&big] { return big.metrics().connections_open == 1; }));
  EXPECT_TRUE(eventually([&big] { return big.metrics().connections_open == 0; }));
}

TEST_F(HttpServerTest, FillsTheReserveOfMemoryAgainAlsoWhenNobodyComes) {
  net::keep_memory_reserve();
  const auto run_out = std::get_new_handler();
  const std::size_t whole = net::memory_reserve_bytes();
  EXPECT_GT(whole, 0U);
  const auto take_all = [run_out] {
    for (;;) run_out();
  };
  EXPECT_THROW(take_all(), std::bad_alloc);
  EXPECT_TRUE(eventually([whole] { return net::memory_reserve_bytes() == whole; }));
  std::set_new_handler(nullptr);
}

TEST_F(HttpServerTest, SurvivesRunningOutOfDescriptors) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "UBSan needs a descriptor of its own to check the type of an object";
#endif
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  rlimit low = before;
  low.rlim_cur = 256;
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &low), 0);
  std::vector<int> fillers;
  for (int descriptor = dup(0); descriptor >= 0; descriptor = dup(0)) fillers.push_back(descriptor);
  ASSERT_FALSE(fillers.empty());
  // The client takes the last descriptor, so that none is left to accept it with.
  close(fillers.back());
  fillers.pop_back();
  RawClient client(server_->port());
  EXPECT_TRUE(eventually([this] { return server_->metrics().accept_failures >= 2; }));
  for (const int descriptor : fillers) close(descriptor);
  setrlimit(RLIMIT_NOFILE, &before);
  ASSERT_TRUE(client.send("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"));
  EXPECT_EQ(status_of(client.receive_some().value_or("")), 200);
}

}  // namespace
}  // namespace spectra::tests
