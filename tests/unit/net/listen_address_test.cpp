#include <gtest/gtest.h>

#include "server/net/http_server.hpp"

namespace spectra::net {
namespace {

TEST(ListenAddress, ReadsAddressesWithPorts) {
  const auto v4 = parsed_listen_address("0.0.0.0:8080");
  ASSERT_TRUE(v4);
  EXPECT_EQ(v4->address, "0.0.0.0");
  EXPECT_EQ(v4->port, 8080);
  const auto v6 = parsed_listen_address("[::]:0");
  ASSERT_TRUE(v6);
  EXPECT_EQ(v6->address, "::");
  EXPECT_EQ(v6->port, 0);
  EXPECT_EQ(parsed_listen_address("localhost:1")->address, "127.0.0.1");
}

TEST(ListenAddress, RefusesEverythingElse) {
  for (const auto* text :
       {"", ":", "8080", ":8080", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1", "127.0.0.1:8 ",
        "127.0.0.1:x", "::1:8080", "[127.0.0.1]:80", "[]:80", "robot:80", "1.2.3:80"}) {
    EXPECT_FALSE(parsed_listen_address(text)) << text;
  }
}

}  // namespace
}  // namespace spectra::net
