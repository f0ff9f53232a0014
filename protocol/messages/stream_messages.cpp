#include "protocol/messages/stream_messages.hpp"

#include <algorithm>

#include "protocol/messages/fields.hpp"

namespace spectra::protocol {

template <>
std::span<const EnumWord<Channel>> words_of() {
  static constexpr EnumWord<Channel> kWords[] = {
      {Channel::Fused, "fused"}, {Channel::Temperature, "temperature"}, {Channel::Visible, "visible"}};
  return kWords;
}

template <>
std::span<const EnumWord<StatusLevel>> words_of() {
  static constexpr EnumWord<StatusLevel> kWords[] = {
      {StatusLevel::Info, "info"}, {StatusLevel::Warning, "warning"}, {StatusLevel::Error, "error"}};
  return kWords;
}

template <>
std::span<const EnumWord<ColourTransform>> words_of() {
  static constexpr EnumWord<ColourTransform> kWords[] = {{ColourTransform::None, "none"},
                                                         {ColourTransform::SubtractGreen, "subtract_green"}};
  return kWords;
}

static constexpr const char* kPosition = "a list of 3 numbers that fit a 32-bit float";

// With the largest numbers they stay within 64 KiB, and within 10,000 JSON values.
static constexpr std::size_t kMostResumedTiles = 1500;

static void describe(auto& fields, Is<ResumeRequest> auto& message) {
  fields.field("session_id", message.session_id);
  fields.field("tiles", message.tiles);
  fields.require("tiles", message.tiles.size() <= kMostResumedTiles, "a list of at most 1500 tiles");
  const bool are_tiles =
      std::all_of(message.tiles.begin(), message.tiles.end(), [](const auto& t) { return t[0] <= 255 && t[4] >= 1; });
  fields.require("tiles", are_tiles, "a list of [level from 0 to 255, x, y, z, revision from 1]");
  fields.optional("raw", message.raw);
  const bool are_places =
      !message.raw || std::all_of(message.raw->begin(), message.raw->end(),
                                  [&](std::uint32_t place) { return place < message.tiles.size(); });
  fields.require("raw", are_places, "a list of places in tiles, from 0");
}

static void describe(auto& fields, Is<SubscribeRequest> auto& message) {
  fields.field("channels", message.channels);
  fields.require("channels", !message.channels.empty(), "a list of at least one channel");
  const auto bytes = [&fields](const char* key, auto& value) {
    fields.optional(key, value);
    const std::uint32_t given = value.value_or(1);
    fields.require(key, given >= 1 && given <= 2'147'483'647U, "an integer from 1 to 2147483647");
  };
  bytes("in_flight_bytes", message.in_flight_bytes);
  bytes("cache_bytes", message.cache_bytes);
  fields.optional("colour_transform", message.colour_transform);
  fields.optional("temperature_step_celsius", message.temperature_step_celsius);
  const double step = message.temperature_step_celsius.value_or(1);
  fields.require("temperature_step_celsius", step > 0 && step <= 1000, "a number above 0 and of at most 1000");
  fields.optional("resume", message.resume);
}

static void describe(auto& fields, Is<SubscribeReply> auto& message) {
  fields.optional("resumed_tiles", message.resumed_tiles);
}

static void describe(auto& fields, Is<CameraSet> auto& message) {
  fields.field("eye", message.eye);
  fields.require("eye", are_float_coordinates(message.eye), kPosition);
  fields.field("target", message.target);
  fields.require("target", are_float_coordinates(message.target), kPosition);
  fields.field("up", message.up);
  fields.require("up", are_float_coordinates(message.up), kPosition);
  fields.field("fov_y_deg", message.fov_y_deg);
  fields.require("fov_y_deg", message.fov_y_deg > 0 && message.fov_y_deg < 180, "a number above 0 and below 180");
  fields.field("viewport", message.viewport);
  const auto is_side = [](int pixels) { return pixels >= 1 && pixels <= 32'768; };
  fields.require("viewport", is_side(message.viewport[0]) && is_side(message.viewport[1]),
                 "a list of 2 integers from 1 to 32768");
}

static void describe(auto& fields, Is<StreamAck> auto& message) {
  fields.field("sequence", message.sequence);
}

static void describe(auto& fields, Is<StreamComplete> auto& message) {
  fields.field("generation", message.generation);
  fields.field("scene_revision", message.scene_revision);
  fields.field("tiles", message.tiles);
  fields.field("vertices", message.vertices);
}

static void describe(auto& fields, Is<StreamAccuracy> auto& message) {
  fields.nullable("position_mm", message.position_mm);
  fields.field("colour_levels", message.colour_levels);
  fields.nullable("pixel_error", message.pixel_error);
  fields.nullable("temperature_celsius", message.temperature_celsius);
}

static void describe(auto& fields, Is<StreamStats> auto& message) {
  fields.nullable("round_trip_ms", message.round_trip_ms);
  fields.nullable("throughput_bytes_per_s", message.throughput_bytes_per_s);
  fields.field("queued_bytes", message.queued_bytes);
  fields.field("skipped_frames", message.skipped_frames);
  fields.field("viewers", message.viewers);
  fields.field("accuracy", message.accuracy);
}

static void describe(auto& fields, Is<Status> auto& message) {
  fields.field("id", message.id);
  fields.field("level", message.level);
  fields.nullable("message", message.message);
}

template struct Wire<ResumeRequest>;
template struct Wire<SubscribeRequest>;
template struct Wire<SubscribeReply>;
template struct Wire<CameraSet>;
template struct Wire<StreamAck>;
template struct Wire<StreamComplete>;
template struct Wire<StreamAccuracy>;
template struct Wire<StreamStats>;
template struct Wire<Status>;

}  // namespace spectra::protocol
