// Made by protocol/generate from protocol/schema. Not to be edited.
#include "protocol/messages/fusion_messages.hpp"

#include "protocol/messages/fields.hpp"
#include "protocol/messages/rules.hpp"

namespace spectra::protocol {

template <>
std::span<const EnumWord<ParameterKind>> words_of() {
  static constexpr EnumWord<ParameterKind> kWords[] = {{ParameterKind::Number, "number"},
                                                       {ParameterKind::Integer, "integer"},
                                                       {ParameterKind::Toggle, "toggle"},
                                                       {ParameterKind::Choice, "choice"},
                                                       {ParameterKind::Temperature, "temperature"}};
  return kWords;
}

template <>
std::span<const EnumWord<RangeMode>> words_of() {
  static constexpr EnumWord<RangeMode> kWords[] = {
      {RangeMode::Auto, "auto"}, {RangeMode::Manual, "manual"}, {RangeMode::Percentile, "percentile"}};
  return kWords;
}

template <>
std::span<const EnumWord<AgeMode>> words_of() {
  static constexpr EnumWord<AgeMode> kWords[] = {{AgeMode::Off, "off"}, {AgeMode::Fade, "fade"}};
  return kWords;
}

static void describe(auto& fields, Is<ParameterDescription> auto& message) {
  fields.field("name", message.name);
  fields.field("label", message.label);
  fields.field("help", message.help);
  fields.field("kind", message.kind);
  fields.field("default", message.default_value);
  fields.optional("min", message.min);
  fields.optional("max", message.max);
  fields.optional("exclusive_min", message.exclusive_min);
  fields.optional("step", message.step);
  fields.require(
      "step", [&] { return !message.step || (*message.step > 0); }, "a number above 0");
  fields.unless_empty("unit", message.unit);
  fields.unless_empty("options", message.options);
  fields.optional("automatic", message.automatic);
  rules(fields, message);
}

static void describe(auto& fields, Is<MethodDescription> auto& message) {
  fields.field("id", message.id);
  fields.field("label", message.label);
  fields.field("summary", message.summary);
  fields.field("needs_temperature", message.needs_temperature);
  fields.field("uses_palette", message.uses_palette);
  fields.field("wants_fusion_safe_palette", message.wants_fusion_safe_palette);
  fields.optional("wants_diverging_palette", message.wants_diverging_palette);
  fields.optional("compares_with_baseline", message.compares_with_baseline);
  fields.field("params", message.params);
  rules(fields, message);
}

static void describe(auto& fields, Is<PaletteDescription> auto& message) {
  fields.field("id", message.id);
  fields.field("label", message.label);
  fields.field("fusion_safe", message.fusion_safe);
  fields.optional("diverging", message.diverging);
  fields.field("colours", message.colours);
  fields.require(
      "colours",
      [&] {
        return message.colours.size() == 256 && each(message.colours, [](const auto& item) {
                 return each(item, [](const auto& part) { return part >= 0 && part <= 255; });
               });
      },
      "a list of 256");
  rules(fields, message);
}

static void describe(auto& fields, Is<FusionRange> auto& message) {
  fields.field("mode", message.mode);
  fields.nullable("min", message.min);
  fields.nullable("max", message.max);
  fields.optional("low", message.low);
  fields.require(
      "low", [&] { return !message.low || (*message.low >= 0 && *message.low <= 100); }, "a number from 0 to 100");
  fields.optional("high", message.high);
  fields.require(
      "high", [&] { return !message.high || (*message.high >= 0 && *message.high <= 100); }, "a number from 0 to 100");
  rules(fields, message);
}

static void describe(auto& fields, Is<FusionAge> auto& message) {
  fields.field("mode", message.mode);
  fields.field("half_life_s", message.half_life_s);
  fields.require(
      "half_life_s", [&] { return message.half_life_s > 0; }, "a number above 0");
  rules(fields, message);
}

static void describe(auto& fields, Is<AgeChange> auto& message) {
  fields.optional("mode", message.mode);
  fields.optional("half_life_s", message.half_life_s);
  rules(fields, message);
}

static void describe(auto& fields, Is<RangeChange> auto& message) {
  fields.field("mode", message.mode);
  fields.optional_or_null("min", message.min);
  fields.optional_or_null("max", message.max);
  fields.optional("low", message.low);
  fields.require(
      "low", [&] { return !message.low || (*message.low >= 0 && *message.low <= 100); }, "a number from 0 to 100");
  fields.optional("high", message.high);
  fields.require(
      "high", [&] { return !message.high || (*message.high >= 0 && *message.high <= 100); }, "a number from 0 to 100");
  rules(fields, message);
}

static void describe(auto& fields, Is<ChangeScale> auto& message) {
  fields.field("min", message.min);
  fields.field("max", message.max);
  rules(fields, message);
}

static void describe(auto& fields, Is<FusionState> auto& message) {
  fields.field("method", message.method);
  fields.field("params", message.params);
  fields.field("params_in_force", message.params_in_force);
  fields.field("palette", message.palette);
  fields.field("range", message.range);
  fields.field("missing", message.missing);
  fields.require(
      "missing", [&] { return matches(message.missing, "^(visible|#[0-9a-fA-F]{6})$"); },
      "\"visible\" or a colour \"#rrggbb\"");
  fields.field("age", message.age);
  fields.optional("change_scale", message.change_scale);
  rules(fields, message);
}

static void describe(auto& fields, Is<FusionChange> auto& message) {
  fields.optional("method", message.method);
  fields.unless_empty("params", message.params);
  fields.optional("palette", message.palette);
  fields.optional("range", message.range);
  fields.optional("missing", message.missing);
  fields.require(
      "missing", [&] { return !message.missing || (matches(*message.missing, "^(visible|#[0-9a-fA-F]{6})$")); },
      "\"visible\" or a colour \"#rrggbb\"");
  fields.optional("age", message.age);
  rules(fields, message);
}

static void describe(auto& fields, Is<FusionReply> auto& message) {
  fields.field("generation", message.generation);
  fields.field("fusion", message.fusion);
  rules(fields, message);
}

template struct Wire<ParameterDescription>;
template struct Wire<MethodDescription>;
template struct Wire<PaletteDescription>;
template struct Wire<FusionRange>;
template struct Wire<FusionAge>;
template struct Wire<AgeChange>;
template struct Wire<RangeChange>;
template struct Wire<ChangeScale>;
template struct Wire<FusionState>;
template struct Wire<FusionChange>;
template struct Wire<FusionReply>;

}  // namespace spectra::protocol
