#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "protocol/incoming_message.hpp"
#include "protocol/messages/fusion_messages.hpp"
#include "protocol/messages/quality_messages.hpp"
#include "protocol/messages/query_messages.hpp"
#include "protocol/messages/scene_messages.hpp"
#include "protocol/messages/stream_messages.hpp"

namespace spectra::protocol {
namespace {

using nlohmann::json;

/// The field that a refusal names, or "accepted".
template <class Message>
std::string refused_field(const std::string& text) {
  const auto read = from_json<Message>(json::parse(text));
  if (read) return "accepted";
  EXPECT_EQ(read.error().code, RpcErrorCode::InvalidParams);
  EXPECT_NE(read.error().message.find(read.error().field), std::string::npos);
  return read.error().field;
}

TEST(CameraSet, NamesTheFieldThatIsWrong) {
  const json good = json::parse(
      R"({"eye":[1,2,3],"target":[0,0,0],"up":[0,0,1],"fov_y_deg":50,"viewport":[800,600],"unknown":{"x":1}})");
  const auto changed = [&good](const char* key, json value) {
    json copy = good;
    copy[key] = std::move(value);
    return copy.dump();
  };
  EXPECT_EQ(refused_field<CameraSet>(good.dump()), "accepted");
  EXPECT_EQ(refused_field<CameraSet>(changed("viewport", {800.0, 600.0})), "accepted");
  EXPECT_EQ(refused_field<CameraSet>(changed("eye", {1, 2})), "eye");
  EXPECT_EQ(refused_field<CameraSet>(changed("eye", {1, "2", 3})), "eye[1]");
  EXPECT_EQ(refused_field<CameraSet>(changed("up", {1e39, 0, 0})), "up");
  EXPECT_EQ(refused_field<CameraSet>(changed("target", nullptr)), "target");
  EXPECT_EQ(refused_field<CameraSet>(changed("fov_y_deg", 180)), "fov_y_deg");
  EXPECT_EQ(refused_field<CameraSet>(changed("fov_y_deg", "50")), "fov_y_deg");
  EXPECT_EQ(refused_field<CameraSet>(changed("viewport", {0, 600})), "viewport");
  EXPECT_EQ(refused_field<CameraSet>(changed("viewport", {800.5, 600})), "viewport[0]");
  EXPECT_EQ(refused_field<CameraSet>(changed("viewport", {1e300, 600})), "viewport[0]");
  json without = good;
  without.erase("up");
  EXPECT_EQ(refused_field<CameraSet>(without.dump()), "up");
  EXPECT_EQ(refused_field<CameraSet>("[]"), "");
}

TEST(StreamAck, TakesWholeNumbersOf32BitsOnly) {
  EXPECT_EQ(from_json<StreamAck>(json::parse(R"({"sequence":4294967295})")).value().sequence, 4294967295U);
  EXPECT_EQ(from_json<StreamAck>(json::parse(R"({"sequence":7.0})")).value().sequence, 7U);
  for (const std::string value : {"-1", "4294967296", "1.5", "18446744073709551615", "1e20", "true", "\"1\"", "null"})
    EXPECT_EQ(refused_field<StreamAck>("{\"sequence\":" + value + "}"), "sequence") << value;
}

TEST(SubscribeRequest, KnowsItsChannels) {
  EXPECT_EQ(refused_field<SubscribeRequest>(R"({"channels":["fused","visible"]})"), "accepted");
  EXPECT_EQ(refused_field<SubscribeRequest>(R"({"channels":[]})"), "channels");
  EXPECT_EQ(refused_field<SubscribeRequest>(R"({"channels":["fused","sound"]})"), "channels[1]");
  EXPECT_EQ(refused_field<SubscribeRequest>(R"({"channels":"fused"})"), "channels");
  EXPECT_EQ(refused_field<SubscribeRequest>(R"({"channels":["fused"],"in_flight_bytes":0})"), "in_flight_bytes");
  EXPECT_EQ(refused_field<SubscribeRequest>(R"({"channels":["fused"],"in_flight_bytes":2147483648})"),
            "in_flight_bytes");
  EXPECT_EQ(refused_field<SubscribeRequest>(R"({"channels":["fused"],"cache_bytes":1})"), "accepted");
  for (const std::string bytes : {"0", "2147483648", "-1", "1.5", "null"})
    EXPECT_EQ(refused_field<SubscribeRequest>(R"({"channels":["fused"],"cache_bytes":)" + bytes + "}"), "cache_bytes");
  EXPECT_EQ(refused_field<SubscribeRequest>(R"({"channels":["fused"],"colour_transform":"subtract_green"})"),
            "accepted");
  for (const std::string transform : {"\"ycocg\"", "\"\"", "6", "null"})
    EXPECT_EQ(refused_field<SubscribeRequest>(R"({"channels":["fused"],"colour_transform":)" + transform + "}"),
              "colour_transform");
}

TEST(SubscribeRequest, ReadsWhatAClientStillHolds) {
  const auto request = [](const std::string& resume) { return R"({"channels":["fused"],"resume":)" + resume + "}"; };
  const auto read = from_json<SubscribeRequest>(
      json::parse(request(R"({"session_id":"7f","tiles":[[0,0,0,0,4294967295],[255,1,2,4294967295,1]]})")));
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read.value().resume->session_id, "7f");
  EXPECT_EQ(read.value().resume->tiles[1], (std::array<std::uint32_t, 5>{255, 1, 2, 4294967295U, 1}));
  const std::map<std::string, std::string> refused{
      {"[]", "resume"},
      {"null", "resume"},
      {R"({"tiles":[]})", "resume.session_id"},
      {R"({"session_id":7,"tiles":[]})", "resume.session_id"},
      {R"({"session_id":""})", "resume.tiles"},
      {R"({"session_id":"","tiles":{}})", "resume.tiles"},
      {R"({"session_id":"","tiles":[[0,0,0,0]]})", "resume.tiles[0]"},
      {R"({"session_id":"","tiles":[[0,0,0,0,1],[0,0,0,0,1,1]]})", "resume.tiles[1]"},
      {R"({"session_id":"","tiles":[[0,0,-1,0,1]]})", "resume.tiles[0][2]"},
      {R"({"session_id":"","tiles":[[0,0,0,0,4294967296]]})", "resume.tiles[0][4]"},
      {R"({"session_id":"","tiles":[[0,0,0,0,1.5]]})", "resume.tiles[0][4]"},
      {R"({"session_id":"","tiles":[[256,0,0,0,1]]})", "resume.tiles"},
      {R"({"session_id":"","tiles":[[0,0,0,0,0]]})", "resume.tiles"}};
  for (const auto& [resume, field] : refused)
    EXPECT_EQ(refused_field<SubscribeRequest>(request(resume)), field) << resume;
}

TEST(SubscribeRequest, OfAsManyTilesAsAreAllowedFitsTheLimitsOfAMessage) {
  const auto request = [](int tile_count) {
    SubscribeRequest message;
    message.channels = {Channel::Fused};
    message.resume.emplace();
    message.resume->session_id = std::string(32, 'f');
    for (int i = 0; i < tile_count; ++i) message.resume->tiles.push_back({21, 2097151, 2097151, 2097151, 4294967295U});
    return message;
  };
  const json most = {{"jsonrpc", "2.0"}, {"id", 1}, {"method", "scene.subscribe"}, {"params", to_json(request(1500))}};
  const auto incoming = incoming_message(most.dump());
  ASSERT_TRUE(std::holds_alternative<IncomingMessage>(incoming));
  EXPECT_TRUE(from_json<SubscribeRequest>(std::get<IncomingMessage>(incoming).params).has_value());
  const auto refused = from_json<SubscribeRequest>(to_json(request(1501)));
  ASSERT_TRUE(refused.has_error());
  EXPECT_EQ(
      refused.error().message,
      "resume.tiles must be a list of at most 1500 tiles [level 0..255, x, y, z, revision from 1], not a list of 1501");
}

TEST(FusionChange, KeepsWhatIsAbsentAbsent) {
  const auto empty = from_json<FusionChange>(json::object());
  ASSERT_TRUE(empty.has_value());
  EXPECT_FALSE(empty.value().method || empty.value().palette || empty.value().range || empty.value().missing);
  EXPECT_TRUE(empty.value().params.empty());
}

TEST(FusionChange, ReadsEveryKindOfParameter) {
  const auto change = from_json<FusionChange>(
      json::parse(R"({"params":{"a":null,"b":0.5,"c":3,"d":true,"e":"both","f":18446744073709551615}})"));
  ASSERT_TRUE(change.has_value());
  const ParameterValues expected{{"a", nullptr},
                                 {"b", 0.5},
                                 {"c", std::int64_t{3}},
                                 {"d", true},
                                 {"e", std::string("both")},
                                 {"f", 18446744073709551615.0}};
  EXPECT_EQ(change.value().params, expected);
}

TEST(FusionChange, NamesTheFieldThatIsWrong) {
  EXPECT_EQ(refused_field<FusionChange>(R"({"method":7})"), "method");
  EXPECT_EQ(refused_field<FusionChange>(R"({"method":null})"), "method");
  EXPECT_EQ(refused_field<FusionChange>(R"({"params":[1]})"), "params");
  EXPECT_EQ(refused_field<FusionChange>(R"({"params":{"alpha":[1]}})"), "params.alpha");
  EXPECT_EQ(refused_field<FusionChange>(R"({"params":{"alpha":{}}})"), "params.alpha");
  EXPECT_EQ(refused_field<FusionChange>(R"({"range":{"mode":"auto"}})"), "accepted");
  EXPECT_EQ(refused_field<FusionChange>(R"({"range":{"mode":"auto","min":null,"max":null}})"), "accepted");
  EXPECT_EQ(refused_field<FusionChange>(R"({"range":{"mode":"manual","min":1,"max":1}})"), "accepted");
  EXPECT_EQ(refused_field<FusionChange>(R"({"range":{"min":1,"max":2}})"), "range.mode");
  EXPECT_EQ(refused_field<FusionChange>(R"({"range":{"mode":"manual","min":1}})"), "range.max");
  EXPECT_EQ(refused_field<FusionChange>(R"({"range":{"mode":"manual","min":null,"max":2}})"), "range.min");
  EXPECT_EQ(refused_field<FusionChange>(R"({"range":{"mode":"manual","min":3,"max":2}})"), "range.max");
  EXPECT_EQ(refused_field<FusionChange>(R"({"range":{"mode":"sometimes"}})"), "range.mode");
  EXPECT_EQ(refused_field<FusionChange>(R"({"missing":"visible"})"), "accepted");
  EXPECT_EQ(refused_field<FusionChange>(R"({"missing":"#00fF7a"})"), "accepted");
  for (const std::string missing : {"", "#", "#12345", "#1234567", "#12345g", "Visible"})
    EXPECT_EQ(refused_field<FusionChange>(json{{"missing", missing}}.dump()), "missing") << missing;
}

TEST(QualityChange, HoldsTheBoundsOfItsKnobs) {
  EXPECT_EQ(refused_field<QualityChange>("{}"), "accepted");
  EXPECT_EQ(refused_field<QualityChange>(R"({"mode":"fast"})"), "mode");
  for (const std::string bits : {"4", "8"})
    EXPECT_EQ(refused_field<QualityChange>("{\"colour_bits\":" + bits + "}"), "accepted");
  for (const std::string bits : {"3", "9", "6.5", "\"8\""})
    EXPECT_EQ(refused_field<QualityChange>("{\"colour_bits\":" + bits + "}"), "colour_bits");
  for (const std::string speed : {"-1", "11"})
    EXPECT_EQ(refused_field<QualityChange>("{\"encoder_speed\":" + speed + "}"), "encoder_speed");
  for (const char* key : {"position_step_mm", "pixel_error", "latency_target_ms"})
    for (const json& value : {json(0), json(-1), json("1"), json(nullptr)})
      EXPECT_EQ(refused_field<QualityChange>(json{{key, value}}.dump()), key);
  EXPECT_EQ(refused_field<QualityChange>(R"({"marks":true})"), "accepted");
  for (const std::string marks : {"1", "\"true\"", "null"})
    EXPECT_EQ(refused_field<QualityChange>("{\"marks\":" + marks + "}"), "marks");
}

TEST(FactsRequest, HoldsTheBoundsOfBins) {
  EXPECT_EQ(refused_field<FactsRequest>("{}"), "accepted");
  EXPECT_EQ(refused_field<FactsRequest>(R"({"bins":4096,"hues":true})"), "accepted");
  EXPECT_EQ(refused_field<FactsRequest>(R"({"bins":0})"), "bins");
  EXPECT_EQ(refused_field<FactsRequest>(R"({"bins":4097})"), "bins");
  EXPECT_EQ(refused_field<FactsRequest>(R"({"hues":1})"), "hues");
}

TEST(SubscribeRequest, HoldsTheBoundsOfRawLayers) {
  const auto with = [](const std::string& more) {
    return refused_field<SubscribeRequest>(R"({"channels":["temperature","visible"])" + more + "}");
  };
  EXPECT_EQ(with(""), "accepted");
  EXPECT_EQ(with(R"(,"temperature_step_celsius":0.05)"), "accepted");
  for (const std::string step : {"0", "-1", "1001", "\"x\""}) {
    EXPECT_EQ(with(",\"temperature_step_celsius\":" + step), "temperature_step_celsius");
  }
  EXPECT_EQ(with(R"(,"resume":{"session_id":"a","tiles":[[0,0,0,0,1]],"raw":[0]})"), "accepted");
  EXPECT_EQ(with(R"(,"resume":{"session_id":"a","tiles":[[0,0,0,0,1]],"raw":[1]})"), "resume.raw");
}

TEST(HistogramRequest, HoldsTheBoundsOfBins) {
  EXPECT_EQ(refused_field<HistogramRequest>(R"({"bins":1})"), "accepted");
  EXPECT_EQ(refused_field<HistogramRequest>(R"({"bins":4096})"), "accepted");
  for (const std::string bins : {"0", "4097", "-5", "2.5", "null"})
    EXPECT_EQ(refused_field<HistogramRequest>("{\"bins\":" + bins + "}"), "bins");
  EXPECT_EQ(refused_field<HistogramRequest>("{}"), "bins");
}

TEST(ToJson, WritesNullForNumbersThatAreNotFinite) {
  ProbeReply reply;
  reply.temperature = std::nan("");
  reply.distance = std::numeric_limits<double>::infinity();
  const json written = to_json(reply);
  EXPECT_TRUE(written.at("temperature").is_null());
  EXPECT_TRUE(written.at("distance").is_null());
  FusionState state;
  state.params["k"] = -std::numeric_limits<double>::infinity();
  EXPECT_TRUE(to_json(state).at("params").at("k").is_null());
}

TEST(ToJson, LeavesOutWhatIsAbsentAndWritesNullWhereItBelongs) {
  ParameterDescription parameter;
  parameter.name = "threshold";
  parameter.kind = ParameterKind::Temperature;
  const json written = to_json(parameter);
  EXPECT_TRUE(written.at("default").is_null());
  for (const char* key : {"min", "max", "exclusive_min", "step", "unit", "options"})
    EXPECT_FALSE(written.contains(key));
  EXPECT_TRUE(to_json(Status{"a", StatusLevel::Info, {}}).at("message").is_null());
  EXPECT_TRUE(to_json(SceneTemperature{}).at("mean").is_null());
}

}  // namespace
}  // namespace spectra::protocol
