// Made by protocol/generate from protocol/schema. Not to be edited.
#include "protocol/messages/quality_messages.hpp"

#include "protocol/messages/fields.hpp"
#include "protocol/messages/rules.hpp"

namespace spectra::protocol {

template <>
std::span<const EnumWord<QualityMode>> words_of() {
  static constexpr EnumWord<QualityMode> kWords[] = {{QualityMode::Auto, "auto"}, {QualityMode::Manual, "manual"}};
  return kWords;
}

static void describe(auto& fields, Is<QualityState> auto& message) {
  fields.field("mode", message.mode);
  fields.field("position_step_mm", message.position_step_mm);
  fields.require(
      "position_step_mm", [&] { return message.position_step_mm > 0; }, "a number above 0");
  fields.field("colour_bits", message.colour_bits);
  fields.require(
      "colour_bits", [&] { return message.colour_bits >= 4 && message.colour_bits <= 8; }, "an integer from 4 to 8");
  fields.field("pixel_error", message.pixel_error);
  fields.require(
      "pixel_error", [&] { return message.pixel_error > 0; }, "a number above 0");
  fields.field("encoder_speed", message.encoder_speed);
  fields.require(
      "encoder_speed", [&] { return message.encoder_speed >= 0 && message.encoder_speed <= 10; },
      "an integer from 0 to 10");
  fields.field("latency_target_ms", message.latency_target_ms);
  fields.require(
      "latency_target_ms", [&] { return message.latency_target_ms > 0; }, "a number above 0");
  fields.field("marks", message.marks);
  rules(fields, message);
}

static void describe(auto& fields, Is<QualityChange> auto& message) {
  fields.optional("mode", message.mode);
  fields.optional("position_step_mm", message.position_step_mm);
  fields.require(
      "position_step_mm",
      [&] {
        return !message.position_step_mm || (*message.position_step_mm > 0 && *message.position_step_mm <= 1000000);
      },
      "a number above 0, at most 1000000");
  fields.optional("colour_bits", message.colour_bits);
  fields.require(
      "colour_bits", [&] { return !message.colour_bits || (*message.colour_bits >= 4 && *message.colour_bits <= 8); },
      "an integer from 4 to 8");
  fields.optional("pixel_error", message.pixel_error);
  fields.require(
      "pixel_error", [&] { return !message.pixel_error || (*message.pixel_error > 0); }, "a number above 0");
  fields.optional("encoder_speed", message.encoder_speed);
  fields.require(
      "encoder_speed",
      [&] { return !message.encoder_speed || (*message.encoder_speed >= 0 && *message.encoder_speed <= 10); },
      "an integer from 0 to 10");
  fields.optional("latency_target_ms", message.latency_target_ms);
  fields.require(
      "latency_target_ms", [&] { return !message.latency_target_ms || (*message.latency_target_ms > 0); },
      "a number above 0");
  fields.optional("marks", message.marks);
  rules(fields, message);
}

static void describe(auto& fields, Is<QualityReply> auto& message) {
  fields.field("quality", message.quality);
  rules(fields, message);
}

template struct Wire<QualityState>;
template struct Wire<QualityChange>;
template struct Wire<QualityReply>;

}  // namespace spectra::protocol
