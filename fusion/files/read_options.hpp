#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/base/progress.hpp"
#include "fusion/base/up_axis.hpp"
#include "fusion/base/vertex_types.hpp"

namespace spectra::files {

/// Whether a number can be meant as Unix seconds: 0 to 1e11, the year 5138. Milliseconds of today are more.
constexpr bool is_unix_time(double seconds) {
  return seconds >= 0 && seconds <= 1e11;
}

/// What a temperature property counts in.
enum class TemperatureUnit { Celsius, Kelvin, Centikelvin, Fahrenheit };

/// By its name on the command line: celsius, kelvin, centikelvin, fahrenheit.
std::optional<TemperatureUnit> temperature_unit(std::string_view name);

/// The names of properties that are written with commas between them: three, or one alone. WrongType when they are not that many.
base::Result<std::vector<std::string>> colour_properties(std::string_view text);

/// From the numbers of a file to degrees Celsius: celsius = factor * value + offset.
struct CelsiusScale {
  double factor = 1;
  double offset = 0;
};

/// What a person knows of a file that the file does not say itself. The default: everything is found out.
struct ReadOptions {
  /// The vertex (or face) property that holds the temperature, any scalar; empty: found by its name.
  std::string temperature_property;
  /// The vertex (or face) properties that hold red, green and blue, any scalars, or one: grey, or a packed colour by its name (rgb,
  /// rgba); empty: found by their names.
  std::vector<std::string> colour_properties;
  /// The number of the file that is white; absent: found by how far its colours go. Not of packed colours and splats.
  std::optional<double> colour_white;
  /// The unit, or instead of it a scale, an offset or both: celsius = scale * value + offset.
  std::optional<TemperatureUnit> temperature_unit;
  std::optional<double> temperature_scale;
  std::optional<double> temperature_offset;
  /// Values of the file, in its own unit, that stand for "nothing was measured". Infinite ones may be among them.
  std::vector<double> no_data;
  /// Metres in one unit of the file's positions; absent: nobody has said, and they are taken for metres.
  std::optional<double> metres_per_unit;
  /// What positions are to be relative to, in metres; absent: chosen as scene_origin.hpp says.
  std::optional<base::Vec3d> origin;
  /// Which way is up; absent: found out, by survey().
  std::optional<base::UpAxis> up;
  /// Is told how far the reading is, as kReadingPhase, and of a second file as kReadingThermalPhase and kJoiningPhase.
  base::Progress progress;

  double scale() const { return metres_per_unit.value_or(1); }
  /// How the temperature is scaled; nullopt: nobody said so, it is taken for degrees Celsius.
  std::optional<CelsiusScale> celsius_scale() const;
};

/// OutOfRange or Inconsistent, naming the option, when the options cannot be meant.
base::Result<void> check_read_options(const ReadOptions& options);

}  // namespace spectra::files
