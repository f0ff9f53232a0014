#pragma once

#include <optional>
#include <string_view>

#include "fusion/files/read_options.hpp"

namespace spectra::files {

/// What the name of a property tells about temperature.
struct TemperatureName {
  /// How plainly the name says that the property is a temperature: "temperature" most, then "temp", "thermal", "therm",
  /// a unit alone; "scalar_" before and units behind change little, nor does the case. 0: it does not.
  int rank = 0;
  /// A mere "t", which may as well be a time or a texture coordinate.
  bool is_bare_t = false;
  /// The unit that the name says.
  std::optional<TemperatureUnit> unit;
  /// Whatever it is called, it might hold a temperature: some word says so, or it is no normal, colour, time or the like.
  bool is_candidate = false;
  /// Beside such a property a bare t is no temperature: a time, a ring, a texture coordinate.
  bool speaks_against_t = false;
};

TemperatureName temperature_name(std::string_view name);

}  // namespace spectra::files
