#include "server/access/token_file.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>

#include "server/access/private_file.hpp"

namespace spectra::access {
namespace {

constexpr std::size_t kSecretLength = 43;  // 258 bits
constexpr std::size_t kTokenLength = 43;
constexpr std::size_t kShortestToken = 24;
constexpr std::uintmax_t kLargestFileBytes = 1 << 20;

std::string system_error(const std::filesystem::path& file, const char* what) {
  return file.string() + what + ": " + std::strerror(errno);
}

bool has_name(const TokenList& list, std::string_view name) {
  return std::any_of(list.tokens.begin(), list.tokens.end(), [name](const AccessToken& t) { return t.name == name; });
}

/// What is wrong with a line, or nothing.
std::optional<std::string> take_line(TokenList& list, const std::string& line) {
  std::istringstream words(line);
  std::string first, second, third, fourth;
  words >> first >> second >> third >> fourth;
  if (first.empty() || first[0] == '#') return std::nullopt;
  if (first == "secret" && third.empty()) {
    if (!list.secret.empty()) return "there are two secrets";
    if (second.size() < 32) return "the secret is shorter than 32 letters";
    list.secret = second;
    return std::nullopt;
  }
  AccessToken token;
  const auto role = access_role(first);
  if (!role) return "\"" + first.substr(0, 32) + "\" is no role: viewer, operator, ingest or admin";
  if (!is_token_name(second)) return "a name has 1 to 32 of a-z A-Z 0-9 _ -";
  if (!fourth.empty() || !from_hex(third, token.digest))
    return "a digest of 64 hexadecimal digits is wanted at the end";
  if (has_name(list, second)) return "the name " + second + " is there twice";
  token.role = *role;
  token.name = second;
  list.tokens.push_back(std::move(token));
  return std::nullopt;
}

}  // namespace

bool is_token_name(std::string_view name) {
  return !name.empty() && name.size() <= 32 && std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  });
}

AccessResult<TokenList> read_tokens(const std::filesystem::path& file) {
  struct stat facts {};
  if (stat(file.c_str(), &facts) != 0) return system_error(file, "");
  if (!S_ISREG(facts.st_mode) || static_cast<std::uintmax_t>(facts.st_size) > kLargestFileBytes) {
    return file.string() + " is no file of tokens";
  }
  if ((facts.st_mode & S_IRWXO) != 0) {
    return file.string() + " is open to everybody on this machine: chmod 600 " + file.string();
  }
  std::ifstream in(file);
  if (!in) return system_error(file, "");
  const std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (in.bad()) return system_error(file, "");
  auto list = parsed_tokens(text);
  if (const auto* problem = std::get_if<std::string>(&list)) return file.string() + *problem;
  return list;
}

AccessResult<TokenList> parsed_tokens(const std::string& text) {
  TokenList list;
  std::istringstream in(text);
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (const auto problem = take_line(list, line)) return ", line " + std::to_string(number) + ": " + *problem;
  }
  if (list.tokens.empty()) return std::string(": there is no token in it; `spectra token` makes one");
  if (list.secret.empty()) return std::string(": the line with the secret is missing; `spectra token` writes it");
  return list;
}

std::optional<std::string> write_tokens(const std::filesystem::path& file, const TokenList& list) {
  std::string text =
      "# Who may use a Spectra server; tokens themselves are not in here. `spectra token --help` tells more.\n";
  text += "secret " + (list.secret.empty() ? random_text(kSecretLength) : list.secret) + '\n';
  for (const AccessToken& token : list.tokens) {
    text += std::string(to_string(token.role)) + ' ' + token.name + ' ' + to_hex(token.digest) + '\n';
  }
  return write_private_file(file, text);
}

AccessResult<TokenList> tokens_of_text(std::string_view text) {
  TokenList list;
  std::string all;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find_first_of(", \t\r\n", begin), text.size());
    const std::string_view word = text.substr(begin, end - begin);
    begin = end + 1;
    if (word.empty()) continue;
    const auto equals = word.find('=');
    const auto role = access_role(word.substr(0, equals));
    if (equals == std::string_view::npos || !role) {
      return std::string("ROLE=TOKEN is wanted, with viewer, operator, ingest or admin for ROLE");
    }
    const std::string_view token = word.substr(equals + 1);
    if (token.size() < kShortestToken) {
      return "the token of the " + std::string(to_string(*role)) + " is shorter than " +
             std::to_string(kShortestToken) + " characters";
    }
    std::string name(to_string(*role));
    for (int n = 2; has_name(list, name); ++n) name = std::string(to_string(*role)) + '-' + std::to_string(n);
    list.tokens.push_back({std::move(name), *role, digest_of(token)});
    all += token;
  }
  if (list.tokens.empty()) return std::string("there is no token in it");
  list.secret = to_hex(digest_of("cookies " + all));
  return list;
}

std::string new_token(AccessRole role) {
  return "spectra_" + std::string(to_string(role)) + '_' + random_text(kTokenLength);
}

}  // namespace spectra::access
