#pragma once

#include <string_view>

namespace spectra::files {

/// What a file that is no PLY seems to be, by its first bytes, as the end of a sentence: "a ZIP archive: unpack it first".
/// Empty when that is not known.
std::string_view file_kind(std::string_view first_bytes);

}  // namespace spectra::files
