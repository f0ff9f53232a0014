#include "server/session/catalogue.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "fusion/registry.hpp"
#include "server/session/conversions.hpp"

namespace spectra::session {
namespace {

using nlohmann::json;

/// The params of a text as they go over the wire.
json params_of(const net::OutgoingText& text) {
  const std::string whole = text.begin + std::string(text.shared) + text.end;
  EXPECT_EQ(whole.size(), text.size_bytes());
  const json message = json::parse(whole);
  EXPECT_EQ(message["method"], "hello");
  EXPECT_EQ(message["jsonrpc"], "2.0");
  return message["params"];
}

std::string header(const net::HttpReply& reply, const std::string& name) {
  for (const auto& [key, value] : reply.headers) {
    if (key == name) return value;
  }
  return {};
}

net::HttpReply asked(const Catalogue& catalogue, const std::string& path, const std::string& accept_encoding = {},
                     const std::string& if_none_match = {}) {
  return catalogue.reply({{path, {}}, if_none_match, accept_encoding});
}

TEST(Catalogue, IsInAFullHelloAndNamedInABriefOne) {
  const Catalogue catalogue;
  protocol::Hello hello;
  hello.session_id = "s";
  const json brief = params_of(catalogue.hello_text(hello, net::HelloForm::Brief));
  EXPECT_EQ(brief["catalogue"], catalogue.path());
  EXPECT_FALSE(brief.contains("methods"));

  const json full = params_of(catalogue.hello_text(hello, net::HelloForm::Full));
  hello.methods = method_messages();
  hello.palettes = palette_messages();
  EXPECT_EQ(full, protocol::to_json(hello)) << "the same as one that was made as a whole";
  EXPECT_EQ(full["methods"].size(), fusion::all_methods().size());
}

TEST(Catalogue, IsOneTextForAll) {
  const Catalogue catalogue;
  const auto first = catalogue.hello_text({}, net::HelloForm::Full);
  const auto second = catalogue.hello_text({}, net::HelloForm::Full);
  EXPECT_EQ(first.shared.data(), second.shared.data());
  EXPECT_GT(first.shared.size(), 50 * (first.begin.size() + first.end.size()));
  EXPECT_EQ(catalogue.path(), Catalogue().path()) << "its name is that of its content";
}

TEST(Catalogue, IsKeptForEverUnderItsOwnName) {
  const Catalogue catalogue;
  const auto newest = asked(catalogue, "/api/v1/catalogue");
  const auto named = asked(catalogue, "/" + catalogue.path());
  EXPECT_EQ(header(newest, "Cache-Control"), "no-cache");
  EXPECT_EQ(header(named, "Cache-Control"), "public, max-age=31536000, immutable");
  EXPECT_EQ(newest.body, named.body);
  EXPECT_EQ(asked(catalogue, "/" + catalogue.path() + "0").status, 404U);
}

TEST(Catalogue, IsCompressedForThoseWhoTakeIt) {
  const Catalogue catalogue;
  const auto plain = asked(catalogue, "/api/v1/catalogue");
  const auto packed = asked(catalogue, "/api/v1/catalogue", "gzip, deflate, br");
  EXPECT_EQ(header(plain, "Content-Encoding"), "");
  EXPECT_EQ(header(packed, "Content-Encoding"), "gzip");
  EXPECT_EQ(header(packed, "Vary"), "Accept-Encoding");
  EXPECT_LT(3 * packed.body->size(), plain.body->size());
  EXPECT_NE(header(plain, "ETag"), header(packed, "ETag"));
  EXPECT_EQ(asked(catalogue, "/api/v1/catalogue", "gzip", header(packed, "ETag")).status, 304U);
  EXPECT_EQ(asked(catalogue, "/api/v1/catalogue", "", header(packed, "ETag")).status, 200U);
}

}  // namespace
}  // namespace spectra::session
