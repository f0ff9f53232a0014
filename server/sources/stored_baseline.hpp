#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "server/map/block_baseline.hpp"
#include "server/map/living_map.hpp"

namespace spectra::sources {

/// The baseline of a block as a store keeps it beside the block's bytes. Empty for an empty one.
std::string text_of(const map::BlockBaseline& baseline);
/// Its inverse; nothing where the bytes are not that of a block of so many vertices. Safe on any bytes.
std::optional<map::BlockBaseline> baseline_from(std::string_view bytes, std::size_t vertex_count);

/// The newest mark of a map as the store's constant of that name.
inline constexpr const char* kBaselineKey = "baseline";
struct StoredMark {
  map::BaselineMark mark;
  std::uint64_t revision = 0;  ///< The newest change of the store that it takes in.
};
std::string text_of(const StoredMark& stored);
std::optional<StoredMark> mark_from(const std::string& text);

}  // namespace spectra::sources
