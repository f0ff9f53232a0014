#include "protocol/messages/fusion_messages.hpp"

#include <algorithm>

#include "protocol/messages/fields.hpp"

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

/// A value whose type is told by the JSON itself.
template <>
Result<ParameterValue> Wire<ParameterValue>::read(const nlohmann::json& value, std::string_view path) {
  if (value.is_null()) return ParameterValue(nullptr);
  if (value.is_boolean()) return ParameterValue(value.get<bool>());
  if (value.is_string()) return ParameterValue(value.get_ref<const std::string&>());
  if (value.is_number_integer() && integer_in<std::int64_t>(value))
    return ParameterValue(*integer_in<std::int64_t>(value));
  if (value.is_number() && std::isfinite(value.get<double>())) return ParameterValue(value.get<double>());
  return BOOST_OUTCOME_V2_NAMESPACE::failure(
      unexpected(std::string(path), "a number, a string, true, false or null", value));
}

template <>
nlohmann::json Wire<ParameterValue>::written(const ParameterValue& value) {
  return std::visit(
      []<class Value>(const Value& held) -> nlohmann::json {
        if constexpr (std::same_as<Value, std::nullptr_t>)
          return nullptr;
        else
          return json_of(held);
      },
      value);
}

template <>
Result<ParameterValues> Wire<ParameterValues>::read(const nlohmann::json& value, std::string_view path) {
  if (!value.is_object()) return BOOST_OUTCOME_V2_NAMESPACE::failure(unexpected(std::string(path), "an object", value));
  ParameterValues values;
  for (const auto& [name, item] : value.items()) {
    BOOST_OUTCOME_TRY(auto read, from_json<ParameterValue>(item, std::string(path) + "." + name));
    values.emplace(name, std::move(read));
  }
  return values;
}

template <>
nlohmann::json Wire<ParameterValues>::written(const ParameterValues& values) {
  nlohmann::json object = nlohmann::json::object();
  for (const auto& [name, value] : values) object[name] = to_json(value);
  return object;
}

static bool is_missing_display(std::string_view text) {
  const auto is_hex = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'); };
  return text == "visible" ||
         (text.size() == 7 && text.front() == '#' && std::all_of(text.begin() + 1, text.end(), is_hex));
}
static constexpr const char* kMissingDisplay = "\"visible\" or a colour \"#rrggbb\"";

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
  fields.require("step", message.step.value_or(1) > 0, "a number above 0");
  fields.unless_empty("unit", message.unit);
  fields.unless_empty("options", message.options);
  fields.optional("automatic", message.automatic);
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
}

static void describe(auto& fields, Is<PaletteDescription> auto& message) {
  fields.field("id", message.id);
  fields.field("label", message.label);
  fields.field("fusion_safe", message.fusion_safe);
  fields.optional("diverging", message.diverging);
  fields.field("colours", message.colours);
  fields.require("colours",
                 message.colours.size() == 256 &&
                     std::all_of(message.colours.begin(), message.colours.end(),
                                 [](const std::array<double, 3>& colour) {
                                   return std::all_of(colour.begin(), colour.end(),
                                                      [](double channel) { return channel >= 0 && channel <= 255; });
                                 }),
                 "256 colours of 0 to 255");
}

static void describe(auto& fields, Is<FusionRange> auto& message) {
  fields.field("mode", message.mode);
  fields.nullable("min", message.min);
  fields.nullable("max", message.max);
  fields.optional("low", message.low);
  fields.optional("high", message.high);
}

static void describe(auto& fields, Is<RangeChange> auto& message) {
  fields.field("mode", message.mode);
  fields.optional_or_null("min", message.min);
  fields.optional_or_null("max", message.max);
  fields.optional("low", message.low);
  fields.optional("high", message.high);
  const bool is_manual = message.mode == RangeMode::Manual;
  fields.require("min", !is_manual || message.min, "a number (degC) for a manual range");
  fields.require("max", !is_manual || message.max, "a number (degC) for a manual range");
  fields.require("max", !is_manual || message.min <= message.max, "a number not below min");
}

static void describe(auto& fields, Is<FusionAge> auto& message) {
  fields.field("mode", message.mode);
  fields.field("half_life_s", message.half_life_s);
  fields.require("half_life_s", message.half_life_s > 0, "a number above 0");
}

static void describe(auto& fields, Is<AgeChange> auto& message) {
  fields.optional("mode", message.mode);
  fields.optional("half_life_s", message.half_life_s);
}

static void describe(auto& fields, Is<ChangeScale> auto& message) {
  fields.field("min", message.min);
  fields.field("max", message.max);
  fields.require("max", message.min < message.max, "a number above min");
}

static void describe(auto& fields, Is<FusionState> auto& message) {
  fields.field("method", message.method);
  fields.field("params", message.params);
  fields.field("params_in_force", message.params_in_force);
  fields.field("palette", message.palette);
  fields.field("range", message.range);
  fields.field("missing", message.missing);
  fields.require("missing", is_missing_display(message.missing), kMissingDisplay);
  fields.field("age", message.age);
  fields.optional("change_scale", message.change_scale);
}

static void describe(auto& fields, Is<FusionChange> auto& message) {
  fields.optional("method", message.method);
  fields.unless_empty("params", message.params);
  fields.optional("palette", message.palette);
  fields.optional("range", message.range);
  fields.optional("missing", message.missing);
  fields.require("missing", is_missing_display(message.missing.value_or("visible")), kMissingDisplay);
  fields.optional("age", message.age);
}

static void describe(auto& fields, Is<FusionReply> auto& message) {
  fields.field("generation", message.generation);
  fields.field("fusion", message.fusion);
}

template struct Wire<ParameterDescription>;
template struct Wire<MethodDescription>;
template struct Wire<PaletteDescription>;
template struct Wire<FusionRange>;
template struct Wire<RangeChange>;
template struct Wire<FusionAge>;
template struct Wire<AgeChange>;
template struct Wire<ChangeScale>;
template struct Wire<FusionState>;
template struct Wire<FusionChange>;
template struct Wire<FusionReply>;

}  // namespace spectra::protocol
