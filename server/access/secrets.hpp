#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace spectra::access {

using Digest = std::array<std::uint8_t, 32>;

/// Random bytes of the system's generator, in letters, digits, - and _ (6 bits each). Throws std::runtime_error when there are none.
std::string random_text(std::size_t length);
/// Random letters and digits of which none is like another (5 bits each), for people to copy.
std::string random_code(std::size_t length);

/// SHA-256.
Digest digest_of(std::string_view text);
/// HMAC with SHA-256.
Digest signature_of(std::string_view text, std::string_view key);
/// Takes as long whatever differs.
bool is_same(const Digest& one, const Digest& other);

std::string to_hex(const Digest& digest);
/// False when the text is not 64 hexadecimal digits.
bool from_hex(std::string_view text, Digest& digest);

}  // namespace spectra::access
