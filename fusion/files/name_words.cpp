#include "fusion/files/name_words.hpp"

#include <cctype>

namespace spectra::files {

std::vector<std::string> name_words(std::string_view name) {
  std::vector<std::string> words;
  bool is_inside = false;
  bool was_lower = false;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalpha(byte) == 0) {
      is_inside = false;
      was_lower = false;
      continue;
    }
    const bool is_upper = std::isupper(byte) != 0;
    if (!is_inside || (is_upper && was_lower)) words.emplace_back();
    words.back() += static_cast<char>(std::tolower(byte));
    is_inside = true;
    was_lower = !is_upper;
  }
  return words;
}

}  // namespace spectra::files
