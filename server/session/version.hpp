#pragma once

#include <string_view>

namespace spectra::session {

/// As CMake's project() says.
inline constexpr std::string_view kVersion = SPECTRA_VERSION;

}  // namespace spectra::session
