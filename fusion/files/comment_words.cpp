#include "fusion/files/comment_words.hpp"

namespace spectra::files {

namespace {

bool is_letter(char c) {
  return c >= 'a' && c <= 'z';
}
bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// How many bytes at the beginning of a text are the sign for micro, in UTF-8 (there are two) or Latin-1.
std::size_t micro_bytes(std::string_view text) {
  if (text.starts_with("\xC2\xB5") || text.starts_with("\xCE\xBC")) return 2;
  return text.starts_with("\xB5") ? 1 : 0;
}

}  // namespace

std::vector<std::string> comment_words(std::string_view line) {
  std::vector<std::string> words;
  std::string word;
  const auto finish = [&] {
    while (word.ends_with('.')) word.pop_back();
    if (!word.empty() && word != "-") words.push_back(word);
    word.clear();
  };
  char before = ' ';
  for (std::size_t i = 0; i < line.size(); ++i) {
    const std::size_t micro_size = micro_bytes(line.substr(i));
    char c = line[i];
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    if (micro_size > 0) {
      c = 'u';
      i += micro_size - 1;
    }
    const bool is_part = is_letter(c) || is_digit(c) || c == '.';
    if (is_part) {
      word += c;
    } else {
      finish();
      if (c == ':' || c == '=') words.emplace_back("=");
      if (c == ',' || c == ';') words.emplace_back(",");
      if (c == '-' && !is_letter(before) && !is_digit(before)) word = "-";
    }
    before = c;
  }
  finish();
  const bool is_info = words.size() > 1 && words[0] == "obj" && words[1] == "info";
  if (is_info || (!words.empty() && words[0] == "comment"))
    words.erase(words.begin(), words.begin() + (is_info ? 2 : 1));
  return words;
}

}  // namespace spectra::files
