#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace spectra::files {

/// "scalar_surfaceTemp1 (degC)" as scalar, surface, temp, degc: lower case, without digits.
std::vector<std::string> name_words(std::string_view name);

}  // namespace spectra::files
