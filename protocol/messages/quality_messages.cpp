#include "protocol/messages/quality_messages.hpp"

#include "protocol/messages/fields.hpp"

namespace spectra::protocol {

template <>
std::span<const EnumWord<QualityMode>> words_of() {
  static constexpr EnumWord<QualityMode> kWords[] = {{QualityMode::Auto, "auto"}, {QualityMode::Manual, "manual"}};
  return kWords;
}

static constexpr const char* kPositive = "a number above 0";
/// A kilometre. What is asked for beyond that is a mistake.
static constexpr double kLargestStepMm = 1e6;
static constexpr const char* kStep = "a number above 0, at most 1000000";
static constexpr const char* kColourBits = "an integer from 4 to 8";
static constexpr const char* kSpeed = "an integer from 0 to 10";

static void describe(auto& fields, Is<QualityState> auto& message) {
  fields.field("mode", message.mode);
  fields.field("position_step_mm", message.position_step_mm);
  fields.require("position_step_mm", message.position_step_mm > 0, kPositive);
  fields.field("colour_bits", message.colour_bits);
  fields.require("colour_bits", message.colour_bits >= 4 && message.colour_bits <= 8, kColourBits);
  fields.field("pixel_error", message.pixel_error);
  fields.require("pixel_error", message.pixel_error > 0, kPositive);
  fields.field("encoder_speed", message.encoder_speed);
  fields.require("encoder_speed", message.encoder_speed >= 0 && message.encoder_speed <= 10, kSpeed);
  fields.field("latency_target_ms", message.latency_target_ms);
  fields.require("latency_target_ms", message.latency_target_ms > 0, kPositive);
  fields.field("marks", message.marks);
}

static void describe(auto& fields, Is<QualityChange> auto& message) {
  fields.optional("mode", message.mode);
  fields.optional("position_step_mm", message.position_step_mm);
  const double step_mm = message.position_step_mm.value_or(1);
  fields.require("position_step_mm", step_mm > 0 && step_mm <= kLargestStepMm, kStep);
  fields.optional("colour_bits", message.colour_bits);
  fields.require("colour_bits", message.colour_bits.value_or(8) >= 4 && message.colour_bits.value_or(8) <= 8,
                 kColourBits);
  fields.optional("pixel_error", message.pixel_error);
  fields.require("pixel_error", message.pixel_error.value_or(1) > 0, kPositive);
  fields.optional("encoder_speed", message.encoder_speed);
  fields.require("encoder_speed", message.encoder_speed.value_or(0) >= 0 && message.encoder_speed.value_or(0) <= 10,
                 kSpeed);
  fields.optional("latency_target_ms", message.latency_target_ms);
  fields.require("latency_target_ms", message.latency_target_ms.value_or(1) > 0, kPositive);
  fields.optional("marks", message.marks);
}

static void describe(auto& fields, Is<QualityReply> auto& message) {
  fields.field("quality", message.quality);
}

template struct Wire<QualityState>;
template struct Wire<QualityChange>;
template struct Wire<QualityReply>;

}  // namespace spectra::protocol
