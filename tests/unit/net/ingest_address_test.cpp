#include <gtest/gtest.h>

#include "server/net/ingest_client.hpp"

namespace spectra::net {
namespace {

TEST(IngestAddress, IsReadFromAUrl) {
  const auto text = [](std::string_view url) {
    const auto address = parsed_ingest_address(url);
    if (std::holds_alternative<std::string>(address)) return std::string("refused");
    const auto& [host, port, path, is_encrypted] = std::get<IngestAddress>(address);
    return (is_encrypted ? "encrypted " : "") + host + ' ' + port + ' ' + path;
  };
  EXPECT_EQ(text("http://127.0.0.1:8080"), "127.0.0.1 8080 /ingest");
  EXPECT_EQ(text("http://robot.local"), "robot.local 80 /ingest");
  EXPECT_EQ(text("ws://[::1]:99/"), "::1 99 /ingest");
  EXPECT_EQ(text("http://[::1]"), "::1 80 /ingest");
  EXPECT_EQ(text("https://robot.local"), "encrypted robot.local 443 /ingest");
  EXPECT_EQ(text("wss://robot:8443/"), "encrypted robot 8443 /ingest");
  EXPECT_EQ(text("http://a:1/robot/"), "a 1 /robot/ingest");
  EXPECT_EQ(text("http://a:1/robot/ingest/"), "a 1 /robot/ingest");
  for (const char* url : {"", "a:1", "http://", "http://:1", "http://a:", "http://a:0", "http://a:65536", "http://a:1x",
                          "http://[::1", "http://::1", "http://[::1]x", "http://a b", "http://a/b?c", "http://u@a",
                          "http://a\\b", "https://", "file:///a"}) {
    EXPECT_EQ(text(url), "refused") << url;
  }
}

TEST(IngestAddress, IsWrittenAsInAUrl) {
  EXPECT_EQ((IngestAddress{"::1", "99", ""}.authority()), "[::1]:99");
  EXPECT_EQ((IngestAddress{"a", "1", ""}.authority()), "a:1");
}

}  // namespace
}  // namespace spectra::net
