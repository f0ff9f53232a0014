#include "protocol/jsonrpc.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "protocol/incoming_message.hpp"

namespace spectra::protocol {
namespace {

using nlohmann::json;

std::string repeated(std::string_view text, int count) {
  std::string all;
  for (int i = 0; i < count; ++i) all += text;
  return all;
}

TEST(ParsedJson, GivesTheSameDocumentAsTheLibraryItself) {
  for (const std::string text : {R"({"a":[1,-2,3.5,true,false,null,"x\u00e9\n"],"b":{"c":{}},"d":[[],{}]})", "7",
                                 "\"s\"", "[]", " [ 1 , 18446744073709551615 ] ", R"({"":{"":0}})"}) {
    const auto parsed = parsed_json(text);
    ASSERT_TRUE(parsed.has_value()) << text << ": " << parsed.error().message;
    EXPECT_EQ(parsed.value(), json::parse(text));
  }
}

TEST(ParsedJson, RefusesWhatIsNotJson) {
  for (const std::string text : {"", "{", "[1,]", "{\"a\":1,}", "nul", "1 2", "{a:1}", "'x'", "\"\xff\"", "[1e999]",
                                 "[NaN]", "\"\xc0\xaf\"", "[01]", "\x01"}) {
    const auto parsed = parsed_json(text);
    ASSERT_TRUE(parsed.has_error()) << text;
    EXPECT_EQ(parsed.error().code, RpcErrorCode::ParseError);
    EXPECT_FALSE(parsed.error().message.empty());
  }
}

TEST(ParsedJson, RefusesDuplicateKeysHoweverTheyAreWritten) {
  EXPECT_TRUE(parsed_json(R"({"a":1,"a":2})").has_error());
  EXPECT_TRUE(parsed_json(R"({"a":1,"\u0061":2})").has_error());
  EXPECT_TRUE(parsed_json(R"([{"b":{"a":1,"a":1}}])").has_error());
  EXPECT_TRUE(parsed_json(R"({"a":{"a":1},"b":{"a":1}})").has_value());
}

TEST(ParsedJson, HoldsTheLimitOfDepth) {
  EXPECT_TRUE(parsed_json(repeated("[", 16) + repeated("]", 16)).has_value());
  const auto deep = parsed_json(repeated("[", 17) + repeated("]", 17));
  ASSERT_TRUE(deep.has_error());
  EXPECT_EQ(deep.error().limits, "at most 16 levels");
  EXPECT_TRUE(parsed_json(repeated("{\"a\":", 17) + "1" + repeated("}", 17)).has_error());
  EXPECT_TRUE(parsed_json(repeated("[", 65'536)).has_error());
}

TEST(ParsedJson, HoldsTheLimitOfElements) {
  EXPECT_TRUE(parsed_json("[" + repeated("0,", 9'998) + "0]").has_value());
  const auto many = parsed_json("[" + repeated("0,", 9'999) + "0]");
  ASSERT_TRUE(many.has_error());
  EXPECT_EQ(many.error().limits, "at most 10000 values");
}

TEST(ParsedJson, HoldsTheLimitOfSize) {
  EXPECT_TRUE(parsed_json("\"" + std::string(65'534, 'a') + "\"").has_value());
  EXPECT_TRUE(parsed_json("\"" + std::string(65'535, 'a') + "\"").has_error());
}

IncomingMessage accepted(std::string_view text) {
  auto message = incoming_message(text);
  EXPECT_TRUE(std::holds_alternative<IncomingMessage>(message)) << text;
  return std::holds_alternative<IncomingMessage>(message) ? std::get<IncomingMessage>(std::move(message))
                                                          : IncomingMessage{};
}

RefusedMessage refused(std::string_view text) {
  auto message = incoming_message(text);
  EXPECT_TRUE(std::holds_alternative<RefusedMessage>(message)) << text;
  return std::holds_alternative<RefusedMessage>(message) ? std::get<RefusedMessage>(std::move(message))
                                                         : RefusedMessage{};
}

TEST(IncomingMessage, ReadsRequestsAndNotifications) {
  const IncomingMessage request = accepted(R"({"jsonrpc":"2.0","id":"a7","method":"scene.get","params":{"x":1}})");
  EXPECT_EQ(request.id, RpcId("a7"));
  EXPECT_EQ(request.method, "scene.get");
  EXPECT_EQ(request.params, json({{"x", 1}}));

  const IncomingMessage bare = accepted(R"({"jsonrpc":"2.0","id":-3,"method":"scene.get","later":true})");
  EXPECT_EQ(bare.id, RpcId(std::int64_t{-3}));
  EXPECT_EQ(bare.params, json::object());

  EXPECT_FALSE(accepted(R"({"jsonrpc":"2.0","method":"stream.ack","params":{"sequence":4}})").id.has_value());
}

TEST(IncomingMessage, RefusesWhatIsNoRequest) {
  for (const std::string text :
       {"[]", R"([{"jsonrpc":"2.0","id":1,"method":"scene.get"}])", "7", "null", "{}",
        R"({"id":1,"method":"scene.get"})", R"({"jsonrpc":"1.0","id":1,"method":"scene.get"})",
        R"({"jsonrpc":2.0,"id":1,"method":"scene.get"})", R"({"jsonrpc":"2.0","id":null,"method":"scene.get"})",
        R"({"jsonrpc":"2.0","id":1.5,"method":"scene.get"})", R"({"jsonrpc":"2.0","id":{},"method":"scene.get"})",
        R"({"jsonrpc":"2.0","id":9223372036854775808,"method":"scene.get"})", R"({"jsonrpc":"2.0","id":1})",
        R"({"jsonrpc":"2.0","id":1,"method":7})", R"({"jsonrpc":"2.0","id":1,"result":{}})"})
    EXPECT_EQ(refused(text).error.code, RpcErrorCode::InvalidRequest) << text;
  EXPECT_EQ(refused("{").error.code, RpcErrorCode::ParseError);
  EXPECT_EQ(refused(R"({"jsonrpc":"2.0","id":1,"method":"m","params":[1]})").error.code, RpcErrorCode::InvalidParams);
}

TEST(IncomingMessage, AnswersTheIdWhereverItCouldBeRead) {
  EXPECT_EQ(refused(R"({"jsonrpc":"1.0","id":5,"method":"m"})").id, RpcId(std::int64_t{5}));
  EXPECT_EQ(refused(R"({"jsonrpc":"2.0","id":"x","method":"m","params":3})").id, RpcId("x"));
  EXPECT_FALSE(refused(R"({"jsonrpc":"2.0","id":[],"method":"m"})").id.has_value());
}

TEST(OutgoingTexts, AreTheEnvelopesOfJsonRpc) {
  EXPECT_EQ(json::parse(result_text(RpcId(std::int64_t{4}), json::object())),
            json::parse(R"({"jsonrpc":"2.0","id":4,"result":{}})"));
  EXPECT_EQ(json::parse(notification_text("status", {{"id", "a"}})),
            json::parse(R"({"jsonrpc":"2.0","method":"status","params":{"id":"a"}})"));
  EXPECT_EQ(json::parse(error_text(RpcId("q\"\\"), {RpcErrorCode::InvalidParams, "too large", "params.alpha", "0..1"})),
            json::parse(R"({"jsonrpc":"2.0","id":"q\"\\","error":{"code":-32602,"message":"too large",
                            "data":{"field":"params.alpha","reason":"too large","limits":"0..1"}}})"));
  EXPECT_EQ(json::parse(error_text({}, {RpcErrorCode::ParseError, "no", "", ""})),
            json::parse(R"({"jsonrpc":"2.0","id":null,"error":{"code":-32700,"message":"no",
                            "data":{"field":"","reason":"no"}}})"));
}

TEST(OutgoingTexts, NeverThrowOnContent) {
  const std::string bad = "caf\xe9 \xff\xfe";
  EXPECT_TRUE(json::accept(result_text(RpcId(bad), {{"text", bad}})));
  EXPECT_TRUE(json::accept(error_text(RpcId(bad), {RpcErrorCode::Busy, bad, bad, bad})));
  EXPECT_TRUE(json::accept(notification_text(bad, {{bad, bad}})));
  const json infinite{{"x", std::numeric_limits<double>::infinity()}, {"y", std::nan("")}};
  EXPECT_EQ(json::parse(result_text(RpcId(std::int64_t{1}), infinite)).at("result"),
            json({{"x", nullptr}, {"y", nullptr}}));
}

}  // namespace
}  // namespace spectra::protocol
