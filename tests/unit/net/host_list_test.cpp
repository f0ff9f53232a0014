#include "server/net/host_list.hpp"

#include <gtest/gtest.h>

namespace spectra::net {
namespace {

TEST(HostName, IsTheHostWithoutItsPort) {
  EXPECT_EQ(host_name("localhost"), "localhost");
  EXPECT_EQ(host_name("Robot.Local:8080"), "robot.local");
  EXPECT_EQ(host_name("10.0.0.7:80"), "10.0.0.7");
  EXPECT_EQ(host_name("[::1]:8080"), "::1");
  EXPECT_EQ(host_name("[0:0:0:0:0:0:0:1]"), "::1");
  EXPECT_EQ(host_name("[::ffff:10.0.0.7]"), "10.0.0.7");
}

TEST(HostName, IsNothingForWhatIsNoHost) {
  for (const auto* text : {"", ":", ":80", "host:", "host:x", "host:123456", "[", "[]", "[::1", "[::1]x",
                           "[::1]:", "::1", "a b", "a/b", "user@host", "host\r\n", "h%6fst", "ho\x80st"}) {
    EXPECT_FALSE(host_name(text)) << text;
  }
}

TEST(OriginHostName, TakesHttpAndHttpsOnly) {
  EXPECT_EQ(origin_host_name("http://localhost:8080"), "localhost");
  EXPECT_EQ(origin_host_name("https://[::1]"), "::1");
  for (const auto* text : {"", "null", "localhost", "ftp://localhost", "http://", "http:///", "http://localhost/x",
                           "http://localhost@evil", "HTTP://", "file:///"}) {
    EXPECT_FALSE(origin_host_name(text)) << text;
  }
}

TEST(HostList, KnowsLoopbackAndWhatWasAdded) {
  HostList hosts;
  EXPECT_TRUE(hosts.allows_host("localhost:1", "127.0.0.1"));
  EXPECT_FALSE(hosts.allows_host("robot.local", "127.0.0.1"));
  EXPECT_TRUE(hosts.add("Robot.Local"));
  EXPECT_TRUE(hosts.allows_host("robot.local:8080", "127.0.0.1"));
  EXPECT_FALSE(hosts.allows_host("robot.local.evil", "127.0.0.1"));
  EXPECT_TRUE(hosts.add("fe80::1:2"));
  EXPECT_TRUE(hosts.allows_host("[fe80::1:2]:80", "127.0.0.1"));
  EXPECT_FALSE(hosts.add("not a host"));
}

TEST(HostList, KnowsTheMachineByItsNames) {
  HostList hosts;
  hosts.add_machine("Rescue-7.lab.example");
  for (const char* host :
       {"rescue-7", "RESCUE-7.local:8080", "rescue-7.lab.example", "Rescue-7.Lab.Example.:80", "rescue-7.local."}) {
    EXPECT_TRUE(hosts.allows_host(host, "127.0.0.1")) << host;
    EXPECT_TRUE(hosts.allows_origin(std::string("http://") + host, "127.0.0.1")) << host;
  }
  for (const char* host :
       {"rescue-8.local", "rescue-7.local.evil", "lab.example", "local", ".local", "rescue-7..", "rescue-7.lab"}) {
    EXPECT_FALSE(hosts.allows_host(host, "127.0.0.1")) << host;
  }
  HostList nameless;
  for (const char* name : {"", ".", ".local", "no name"}) nameless.add_machine(name);
  EXPECT_FALSE(nameless.allows_host(".local", "127.0.0.1"));
  EXPECT_FALSE(nameless.allows_host("no", "127.0.0.1"));
}

TEST(HostList, AllowsTheAddressThatTheConnectionArrivedAt) {
  const HostList hosts;
  EXPECT_TRUE(hosts.allows_host("192.168.1.5:8080", "192.168.1.5"));
  EXPECT_TRUE(hosts.allows_host("192.168.1.5:8080", "::ffff:192.168.1.5"));
  EXPECT_FALSE(hosts.allows_host("192.168.1.5:8080", "192.168.1.6"));
  EXPECT_TRUE(hosts.allows_origin("http://192.168.1.5:3000", "192.168.1.5"));
}

TEST(HostList, JudgesEveryPairOfHostAndOrigin) {
  HostList hosts;
  hosts.add("robot");
  struct Name {
    const char* host;
    const char* origin;
    bool is_ours;
  };
  for (const auto& [host, origin, is_ours] :
       {Name{"robot", "http://robot", true}, Name{"localhost:80", "https://localhost", true},
        Name{"evil", "http://evil", false}, Name{"", "null", false},
        Name{"robot.evil", "http://robot.evil:8080", false}}) {
    EXPECT_EQ(hosts.allows_host(host, "10.0.0.1"), is_ours) << host;
    EXPECT_EQ(hosts.allows_origin(origin, "10.0.0.1"), is_ours) << origin;
  }
}

}  // namespace
}  // namespace spectra::net
