// Made by protocol/generate from protocol/schema. Not to be edited.
#include "protocol/messages/stream_messages.hpp"

#include "protocol/messages/fields.hpp"
#include "protocol/messages/rules.hpp"

namespace spectra::protocol {

template <>
std::span<const EnumWord<Channel>> words_of() {
  static constexpr EnumWord<Channel> kWords[] = {{Channel::Fused, "fused"},
                                                 {Channel::Temperature, "temperature"},
                                                 {Channel::Visible, "visible"},
                                                 {Channel::TemperatureSigma, "temperature_sigma"}};
  return kWords;
}

template <>
std::span<const EnumWord<ColourTransform>> words_of() {
  static constexpr EnumWord<ColourTransform> kWords[] = {{ColourTransform::None, "none"},
                                                         {ColourTransform::SubtractGreen, "subtract_green"}};
  return kWords;
}

template <>
std::span<const EnumWord<StatusLevel>> words_of() {
  static constexpr EnumWord<StatusLevel> kWords[] = {
      {StatusLevel::Info, "info"}, {StatusLevel::Warning, "warning"}, {StatusLevel::Error, "error"}};
  return kWords;
}

static void describe(auto& fields, Is<CameraSet> auto& message) {
  fields.field("eye", message.eye);
  fields.require(
      "eye",
      [&] {
        return each(message.eye,
                    [](const auto& item) { return item >= -3.4028234663852886e+38 && item <= 3.4028234663852886e+38; });
      },
      "a list of 3 numbers that fit a 32-bit float");
  fields.field("target", message.target);
  fields.require(
      "target",
      [&] {
        return each(message.target,
                    [](const auto& item) { return item >= -3.4028234663852886e+38 && item <= 3.4028234663852886e+38; });
      },
      "a list of 3 numbers that fit a 32-bit float");
  fields.field("up", message.up);
  fields.require(
      "up",
      [&] {
        return each(message.up,
                    [](const auto& item) { return item >= -3.4028234663852886e+38 && item <= 3.4028234663852886e+38; });
      },
      "a list of 3 numbers that fit a 32-bit float");
  fields.field("fov_y_deg", message.fov_y_deg);
  fields.require(
      "fov_y_deg", [&] { return message.fov_y_deg > 0 && message.fov_y_deg < 180; }, "a number above 0 and below 180");
  fields.field("viewport", message.viewport);
  fields.require(
      "viewport", [&] { return each(message.viewport, [](const auto& item) { return item >= 1 && item <= 32768; }); },
      "a list of 2 integers from 1 to 32768");
  rules(fields, message);
}

static void describe(auto& fields, Is<ResumeRequest> auto& message) {
  fields.field("session_id", message.session_id);
  fields.field("tiles", message.tiles);
  fields.require(
      "tiles",
      [&] {
        return message.tiles.size() <= 1500 &&
               each(message.tiles, [](const auto& item) { return item[0] <= 255U && item[4] >= 1U; });
      },
      "a list of at most 1500 tiles [level 0..255, x, y, z, revision from 1]");
  fields.optional("raw", message.raw);
  fields.optional("temperature_sigma", message.temperature_sigma);
  fields.optional("colours", message.colours);
  fields.require(
      "colours", [&] { return !message.colours || ((*message.colours).size() <= 1500); },
      "a list of at most 1500 pairs [place in tiles, sequence]");
  rules(fields, message);
}

static void describe(auto& fields, Is<SubscribeRequest> auto& message) {
  fields.field("channels", message.channels);
  fields.require(
      "channels", [&] { return message.channels.size() >= 1; }, "a list of at least 1");
  fields.optional("in_flight_bytes", message.in_flight_bytes);
  fields.require(
      "in_flight_bytes",
      [&] {
        return !message.in_flight_bytes || (*message.in_flight_bytes >= 1U && *message.in_flight_bytes <= 2147483647U);
      },
      "an integer from 1 to 2147483647");
  fields.optional("cache_bytes", message.cache_bytes);
  fields.require(
      "cache_bytes",
      [&] { return !message.cache_bytes || (*message.cache_bytes >= 1U && *message.cache_bytes <= 2147483647U); },
      "an integer from 1 to 2147483647");
  fields.optional("colour_transform", message.colour_transform);
  fields.optional("temperature_step_celsius", message.temperature_step_celsius);
  fields.require(
      "temperature_step_celsius",
      [&] {
        return !message.temperature_step_celsius ||
               (*message.temperature_step_celsius > 0 && *message.temperature_step_celsius <= 1000);
      },
      "a number above 0, at most 1000");
  fields.optional("resume", message.resume);
  rules(fields, message);
}

static void describe(auto& fields, Is<SubscribeReply> auto& message) {
  fields.optional("resumed_tiles", message.resumed_tiles);
  fields.require(
      "resumed_tiles",
      [&] { return !message.resumed_tiles || (*message.resumed_tiles >= 0 && *message.resumed_tiles <= 1500); },
      "an integer from 0 to 1500");
  fields.optional("current_colours", message.current_colours);
  fields.optional("generation", message.generation);
  rules(fields, message);
}

static void describe(auto& fields, Is<StreamAck> auto& message) {
  fields.field("sequence", message.sequence);
  rules(fields, message);
}

static void describe(auto& fields, Is<StreamComplete> auto& message) {
  fields.field("generation", message.generation);
  fields.field("scene_revision", message.scene_revision);
  fields.field("tiles", message.tiles);
  fields.field("vertices", message.vertices);
  rules(fields, message);
}

static void describe(auto& fields, Is<StreamAccuracy> auto& message) {
  fields.nullable("position_mm", message.position_mm);
  fields.field("colour_levels", message.colour_levels);
  fields.require(
      "colour_levels", [&] { return message.colour_levels >= 1 && message.colour_levels <= 256; },
      "an integer from 1 to 256");
  fields.nullable("pixel_error", message.pixel_error);
  fields.nullable("temperature_celsius", message.temperature_celsius);
  rules(fields, message);
}

static void describe(auto& fields, Is<StreamStats> auto& message) {
  fields.nullable("round_trip_ms", message.round_trip_ms);
  fields.nullable("throughput_bytes_per_s", message.throughput_bytes_per_s);
  fields.field("queued_bytes", message.queued_bytes);
  fields.field("skipped_frames", message.skipped_frames);
  fields.field("viewers", message.viewers);
  fields.field("accuracy", message.accuracy);
  fields.field("generation", message.generation);
  fields.field("scene_revision", message.scene_revision);
  rules(fields, message);
}

static void describe(auto& fields, Is<Status> auto& message) {
  fields.field("id", message.id);
  fields.field("level", message.level);
  fields.nullable("message", message.message);
  rules(fields, message);
}

template struct Wire<CameraSet>;
template struct Wire<ResumeRequest>;
template struct Wire<SubscribeRequest>;
template struct Wire<SubscribeReply>;
template struct Wire<StreamAck>;
template struct Wire<StreamComplete>;
template struct Wire<StreamAccuracy>;
template struct Wire<StreamStats>;
template struct Wire<Status>;

}  // namespace spectra::protocol
