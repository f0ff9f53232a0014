#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "server/store/block_record.hpp"

namespace spectra::store {

/// For a person: 2026-01-31T12:34:56Z.
std::string utc_text(StoreTime time);

/// From a person or a program: Unix seconds (1769862896.5), or 2026-01-31T12:34:56Z with an optional fraction of a second, a space
/// instead of T, and Z or +01:00 at the end, always one of them. Nothing for anything else, and beyond the years 1970 to 9999.
std::optional<StoreTime> time_of(std::string_view text);

}  // namespace spectra::store
