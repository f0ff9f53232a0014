#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/map/living_map.hpp"

namespace spectra::sources {

/// The constants of a map as the store's constant of that name.
inline constexpr const char* kConstantsKey = "map";
std::string text_of(const map::MapConstants& constants);
/// Its inverse; nothing where the text is no such. Safe on any text.
std::optional<map::MapConstants> constants_of(const std::string& text);

/// The constants that a map had before it was emptied: its history is read by them.
inline constexpr const char* kEarlierConstantsKey = "maps before";
struct EarlierConstants {
  std::uint64_t until_revision = 0;  ///< Of the change that emptied the map.
  map::MapConstants constants;
};
/// Oldest first; of many the newest.
std::string text_of(const std::vector<EarlierConstants>& earlier);
/// Lines that cannot be read are left out: they say how positions were rounded, and no more.
std::vector<EarlierConstants> earlier_constants_of(const std::string& text);

}  // namespace spectra::sources
