#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "fusion/colour/palette.hpp"
#include "fusion/registry.hpp"
#include "server/app/commands.hpp"
#include "server/session/conversions.hpp"

namespace spectra::app {
namespace {

struct ValueText {
  std::string operator()(fusion::Automatic) const { return "automatic"; }
  std::string operator()(double number) const { return fmt::format("{}", number); }
  std::string operator()(std::int64_t integer) const { return std::to_string(integer); }
  std::string operator()(bool toggle) const { return toggle ? "true" : "false"; }
  std::string operator()(const std::string& text) const { return text; }
};

std::string bounds_text(const fusion::Parameter& parameter) {
  if (!parameter.options.empty()) {
    std::string text;
    for (const auto& option : parameter.options) text += (text.empty() ? "" : " | ") + option;
    return text;
  }
  if (std::isfinite(parameter.exclusive_min))
    return fmt::format("above {}, up to {}", parameter.exclusive_min, parameter.max);
  if (std::isfinite(parameter.min) && std::isfinite(parameter.max)) {
    return fmt::format("{} to {}", parameter.min, parameter.max);
  }
  if (std::isfinite(parameter.min)) return fmt::format("{} and up", parameter.min);
  return std::string(to_string(parameter.kind));
}

}  // namespace

int run_methods(bool as_json) {
  if (as_json) {
    auto methods = nlohmann::json::array();
    for (const auto& method : session::method_messages()) methods.push_back(protocol::to_json(method));
    fmt::print("{}\n", methods.dump(2));
    return kDone;
  }
  for (const fusion::Method* method : fusion::all_methods()) {
    fmt::print("{}\n    {}\n", method->id, method->summary);
    for (const auto& p : method->parameters) {
      fmt::print("    {} ({}{}; default {}): {}\n", p.name, bounds_text(p), p.unit.empty() ? "" : " " + p.unit,
                 std::visit(ValueText{}, p.default_value), p.help);
    }
  }
  fmt::print("\nPalettes:");
  for (const auto& palette : fusion::all_palettes()) {
    fmt::print(" {}{}{}", palette.id, palette.fusion_safe ? "*" : "", palette.diverging ? "+" : "");
  }
  fmt::print("\n(* carries temperature by hue alone: for intensity_hue; + is neutral in the middle: for changes)\n");
  return kDone;
}

}  // namespace spectra::app
