#include "server/access/secrets.hpp"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <openssl/rand.h>

#include <stdexcept>
#include <vector>

namespace spectra::access {
namespace {

std::string random_of(std::size_t length, std::string_view letters) {
  std::vector<unsigned char> bytes(length);
  if (RAND_bytes(bytes.data(), static_cast<int>(length)) != 1) {
    throw std::runtime_error("the system gives no random numbers");
  }
  std::string text;
  // The number of letters divides 256, so that all are equally likely.
  for (const unsigned char byte : bytes) text += letters[byte % letters.size()];
  return text;
}

}  // namespace

std::string random_text(std::size_t length) {
  return random_of(length, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_");
}

std::string random_code(std::size_t length) {
  return random_of(length, "ABCDEFGHJKLMNPQRSTUVWXYZ23456789");
}

Digest digest_of(std::string_view text) {
  Digest digest{};
  EVP_Digest(text.data(), text.size(), digest.data(), nullptr, EVP_sha256(), nullptr);
  return digest;
}

Digest signature_of(std::string_view text, std::string_view key) {
  Digest digest{};
  HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()), reinterpret_cast<const unsigned char*>(text.data()),
       text.size(), digest.data(), nullptr);
  return digest;
}

bool is_same(const Digest& one, const Digest& other) {
  return CRYPTO_memcmp(one.data(), other.data(), one.size()) == 0;
}

std::string to_hex(const Digest& digest) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t byte : digest) {
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 15U];
  }
  return text;
}

bool from_hex(std::string_view text, Digest& digest) {
  if (text.size() != 2 * digest.size()) return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto digit = std::string_view("0123456789abcdef").find(text[i]);
    if (digit == std::string_view::npos) return false;
    digest[i / 2] = static_cast<std::uint8_t>(digest[i / 2] << 4U | digit);
  }
  return true;
}

}  // namespace spectra::access
