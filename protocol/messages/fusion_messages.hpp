#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "protocol/messages/message.hpp"

namespace spectra::protocol {

/// The value of a fusion parameter on the wire: null (automatic), number, integer, toggle or choice.
using ParameterValue = std::variant<std::nullptr_t, double, std::int64_t, bool, std::string>;
using ParameterValues = std::map<std::string, ParameterValue, std::less<>>;

enum class ParameterKind { Number, Integer, Toggle, Choice, Temperature };

/// One parameter of a method, enough to build its form.
struct ParameterDescription {
  std::string name;
  std::string label;
  std::string help;
  ParameterKind kind = ParameterKind::Number;
  ParameterValue default_value;  ///< JSON key "default".
  std::optional<double> min;     ///< Allowed itself; absent: no bound.
  std::optional<double> max;
  std::optional<double> exclusive_min;  ///< A lower bound that is itself refused.
  std::optional<double> step;           ///< Above 0.
  std::string unit;                     ///< Absent when empty.
  std::vector<std::string> options;     ///< Ids of a choice; absent when empty.
  std::optional<bool> automatic;        ///< null = automatic is allowed; absent: it is not.
};

/// METHOD.
struct MethodDescription {
  std::string id;
  std::string label;
  std::string summary;
  bool needs_temperature = true;
  bool uses_palette = true;
  bool wants_fusion_safe_palette = false;  ///< A palette that is not fusion_safe loses temperature with this method.
  std::optional<bool> wants_diverging_palette;  ///< One that is not diverging does not tell warmer from colder with it.
  std::optional<bool> compares_with_baseline;   ///< It shows how temperatures differ from the baseline. Absent: no.
  std::vector<ParameterDescription> params;
};

/// PALETTE: 256 rows of r, g, b in 0..255, real-valued; row 0 is the coldest.
struct PaletteDescription {
  std::string id;
  std::string label;
  bool fusion_safe = false;
  std::optional<bool> diverging;  ///< Tells two directions from a neutral middle. Absent: no.
  std::vector<std::array<double, 3>> colours;
};

enum class RangeMode { Auto, Manual, Percentile };

/// The active temperature range, degC; nullopt = null: no thermal data and not set by hand.
struct FusionRange {
  RangeMode mode = RangeMode::Auto;
  std::optional<double> min;
  std::optional<double> max;
  std::optional<double> low;  ///< Percent, as is `high`; of percentile only.
  std::optional<double> high;
};

/// A range as it is set. Manual has both bounds, min <= max; percentile has low < high in percent, 1 and 99 where absent.
struct RangeChange {
  RangeMode mode = RangeMode::Auto;
  std::optional<double> min;
  std::optional<double> max;
  std::optional<double> low;
  std::optional<double> high;
};

enum class AgeMode { Off, Fade };

/// How the age of what was seen is shown.
struct FusionAge {
  AgeMode mode = AgeMode::Off;
  double half_life_s = 300;
};

/// The same as it is set; what is absent stays.
struct AgeChange {
  std::optional<AgeMode> mode;
  std::optional<double> half_life_s;
};

/// The changes of temperature at the ends of the palette, kelvin; min < max.
struct ChangeScale {
  double min = 0;
  double max = 0;
};

/// FUSION: the settings in force.
struct FusionState {
  std::string method;
  ParameterValues params;           ///< What was set; null = automatic.
  ParameterValues params_in_force;  ///< Automatic values as numbers; null when the scene has no temperature.
  std::string palette;
  FusionRange range;
  std::string missing = "visible";  ///< "visible" or "#rrggbb".
  FusionAge age;
  std::optional<ChangeScale> change_scale;  ///< What the palette stands for where that is not the range.
};

/// Params of fusion.set; what is absent stays. Names and bounds of `params` are the server's to check.
struct FusionChange {
  std::optional<std::string> method;
  ParameterValues params;
  std::optional<std::string> palette;
  std::optional<RangeChange> range;
  std::optional<std::string> missing;  ///< "visible" or "#rrggbb", checked.
  std::optional<AgeChange> age;
};

/// Result of fusion.set and fusion.get; params of fusion.changed.
struct FusionReply {
  std::uint32_t generation = 0;
  FusionState fusion;
};

template <>
Result<ParameterValue> Wire<ParameterValue>::read(const nlohmann::json& value, std::string_view path);
template <>
nlohmann::json Wire<ParameterValue>::written(const ParameterValue& value);
template <>
Result<ParameterValues> Wire<ParameterValues>::read(const nlohmann::json& value, std::string_view path);
template <>
nlohmann::json Wire<ParameterValues>::written(const ParameterValues& values);

extern template struct Wire<ParameterDescription>;
extern template struct Wire<MethodDescription>;
extern template struct Wire<PaletteDescription>;
extern template struct Wire<FusionRange>;
extern template struct Wire<RangeChange>;
extern template struct Wire<FusionAge>;
extern template struct Wire<AgeChange>;
extern template struct Wire<ChangeScale>;
extern template struct Wire<FusionState>;
extern template struct Wire<FusionChange>;
extern template struct Wire<FusionReply>;

}  // namespace spectra::protocol
