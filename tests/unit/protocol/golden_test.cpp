#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "protocol/codec/draco_codec.hpp"
#include "protocol/incoming_message.hpp"
#include "protocol/messages/frames_messages.hpp"
#include "protocol/messages/fusion_messages.hpp"
#include "protocol/messages/ingest_messages.hpp"
#include "protocol/messages/quality_messages.hpp"
#include "protocol/messages/query_messages.hpp"
#include "protocol/messages/robot_messages.hpp"
#include "protocol/messages/scene_messages.hpp"
#include "protocol/messages/stream_messages.hpp"
#include "protocol/tile_frame.hpp"

/// The examples of protocol/golden are what docs/protocol.md shows; the web client's tests read the same files.
/// SPECTRA_UPDATE_GOLDEN=1 in the environment rewrites the frames (the messages are edited by hand).
namespace spectra::protocol {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const fs::path kGolden = fs::path(SPECTRA_PROTOCOL_DIR) / "golden";

std::string content(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  EXPECT_TRUE(in) << file;
  return {std::istreambuf_iterator<char>(in), {}};
}

/// JSON -> struct -> JSON.
using Passage = std::function<Result<json>(const json&)>;

template <class Message>
Passage through() {
  return [](const json& value) -> Result<json> {
    BOOST_OUTCOME_TRY(const Message message, from_json<Message>(value));
    return to_json(message);
  };
}

Result<json> unchanged(const json& value) {
  return value;
}

struct MethodPassages {
  Passage params = unchanged;
  Passage result = unchanged;
};

const std::map<std::string, MethodPassages> kMethods{
    {"scene.get", {unchanged, through<SceneDescription>()}},
    {"scene.subscribe", {through<SubscribeRequest>(), through<SubscribeReply>()}},
    {"scene.unsubscribe", {unchanged, unchanged}},
    {"fusion.set", {through<FusionChange>(), through<FusionReply>()}},
    {"fusion.get", {unchanged, through<FusionReply>()}},
    {"fusion.facts", {through<FactsRequest>(), through<FactsReply>()}},
    {"quality.set", {through<QualityChange>(), through<QualityReply>()}},
    {"scene.histogram", {through<HistogramRequest>(), through<HistogramReply>()}},
    {"scene.probe", {through<ProbeRequest>(), through<ProbeReply>()}},
    {"scene.baseline", {through<BaselineRequest>(), through<BaselineReply>()}},
    {"scene.extremes", {through<ExtremesRequest>(), through<ExtremesReply>()}},
    {"camera.set", {through<CameraSet>(), unchanged}},
    {"stream.ack", {through<StreamAck>(), unchanged}},
    {"hello", {through<Hello>(), unchanged}},
    {"scene.changed", {through<SceneChanged>(), unchanged}},
    {"fusion.changed", {through<FusionReply>(), unchanged}},
    {"stream.complete", {through<StreamComplete>(), unchanged}},
    {"stream.stats", {through<StreamStats>(), unchanged}},
    {"robot.moved", {through<RobotMoved>(), unchanged}},
    {"status", {through<Status>(), unchanged}},
    {"frames.hello", {through<FramesHello>(), unchanged}},
    {"frames.taken", {through<FramesTaken>(), unchanged}},
    {"frames.refused", {through<FramesRefused>(), unchanged}},
    {"ingest.hello", {through<IngestHello>(), unchanged}},
    {"ingest.acknowledged", {through<IngestAcknowledged>(), unchanged}},
    {"ingest.refused", {through<IngestRefused>(), unchanged}},
};

/// The method that a file is an example of: the longest known name that its name starts with.
std::string method_of(const std::string& file_name) {
  std::string best;
  for (const auto& [method, passages] : kMethods)
    if (file_name.starts_with(method + ".") && method.size() > best.size()) best = method;
  return best;
}

RpcId id_in(const json& message) {
  const json& id = message.at("id");
  return id.is_string() ? RpcId(id.get<std::string>()) : RpcId(id.get<std::int64_t>());
}

TEST(GoldenMessages, SurviveDecodingAndEncoding) {
  std::set<std::string> seen;
  for (const auto& entry : fs::directory_iterator(kGolden / "messages")) {
    const std::string name = entry.path().filename().string();
    SCOPED_TRACE(name);
    const std::string text = content(entry.path());
    const json message = json::parse(text);
    std::string again;
    if (name.starts_with("error.")) {
      const json& error = message.at("error");
      const json& data = error.at("data");
      const RpcError refused{static_cast<RpcErrorCode>(error.at("code").get<int>()), error.at("message"),
                             data.at("field"), data.value("limits", "")};
      again = error_text(message.at("id").is_null() ? std::nullopt : std::optional(id_in(message)), refused);
    } else {
      const std::string method = method_of(name);
      ASSERT_FALSE(method.empty());
      seen.insert(method);
      const MethodPassages& passages = kMethods.at(method);
      if (name.ends_with(".result.json")) {
        const Result<json> result = passages.result(message.at("result"));
        ASSERT_TRUE(result.has_value()) << result.error().message;
        again = result_text(id_in(message), result.value());
      } else {
        const auto incoming = incoming_message(text, {.max_size_bytes = 1 << 20});
        ASSERT_TRUE(std::holds_alternative<IncomingMessage>(incoming));
        const auto& read = std::get<IncomingMessage>(incoming);
        EXPECT_EQ(read.method, method);
        EXPECT_EQ(read.id.has_value(), name.ends_with(".request.json"));
        const Result<json> params = passages.params(read.params);
        ASSERT_TRUE(params.has_value()) << params.error().message;
        again = notification_text(read.method, params.value());
        if (read.id) {
          json request = json::parse(again);
          request["id"] = message.at("id");
          EXPECT_EQ(id_in(message), *read.id);
          again = request.dump();
        }
      }
    }
    EXPECT_EQ(json::parse(again), message);
  }
  for (const auto& [method, passages] : kMethods) EXPECT_TRUE(seen.contains(method)) << "no example of " << method;
}

TEST(GoldenMessages, TheCatalogueOverHttpSurvives) {
  const json catalogue = json::parse(content(kGolden / "http" / "catalogue.json"));
  const Result<json> again = through<Catalogue>()(catalogue);
  ASSERT_TRUE(again.has_value()) << again.error().message;
  EXPECT_EQ(again.value(), catalogue);
}

TEST(GoldenMessages, AHelloHasMethodsAndPalettesOrTellsWhereTheyAre) {
  json hello = json::parse(content(kGolden / "messages" / "hello.brief.notification.json")).at("params");
  EXPECT_TRUE(from_json<Hello>(hello).has_value());
  hello.erase("catalogue");
  const auto refused = from_json<Hello>(hello);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().field, "methods");
}

TEST(GoldenMessages, CoverEveryMethodOfTheSchema) {
  const json methods = json::parse(content(fs::path(SPECTRA_PROTOCOL_DIR) / "schema" / "methods.json"));
  std::set<std::string> named;
  for (const auto& [group, entries] : methods.items())
    for (const auto& [method, types] : entries.items()) {
      named.insert(method);
      EXPECT_TRUE(kMethods.contains(method)) << method;
      for (const auto& [part, reference] : types.items()) {
        if (part == "description") continue;
        const auto text = reference.get<std::string>();
        const std::size_t hash = text.find('#');
        const json schema = json::parse(content(fs::path(SPECTRA_PROTOCOL_DIR) / "schema" / text.substr(0, hash)));
        EXPECT_TRUE(schema.contains(json::json_pointer(text.substr(hash + 1)))) << text;
      }
    }
  for (const auto& [method, passages] : kMethods) EXPECT_TRUE(named.contains(method)) << method;
}

TEST(ProtocolDocument, ShowsTheGoldenExamplesAndEveryMethod) {
  const std::string document = content(fs::path(SPECTRA_PROTOCOL_DIR).parent_path() / "docs" / "protocol.md");
  const std::string marker = "`protocol/golden/messages/";
  const std::string fence = "```json\n";
  int example_count = 0;
  for (std::size_t at = document.find(marker); at != std::string::npos; at = document.find(marker, at)) {
    at += marker.size();
    const std::string name = document.substr(at, document.find('`', at) - at);
    SCOPED_TRACE(name);
    const std::size_t after = at + name.size();
    if (document.compare(after, fence.size() + 3, "`:\n" + fence) != 0) {
      EXPECT_TRUE(fs::exists(kGolden / "messages" / name));
      continue;
    }
    const std::size_t begin = after + 3 + fence.size();
    const std::string block = document.substr(begin, document.find("```", begin) - begin);
    EXPECT_EQ(block, content(kGolden / "messages" / name));
    ++example_count;
  }
  EXPECT_GE(example_count, 15);
  for (const auto& [method, passages] : kMethods)
    EXPECT_NE(document.find("### `" + method + "`"), std::string::npos) << method;
}

json number_or_null(float value) {
  return std::isnan(value) ? json(nullptr) : json(value);
}

json header_json(const TileFrameHeader& header) {
  return {{"kind", static_cast<int>(header.kind)},
          {"child_mask", header.child_mask},
          {"sequence", header.sequence},
          {"generation", header.generation},
          {"tile", {header.tile.level, header.tile.x, header.tile.y, header.tile.z}},
          {"revision", header.revision},
          {"vertex_count", header.vertex_count},
          {"origin_m", header.origin_m},
          {"position_step_m", header.position_step_m},
          {"geometric_error_m", header.geometric_error_m},
          {"lowest_celsius", number_or_null(header.lowest_celsius)},
          {"highest_celsius", number_or_null(header.highest_celsius)},
          {"payload_size_bytes", header.payload_size_bytes},
          {"colour_error_levels", number_or_null(header.colour_error_levels)},
          {"temperature_error_celsius", number_or_null(header.temperature_error_celsius)}};
}

/// What a frame says, decoded: the .json beside a .bin.
json frame_json(const TileFrameView& frame) {
  json described{{"header", header_json(frame.header)}};
  if (frame.header.kind == FrameKind::Geometry) {
    const auto geometry = codec::decoded_geometry(frame.payload);
    if (!geometry) return geometry.error().message;
    described["positions_m"] = geometry.value().positions_m;
    described["triangles"] = geometry.value().triangles;
  } else if (frame.header.kind == FrameKind::Colours || frame.header.kind == FrameKind::ColoursSubtractGreen) {
    const auto colours =
        codec::decoded_colours(frame.payload, frame.header.kind == FrameKind::Colours ? ColourTransform::None
                                                                                      : ColourTransform::SubtractGreen);
    if (!colours) return colours.error().message;
    described["colours"] = colours.value();
    const auto marks = codec::decoded_marks(frame.payload).value();
    if (!marks.empty()) described["marks"] = marks;
  } else if (frame.header.kind == FrameKind::Visible || frame.header.kind == FrameKind::VisibleSubtractGreen) {
    const auto transform =
        frame.header.kind == FrameKind::Visible ? ColourTransform::None : ColourTransform::SubtractGreen;
    const auto visible = codec::decoded_colours(frame.payload, transform);
    if (!visible) return visible.error().message;
    described["visible"] = visible.value();
  } else if (frame.header.kind == FrameKind::Temperature) {
    const auto temperature = codec::decoded_temperature_codes(frame.payload);
    if (!temperature) return temperature.error().message;
    described["scale"] = temperature.value().table.scale;
    described["offset"] = temperature.value().table.offset;
    described["codes"] = temperature.value().codes;
  }
  return described;
}

std::vector<std::byte> frame_bytes(TileFrameHeader header, const std::vector<std::byte>& payload) {
  header.payload_size_bytes = static_cast<std::uint32_t>(payload.size());
  const auto head = encoded_header(header);
  std::vector<std::byte> bytes(head.size() + payload.size());
  std::copy(payload.begin(), payload.end(), std::copy(head.begin(), head.end(), bytes.begin()));
  return bytes;
}

/// The frames as they are made: a bent square of two tiles' width, its colours, a cloud, a tile that leaves.
std::map<std::string, std::vector<std::byte>> made_frames() {
  std::vector<codec::LatticePoint> positions;
  std::vector<codec::TileTriangle> triangles;
  std::vector<codec::ColourBytes> colours;
  for (std::uint32_t y = 0; y < 4; ++y)
    for (std::uint32_t x = 0; x < 4; ++x) {
      positions.push_back({static_cast<std::int32_t>(100 * x), static_cast<std::int32_t>(90 * y),
                           static_cast<std::int32_t>(7 * x * y)});
      colours.push_back({static_cast<std::uint8_t>(60 * x), static_cast<std::uint8_t>(70 * y), 200});
      if (x > 0 && y > 0) {
        const std::uint32_t corner = 4 * y + x;
        triangles.push_back({corner - 5, corner - 4, corner});
        triangles.push_back({corner - 5, corner, corner - 1});
      }
    }
  TileFrameHeader header;
  header.kind = FrameKind::Geometry;
  header.sequence = 1;
  header.tile = {2, 1, 3, 0};
  header.revision = 3;
  header.origin_m = {-4.5F, 2.25F, 0};
  header.position_step_m = 0.001953125F;
  header.lowest_celsius = 4.25F;
  header.highest_celsius = 36.5F;
  const codec::EncodedGeometry mesh = codec::encoded_geometry(positions, triangles, header.position_step_m, 7).value();
  header.vertex_count = static_cast<std::uint32_t>(mesh.input_of_decoded.size());

  std::map<std::string, std::vector<std::byte>> frames;
  frames["geometry"] = frame_bytes(header, mesh.payload);

  std::vector<codec::ColourBytes> decoded_order;
  for (const std::uint32_t input : mesh.input_of_decoded) decoded_order.push_back(colours[input]);
  header.kind = FrameKind::Colours;
  header.sequence = 2;
  header.generation = 9;
  frames["colours"] = frame_bytes(header, codec::encoded_colours(decoded_order, 8, 7).value());
  header.sequence = 3;
  header.generation = 10;
  frames["colours_6_bits"] = frame_bytes(header, codec::encoded_colours(decoded_order, 6, 7).value());

  header.kind = FrameKind::ColoursSubtractGreen;
  frames["colours_subtract_green_6_bits"] =
      frame_bytes(header, codec::encoded_colours(decoded_order, 6, 7, ColourTransform::SubtractGreen).value());
  header.generation = 9;
  frames["colours_subtract_green"] =
      frame_bytes(header, codec::encoded_colours(decoded_order, 8, 7, ColourTransform::SubtractGreen).value());

  std::vector<std::uint8_t> marks;
  for (const std::uint32_t input : mesh.input_of_decoded) marks.push_back(input % 4 == 3 ? 1 : 0);
  frames["colours_subtract_green_marks"] =
      frame_bytes(header, codec::encoded_colours(decoded_order, 8, 7, ColourTransform::SubtractGreen, marks).value());
  header.kind = FrameKind::Colours;
  frames["colours_marks"] =
      frame_bytes(header, codec::encoded_colours(decoded_order, 8, 7, ColourTransform::None, marks).value());

  header.generation = 0;
  header.kind = FrameKind::Visible;
  frames["visible"] = frame_bytes(header, codec::encoded_colours(decoded_order, 8, 7).value());
  header.kind = FrameKind::VisibleSubtractGreen;
  frames["visible_subtract_green"] =
      frame_bytes(header, codec::encoded_colours(decoded_order, 8, 7, ColourTransform::SubtractGreen).value());
  std::vector<std::uint16_t> codes;
  for (const std::uint32_t input : mesh.input_of_decoded) {
    codes.push_back(static_cast<std::uint16_t>(input < 13 ? 215 * input : 65520 + input));
  }
  header.kind = FrameKind::Temperature;
  frames["temperature"] = frame_bytes(header, codec::encoded_temperature_codes(codes, {0.0125F, 4.25F}, 7).value());

  header.kind = FrameKind::Remove;
  header.sequence = 4;
  header.generation = 0;
  header.vertex_count = 0;
  frames["remove"] = frame_bytes(header, {});

  header.kind = FrameKind::Geometry;
  header.child_mask = 0x81;
  header.sequence = 5;
  header.tile = {0, 0, 0, 0};
  header.geometric_error_m = 0.125F;
  header.colour_error_levels = 3.5F;
  header.temperature_error_celsius = std::numeric_limits<float>::quiet_NaN();
  header.lowest_celsius = header.highest_celsius = std::numeric_limits<float>::quiet_NaN();
  const codec::EncodedGeometry cloud = codec::encoded_geometry(positions, {}, header.position_step_m, 7).value();
  header.vertex_count = static_cast<std::uint32_t>(cloud.input_of_decoded.size());
  frames["points"] = frame_bytes(header, cloud.payload);
  return frames;
}

TEST(GoldenFrames, DecodeToTheirDescriptionAndBack) {
  const bool update = std::getenv("SPECTRA_UPDATE_GOLDEN") != nullptr;
  for (const auto& [name, made] : made_frames()) {
    SCOPED_TRACE(name);
    const fs::path binary = kGolden / "frames" / (name + ".bin");
    const fs::path description = kGolden / "frames" / (name + ".json");
    if (update) {
      std::ofstream(binary, std::ios::binary)
          .write(reinterpret_cast<const char*>(made.data()), static_cast<std::streamsize>(made.size()));
      std::ofstream(description) << frame_json(decoded_frame(made).value()).dump() << "\n";
    }
    const std::string bytes = content(binary);
    const auto frame = decoded_frame(std::as_bytes(std::span(bytes)));
    ASSERT_TRUE(frame.has_value()) << frame.error().message;
    EXPECT_EQ(frame_json(frame.value()), json::parse(content(description)));
    const auto header = encoded_header(frame.value().header);
    EXPECT_TRUE(std::equal(header.begin(), header.end(), std::as_bytes(std::span(bytes)).begin()));
    // Another release of Draco may pack the payload otherwise; what it says must stay.
    EXPECT_EQ(frame_json(decoded_frame(made).value()).at("header").at("vertex_count"),
              frame_json(frame.value()).at("header").at("vertex_count"));
  }
}

}  // namespace
}  // namespace spectra::protocol
