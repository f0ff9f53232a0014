#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "server/access/role.hpp"
#include "server/access/secrets.hpp"

namespace spectra::access {

/// What is kept of a token: not the token itself.
struct AccessToken {
  std::string name;  ///< Of whom it was made for: 1 to 32 of a-z A-Z 0-9 _ -.
  AccessRole role = AccessRole::Viewer;
  Digest digest{};  ///< SHA-256 of the token.
};

/// Whom a server lets in.
struct TokenList {
  std::vector<AccessToken> tokens;  ///< Of different names.
  std::string secret;               ///< What cookies are signed with: 32 letters or more.
};

/// A value, or what is wrong in one sentence for a person.
template <class T>
using AccessResult = std::variant<T, std::string>;

bool is_token_name(std::string_view name);

/// Reads a file: lines `secret TEXT` (one) and `ROLE NAME DIGEST`, empty ones and ones that begin with #. Wrong is a file that cannot be
/// read, one that everybody on the machine may read, and any line that is none of these.
AccessResult<TokenList> read_tokens(const std::filesystem::path& file);
/// The text of one. What is wrong begins with its place, to be put behind a name.
AccessResult<TokenList> parsed_tokens(const std::string& text);
/// Writes it so that only its owner can read it; the old one stays until the new one is whole.
std::optional<std::string> write_tokens(const std::filesystem::path& file, const TokenList& list);

/// From the environment: `ROLE=TOKEN` with commas or spaces between them; a name is made of the role and a number. Tokens have 24 characters or more.
AccessResult<TokenList> tokens_of_text(std::string_view text);

/// A new token, to be shown once.
std::string new_token(AccessRole role);

}  // namespace spectra::access
