#include "server/app/serve_setup.hpp"

#include <cstdlib>
#include <fstream>
#include <system_error>

#include "server/net/tls_identity.hpp"

namespace spectra::app {
namespace fs = std::filesystem;
namespace {

constexpr const char* kTokensVariable = "SPECTRA_TOKENS";

}  // namespace

fs::path web_root(const ServeOptions& options) {
  if (options.web) return *options.web;
  std::error_code error;
  const auto program = fs::read_symlink("/proc/self/exe", error);
  for (const fs::path& candidate : {program.parent_path() / "../share/spectra/web", fs::path(SPECTRA_WEB_DIST)}) {
    if (fs::exists(candidate / "index.html", error)) return candidate;
  }
  return fs::path(SPECTRA_WEB_DIST);
}

std::optional<std::string> scene_problem(const ServeOptions& options) {
  for (const auto& path : {options.scene, options.thermal}) {
    if (path && !std::ifstream(*path)) return path->string() + ": cannot be opened";
  }
  return std::nullopt;
}

std::optional<std::string> web_problem(const ServeOptions& options) {
  std::error_code ignored;
  if (!options.web || fs::exists(*options.web / "index.html", ignored)) return std::nullopt;
  return options.web->string() + ": there is no index.html in it";
}

std::optional<std::string> store_problem(const ServeOptions& options) {
  if (!options.store) return std::nullopt;
  const fs::path& store = *options.store;
  const fs::path folder = store.has_parent_path() ? store.parent_path() : fs::path(".");
  std::error_code error;
  const auto place = fs::status(folder, error);
  if (place.type() == fs::file_type::not_found) return store.string() + ": there is no folder " + folder.string();
  const auto found = fs::status(store, error);
  if (found.type() == fs::file_type::none) return store.string() + ": " + error.message();
  if (fs::exists(found) && !fs::is_regular_file(found)) return store.string() + " is no file";
  if (options.at && !fs::exists(found)) return store.string() + ": there is no store yet, so it has no past";
  return std::nullopt;
}

access::AccessResult<std::optional<access::TokenList>> token_list(const ServeOptions& options) {
  access::AccessResult<access::TokenList> list;
  if (options.tokens) {
    list = access::read_tokens(*options.tokens);
  } else if (const char* text = std::getenv(kTokensVariable); text != nullptr && !options.is_insecure) {
    list = access::tokens_of_text(text);
    if (auto* problem = std::get_if<std::string>(&list)) return std::string(kTokensVariable) + ": " + *problem;
  } else {
    return std::optional<access::TokenList>();
  }
  if (auto* problem = std::get_if<std::string>(&list)) return std::move(*problem);
  return std::optional(std::get<access::TokenList>(std::move(list)));
}

bool is_open_to_strangers(const ServeOptions& options, const net::ListenAddress& listen, bool has_tokens) {
  return !has_tokens && !options.is_insecure && !net::is_loopback(listen);
}

std::variant<ServeSetup, SetupProblem> serve_setup(const ServeOptions& options) {
  ServeSetup setup;
  const auto listen = net::parsed_listen_address(options.listen);
  if (!listen) {
    return SetupProblem{kWrongUsage,
                        "--listen " + options.listen + ": ADDRESS:PORT is wanted, such as 0.0.0.0:8080 or [::]:8080"};
  }
  setup.listen = *listen;
  for (const auto look : {scene_problem, web_problem}) {
    if (auto problem = look(options)) return SetupProblem{kJobFailed, std::move(*problem)};
  }
  auto tokens = token_list(options);
  if (auto* problem = std::get_if<std::string>(&tokens)) return SetupProblem{kJobFailed, std::move(*problem)};
  setup.tokens = std::get<std::optional<access::TokenList>>(std::move(tokens));
  if (is_open_to_strangers(options, *listen, setup.tokens.has_value())) {
    return SetupProblem{kWrongUsage, "--listen " + options.listen +
                                         " lets others in: name whom with --tokens FILE (spectra token makes it), or " +
                                         "let anybody watch and operate with --insecure"};
  }
  if (options.invited && !setup.tokens) return SetupProblem{kWrongUsage, "--invite is for a server with --tokens"};
  if (options.certificate) {
    setup.tls = std::make_shared<net::TlsIdentity>(*options.certificate, *options.key);
    if (auto problem = setup.tls->load()) return SetupProblem{kJobFailed, std::move(*problem)};
  }
  if (auto problem = store_problem(options)) return SetupProblem{kJobFailed, std::move(*problem)};
  return setup;
}

}  // namespace spectra::app
