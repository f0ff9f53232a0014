#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>

namespace spectra::store {

using Sha256 = std::array<unsigned char, 32>;

/// Of these bytes.
Sha256 sha256(std::string_view bytes);

/// 64 hexadecimal digits, lower case.
std::string to_hex(const Sha256& hash);

}  // namespace spectra::store
