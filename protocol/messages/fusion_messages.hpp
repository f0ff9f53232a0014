// Made by protocol/generate from protocol/schema. Not to be edited.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/messages/message.hpp"
#include "protocol/messages/parameter_value.hpp"

/// Fusion methods, palettes and settings.
namespace spectra::protocol {

enum class ParameterKind { Number, Integer, Toggle, Choice, Temperature };

/// One parameter of a method; enough to build its form. A bound that is absent is none.
struct ParameterDescription {
  std::string name;
  std::string label;
  std::string help;
  ParameterKind kind = ParameterKind::Number;
  ParameterValue default_value;
  /// Smallest value, allowed itself.
  std::optional<double> min;
  /// Largest value, allowed itself.
  std::optional<double> max;
  /// Lower bound that is itself refused.
  std::optional<double> exclusive_min;
  /// A sensible slider step.
  std::optional<double> step;
  std::string unit;
  /// Ids of a choice.
  std::vector<std::string> options;
  /// Whether null = automatic is allowed; absent: it is not.
  std::optional<bool> automatic;
};

/// METHOD.
struct MethodDescription {
  std::string id;
  std::string label;
  std::string summary;
  bool needs_temperature = true;
  bool uses_palette = true;
  /// A palette that is not fusion_safe loses temperature with this method.
  bool wants_fusion_safe_palette = false;
  /// A palette that is not diverging does not tell warmer from colder with this method. Absent: false.
  std::optional<bool> wants_diverging_palette;
  /// It shows how temperatures differ from the vertices' baseline; where there is none it shows the visible
  /// colours. Absent: false.
  std::optional<bool> compares_with_baseline;
  std::vector<ParameterDescription> params;
};

/// r, g, b, sRGB-encoded, real-valued
using Colour = std::array<double, 3>;

/// PALETTE.
struct PaletteDescription {
  std::string id;
  std::string label;
  /// Carries temperature by hue alone.
  bool fusion_safe = false;
  /// Tells two directions from a neutral middle. Absent: false.
  std::optional<bool> diverging;
  /// Row 0 is the coldest.
  std::vector<Colour> colours;
};

enum class RangeMode { Auto, Manual, Percentile };

/// The active temperature range, degC; null without thermal data unless set by hand.
struct FusionRange {
  RangeMode mode = RangeMode::Auto;
  /// nullopt = null.
  std::optional<double> min;
  /// nullopt = null.
  std::optional<double> max;
  /// Percent of the finite temperatures below min; of percentile only.
  std::optional<double> low;
  /// Percent of the finite temperatures below max; of percentile only.
  std::optional<double> high;
};

enum class AgeMode { Off, Fade };

/// How the age of what was seen is shown.
struct FusionAge {
  AgeMode mode = AgeMode::Off;
  /// After so many seconds half of the colour is left.
  double half_life_s = 300;
};

/// How the age of what was seen is to be shown; what is absent stays.
struct AgeChange {
  std::optional<AgeMode> mode;
  /// 1 to 10,000,000.
  std::optional<double> half_life_s;
};

/// mode auto, or mode manual with min and max (degC, min <= max), or mode percentile with low and high (percent,
/// low < high).
struct RangeChange {
  RangeMode mode = RangeMode::Auto;
  /// nullopt = null.
  std::optional<double> min;
  /// nullopt = null.
  std::optional<double> max;
  /// Percent of the finite temperatures below the range; of percentile, 1 when absent.
  std::optional<double> low;
  /// Percent of the finite temperatures below its upper end; of percentile, 99 when absent.
  std::optional<double> high;
};

/// The changes of temperature at the ends of the palette, kelvin.
struct ChangeScale {
  double min = 0;
  /// Above min.
  double max = 0;
};

/// FUSION: the settings in force. params holds what was set (null = automatic), params_in_force the same with
/// automatic values as numbers (null when the scene has no temperature).
struct FusionState {
  std::string method;
  ParameterValues params;
  ParameterValues params_in_force;
  std::string palette;
  FusionRange range;
  std::string missing = "visible";
  FusionAge age;
  /// What the palette stands for where it shows changes of temperature; absent: the range.
  std::optional<ChangeScale> change_scale;
};

/// Params of fusion.set: any part of FUSION; what is absent stays.
struct FusionChange {
  std::optional<std::string> method;
  ParameterValues params;
  std::optional<std::string> palette;
  std::optional<RangeChange> range;
  std::optional<std::string> missing;
  std::optional<AgeChange> age;
};

/// Result of fusion.set and fusion.get; params of the notification fusion.changed.
struct FusionReply {
  /// Number that the colour frames of these settings carry.
  std::uint32_t generation = 0;
  FusionState fusion;
};

extern template struct Wire<ParameterDescription>;
extern template struct Wire<MethodDescription>;
extern template struct Wire<PaletteDescription>;
extern template struct Wire<FusionRange>;
extern template struct Wire<FusionAge>;
extern template struct Wire<AgeChange>;
extern template struct Wire<RangeChange>;
extern template struct Wire<ChangeScale>;
extern template struct Wire<FusionState>;
extern template struct Wire<FusionChange>;
extern template struct Wire<FusionReply>;

}  // namespace spectra::protocol
