#include "fusion/settings.hpp"

#include <cmath>
#include <cstdio>
#include <utility>

#include "fusion/colour/palette.hpp"
#include "fusion/registry.hpp"

namespace spectra::fusion {
namespace {

ParameterValues defaults_of(const Method& method) {
  ParameterValues values;
  for (const Parameter& parameter : method.parameters) values[parameter.name] = parameter.default_value;
  return values;
}

const Parameter* find_parameter(const Method& method, std::string_view name) {
  for (const Parameter& parameter : method.parameters) {
    if (parameter.name == name) return &parameter;
  }
  return nullptr;
}

std::string known_parameters(const Method& method) {
  if (method.parameters.empty()) return "it has none";
  std::string text = "it has";
  for (const Parameter& parameter : method.parameters) text += " " + parameter.name;
  return text;
}

std::string known_methods() {
  std::string text;
  for (const Method* method : all_methods()) text += " " + method->id;
  return text;
}

std::string known_palettes() {
  std::string text;
  for (const Palette& palette : all_palettes()) text += " " + palette.id;
  return text;
}

/// The range with what its mode does not use at its default. Adding zero turns -0 into 0, so that equal settings are equal
/// in every bit.
base::Result<RangeSetting> validated(const RangeSetting& range) {
  switch (range.mode) {
    case RangeMode::Auto:
      break;
    case RangeMode::Manual:
      if (!std::isfinite(range.minimum_celsius) || !std::isfinite(range.maximum_celsius)) {
        return base::failure(base::ErrorCode::OutOfRange, "range must have a finite minimum and maximum in degC",
                             "range");
      }
      if (range.minimum_celsius > range.maximum_celsius) {
        return base::failure(base::ErrorCode::Inconsistent, "range must have its minimum at or below its maximum",
                             "range");
      }
      return RangeSetting::manual(range.minimum_celsius + 0.0, range.maximum_celsius + 0.0);
    case RangeMode::Percentile:
      for (const auto& [percent, field] :
           {std::pair(range.low_percent, "low"), std::pair(range.high_percent, "high")}) {
        if (percent >= 0 && percent <= 100) continue;
        return base::failure(
            base::ErrorCode::OutOfRange,
            std::string("range.") + field + " is a percentage and must be of at least 0 and of at most 100",
            std::string("range.") + field);
      }
      if (range.low_percent >= range.high_percent) {
        return base::failure(base::ErrorCode::Inconsistent,
                             "range.low must be below range.high; both are percentages from 0 to 100", "range.low");
      }
      return RangeSetting::percentile(range.low_percent + 0.0, range.high_percent + 0.0);
  }
  return RangeSetting{};
}

std::string seconds_text(double seconds) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%.0f", seconds);
  return buffer;
}

/// A double in hexadecimal: exact and short.
std::string exact(double value) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%a", value);
  return buffer;
}

struct KeyText {
  std::string operator()(Automatic) const { return "auto"; }
  std::string operator()(double number) const { return exact(number); }
  std::string operator()(std::int64_t integer) const { return std::to_string(integer); }
  std::string operator()(bool toggle) const { return toggle ? "true" : "false"; }
  std::string operator()(const std::string& text) const { return text; }
};

}  // namespace

FusionSettings default_settings() {
  FusionSettings settings;
  settings.method = "thermal_visible_blend";
  settings.params = defaults_of(*find_method(settings.method));
  settings.palette = "iron";
  return settings;
}

FusionSettings first_view_settings(const TemperatureSummary& scene) {
  FusionSettings settings = default_settings();
  settings.method = scene.has_temperature() ? "histogram_distribution" : "visible_only";
  settings.params = defaults_of(*find_method(settings.method));
  settings.range = RangeSetting::percentile(0.5, 99.5);
  return settings;
}

base::Result<FusionSettings> with_change(const FusionSettings& settings, const FusionChange& change) {
  FusionSettings changed = settings;
  if (change.method && *change.method != settings.method) {
    const Method* method = find_method(*change.method);
    if (!method) {
      return base::failure(base::ErrorCode::UnknownMethod,
                           "method '" + *change.method + "' is unknown; known are" + known_methods(), "method");
    }
    changed.method = method->id;
    changed.params = defaults_of(*method);
  }
  const Method* method = find_method(changed.method);
  if (!method) {
    return base::failure(base::ErrorCode::UnknownMethod,
                         "method '" + changed.method + "' is unknown; known are" + known_methods(), "method");
  }
  for (const auto& [name, value] : change.params) {
    const Parameter* parameter = find_parameter(*method, name);
    if (!parameter) {
      return base::failure(base::ErrorCode::UnknownParameter,
                           "method " + method->id + " has no parameter '" + name + "'; " + known_parameters(*method),
                           name);
    }
    BOOST_OUTCOME_TRY(changed.params[name], validated(*parameter, value));
  }
  BOOST_OUTCOME_TRYV(method->check(changed.params));

  if (change.palette) {
    const Palette* palette = find_palette(*change.palette);
    if (!palette) {
      return base::failure(base::ErrorCode::UnknownPalette,
                           "palette '" + *change.palette + "' is unknown; known are" + known_palettes(), "palette");
    }
    changed.palette = palette->id;
  }
  if (change.range) {
    BOOST_OUTCOME_TRY(changed.range, validated(*change.range));
  }
  if (change.missing) changed.missing = *change.missing;
  if (change.age.mode) changed.age.mode = *change.age.mode;
  if (change.age.half_life_s) {
    // Written so that not-a-number is refused.
    if (!(*change.age.half_life_s >= kShortestHalfLifeSeconds && *change.age.half_life_s <= kLongestHalfLifeSeconds)) {
      return base::failure(base::ErrorCode::OutOfRange,
                           "age.half_life_s is a time in seconds and must be of at least " +
                               seconds_text(kShortestHalfLifeSeconds) + " and of at most " +
                               seconds_text(kLongestHalfLifeSeconds),
                           "age.half_life_s");
    }
    changed.age.half_life_s = *change.age.half_life_s;
  }
  return changed;
}

std::string cache_key(const FusionSettings& settings) {
  std::string key = settings.method;
  for (const auto& [name, value] : settings.params) key += ";" + name + "=" + std::visit(KeyText{}, value);
  key += ";palette=" + settings.palette + ";range=";
  switch (settings.range.mode) {
    case RangeMode::Auto:
      key += "auto";
      break;
    case RangeMode::Manual:
      key += exact(settings.range.minimum_celsius) + ":" + exact(settings.range.maximum_celsius);
      break;
    case RangeMode::Percentile:
      key += "percentile:" + exact(settings.range.low_percent) + ":" + exact(settings.range.high_percent);
      break;
  }
  key += ";missing=";
  if (const MissingDisplay& missing = settings.missing) {
    char buffer[8];
    std::snprintf(buffer, sizeof buffer, "%02x%02x%02x", unsigned{missing->r}, unsigned{missing->g},
                  unsigned{missing->b});
    key += buffer;
  } else {
    key += "visible";
  }
  if (settings.age.mode == AgeMode::Fade) key += ";half_life=" + exact(settings.age.half_life_s);
  return key;
}

}  // namespace spectra::fusion
