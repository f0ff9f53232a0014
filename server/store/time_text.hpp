#pragma once

#include <string>

#include "server/store/block_record.hpp"

namespace spectra::store {

/// For a person: 2026-01-31T12:34:56Z.
std::string utc_text(StoreTime time);

}  // namespace spectra::store
