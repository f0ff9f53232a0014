#include "fusion/files/comment_words.hpp"

namespace spectra::files {

namespace {

bool is_letter(char c) {
  return c >= 'a' && c <= 'z';
}
bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

}  // namespace

std::vector<std::string> comment_words(std::string_view line) {
  std::vector<std::string> words;
  std::string word;
  const auto finish = [&] {
    if (!word.empty() && word != "-") words.push_back(word);
    word.clear();
  };
  char before = ' ';
  for (const char raw : line) {
    const char c = raw >= 'A' && raw <= 'Z' ? static_cast<char>(raw - 'A' + 'a') : raw;
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
