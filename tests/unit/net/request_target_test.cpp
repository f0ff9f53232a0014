#include "server/net/request_target.hpp"

#include <gtest/gtest.h>

namespace spectra::net {
namespace {

using Query = std::vector<std::pair<std::string, std::string>>;

TEST(RequestTarget, IsDecodedOnce) {
  const auto target = parsed_target("/a%20b/c%2525?x=1&y=a+b%2B&z&=v&&x=2");
  ASSERT_TRUE(target);
  EXPECT_EQ(target->path, "/a b/c%25");
  EXPECT_EQ(target->query, (Query{{"x", "1"}, {"y", "a b+"}, {"z", ""}, {"", "v"}, {"x", "2"}}));
}

TEST(RequestTarget, KeepsPlainPaths) {
  for (const auto* text : {"/", "/index.html", "/assets/app-1.js", "/a.b/..c/d..", "/.well-known", "/a/"}) {
    const auto target = parsed_target(text);
    ASSERT_TRUE(target) << text;
    EXPECT_EQ(target->path, text);
    EXPECT_TRUE(target->query.empty());
  }
}

TEST(RequestTarget, RefusesWhatLeavesTheRoot) {
  for (const auto* text :
       {"",         "*",      "x",    "http://h/x", "//x",    "/a//b",   "/..",         "/../x", "/a/..",   "/a/../b",
        "/.",       "/./a",   "/a/.", "/%2e%2e/x",  "/%2e/x", "/..%2fx", "/a%2f..%2fb", "/a\\b", "/a%5cb",  "/%00",
        "/a%0d%0a", "/a\x7f", "/%",   "/%1",        "/%g0",   "/a?%",    "/a?x=%0",     "/a#b",  "/a?x=1#b"}) {
    EXPECT_FALSE(parsed_target(text)) << text;
  }
}

TEST(TargetText, IsReadBackAsItWas) {
  const RequestTarget target{"/kitchen",
                             {{"observed_at", "17.5"}, {"sensor", "1,-2,3"}, {"a b&c", "x=y+z%\xc3\xa4#?"}}};
  const std::string text = target_text("kitchen", target.query);
  EXPECT_EQ(text.find("kitchen?observed_at=17.5&sensor=1,-2,3&a%20b%26c=x%3Dy%2Bz%25%C3%A4%23%3F"), 0U) << text;
  const auto back = parsed_target('/' + text);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->path, target.path);
  EXPECT_EQ(back->query, target.query);
  EXPECT_EQ(target_text("a", {}), "a");
}

}  // namespace
}  // namespace spectra::net
