#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <variant>

#include "server/access/token_file.hpp"
#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"

namespace spectra::app {

int run_token(const TokenOptions& options) {
  access::TokenList list;
  std::error_code error;
  if (std::filesystem::exists(options.file, error)) {
    auto read = access::read_tokens(options.file);
    if (const auto* problem = std::get_if<std::string>(&read)) return fail(kJobFailed, *problem);
    list = std::get<access::TokenList>(std::move(read));
  } else if (options.is_list || !options.removed.empty()) {
    return fail(kJobFailed, options.file.string() + " is not there");
  }
  const auto find = [&list](const std::string& name) {
    return std::find_if(list.tokens.begin(), list.tokens.end(),
                        [&name](const access::AccessToken& t) { return t.name == name; });
  };
  if (options.is_list) {
    for (const access::AccessToken& token : list.tokens) fmt::print("{} {}\n", to_string(token.role), token.name);
    return kDone;
  }
  if (!options.removed.empty()) {
    const auto found = find(options.removed);
    if (found == list.tokens.end())
      return fail(kJobFailed, options.file.string() + " has no token of " + options.removed);
    if (list.tokens.size() == 1) {
      return fail(kJobFailed,
                  "that is the last token; without one nobody could log in (delete the file to do without)");
    }
    list.tokens.erase(found);
    if (const auto problem = access::write_tokens(options.file, list)) return fail(kJobFailed, *problem);
    fmt::print(stderr, "the token of {} is taken back; a server that runs reads its file again on SIGHUP\n",
               options.removed);
    return kDone;
  }
  std::string name = options.name.empty() ? options.role : options.name;
  if (!access::is_token_name(name))
    return fail(kWrongUsage, "--name " + name + ": 1 to 32 of a-z A-Z 0-9 _ - are wanted");
  if (options.name.empty()) {
    for (int n = 2; find(name) != list.tokens.end(); ++n) name = options.role + '-' + std::to_string(n);
  } else if (find(name) != list.tokens.end()) {
    return fail(kJobFailed, options.file.string() + " has a token of " + name + " already; --remove it first");
  }
  const access::AccessRole role = access::access_role(options.role).value_or(access::AccessRole::Viewer);
  const std::string token = access::new_token(role);
  list.tokens.push_back({name, role, access::digest_of(token)});
  if (const auto problem = access::write_tokens(options.file, list)) return fail(kJobFailed, *problem);
  fmt::print("{}\n", token);
  fmt::print(stderr, "the token of {} ({}), shown this once; {} keeps only its digest\n", name, options.role,
             options.file.string());
  return kDone;
}

}  // namespace spectra::app
