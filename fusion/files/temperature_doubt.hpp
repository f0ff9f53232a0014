#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "fusion/files/ply_header.hpp"
#include "fusion/files/vertex_temperature.hpp"

namespace spectra::files {

/// Why temperatures are hard to believe as degrees Celsius, and which option mends it.
struct TemperatureDoubt {
  std::uint64_t count = 0;  ///< Of the temperatures that it is about.
  std::string message;
};

/// For temperatures of which some are finite. `told`: how the property's numbers were scaled; nullopt: nobody has said so, and they
/// are taken as degC. nullopt: nothing to say.
std::optional<TemperatureDoubt> temperature_doubt(const TemperatureFacts& facts, const PlyProperty& property,
                                                  const std::optional<CelsiusScale>& told);

}  // namespace spectra::files
