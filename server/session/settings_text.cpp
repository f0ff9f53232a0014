#include "server/session/settings_text.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>

#include "fusion/registry.hpp"

namespace spectra::session {
using base::ErrorCode;
using base::failure;

namespace {

std::optional<double> finite_number(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace

base::Result<fusion::RangeSetting> range_from_text(std::string_view text) {
  constexpr std::string_view kPercentile = "percentile";
  if (text == "auto") return fusion::RangeSetting{};
  if (text == kPercentile) return fusion::RangeSetting::percentile();
  const bool is_percentile = text.starts_with(kPercentile) && text.substr(kPercentile.size()).starts_with(':');
  const auto numbers = is_percentile ? text.substr(kPercentile.size() + 1) : text;
  const auto colon = numbers.find(':');
  const auto low = finite_number(numbers.substr(0, colon));
  const auto high = colon == std::string_view::npos ? std::nullopt : finite_number(numbers.substr(colon + 1));
  if (!low || !high) {
    return base::failure(
        base::ErrorCode::WrongType,
        "range is \"" + std::string(text) +
            "\"; it must be auto, LO:HI with two numbers in degC, percentile, or percentile:LO:HI with two "
            "percentages from 0 to 100",
        "range");
  }
  return is_percentile ? fusion::RangeSetting::percentile(*low, *high) : fusion::RangeSetting::manual(*low, *high);
}

base::Result<fusion::MissingDisplay> missing_from_text(std::string_view text) {
  if (text == "visible") return fusion::MissingDisplay{};
  std::uint32_t rgb = 0;
  const bool is_colour = text.size() == 7 && text.front() == '#';
  const auto [end, error] = std::from_chars(text.data() + (is_colour ? 1 : 0), text.data() + text.size(), rgb, 16);
  if (!is_colour || error != std::errc{} || end != text.data() + text.size()) {
    return base::failure(base::ErrorCode::WrongType,
                         "missing is \"" + std::string(text) + "\"; it must be visible or a colour such as #ff00ff",
                         "missing");
  }
  const auto channel = [rgb](int shift) { return static_cast<std::uint8_t>(rgb >> shift & 0xffU); };
  return fusion::MissingDisplay{base::Rgb8{channel(16), channel(8), channel(0)}};
}

std::string missing_to_text(const fusion::MissingDisplay& missing) {
  if (!missing) return "visible";
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text = "#";
  for (const unsigned channel : {missing->r, missing->g, missing->b}) {
    text += kDigits[channel >> 4U];
    text += kDigits[channel & 15U];
  }
  return text;
}

base::Result<fusion::FusionSettings> settings_from_text(const SettingsText& text) {
  fusion::FusionChange change;
  change.method = text.method;
  change.palette = text.palette;
  if (text.range) {
    BOOST_OUTCOME_TRY(auto range, range_from_text(*text.range));
    change.range = range;
  }
  if (text.missing) {
    BOOST_OUTCOME_TRY(auto missing, missing_from_text(*text.missing));
    change.missing = missing;
  }
  const auto defaults = fusion::default_settings();
  const std::string method_id = text.method.value_or(defaults.method);
  const fusion::Method* method = fusion::find_method(method_id);
  for (const auto& [name, value] : text.params) {
    if (method == nullptr) break;  // with_change() refuses the method and says which there are
    const auto& parameters = method->parameters;
    const auto parameter = std::find_if(parameters.begin(), parameters.end(),
                                        [&name = name](const fusion::Parameter& p) { return p.name == name; });
    if (parameter == parameters.end()) {
      std::string known;
      for (const auto& p : parameters) known += (known.empty() ? "" : ", ") + p.name;
      return base::failure(base::ErrorCode::UnknownParameter,
                           method_id + " has no parameter \"" + name + "\"; it has " + (known.empty() ? "none" : known),
                           "params." + name);
    }
    BOOST_OUTCOME_TRY(auto parsed, fusion::parse_parameter(*parameter, value));
    change.params.insert_or_assign(name, std::move(parsed));
  }
  return fusion::with_change(defaults, change);
}

}  // namespace spectra::session
