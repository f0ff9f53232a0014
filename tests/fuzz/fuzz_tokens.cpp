#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <set>
#include <string>
#include <variant>

#include "server/access/token_file.hpp"

namespace {

using namespace spectra;

void check(bool holds) {
  if (!holds) std::abort();
}

/// Names are names and nobody's twice; what is wrong is said.
void pass(const access::AccessResult<access::TokenList>& read) {
  if (const auto* problem = std::get_if<std::string>(&read)) return check(!problem->empty());
  const auto& list = std::get<access::TokenList>(read);
  check(!list.tokens.empty() && list.secret.size() >= 32);
  std::set<std::string> names;
  for (const access::AccessToken& token : list.tokens)
    check(access::is_token_name(token.name) && names.insert(token.name).second);
}

}  // namespace

/// Any text as a file of tokens, and as tokens in the environment.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  pass(access::parsed_tokens(text));
  pass(access::tokens_of_text(text));
  return 0;
}
