#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <variant>

#include "server/access/token_file.hpp"
#include "server/app/commands.hpp"
#include "server/net/http_server.hpp"

namespace spectra::net {
class TlsIdentity;
}

namespace spectra::app {

/// What `spectra serve` needs before it opens its port.
struct ServeSetup {
  net::ListenAddress listen;
  std::optional<access::TokenList> tokens;  ///< Whom to let in; nothing: nobody needs a token.
  std::shared_ptr<net::TlsIdentity> tls;    ///< Loaded; null: connections are not encrypted.
};

/// Why it cannot serve, for a person.
struct SetupProblem {
  int status = kJobFailed;  ///< Exit status.
  std::string text;
};

/// Looks at everything that the options name, without changing anything: address, files, tokens (of the environment, too), certificate, the folder
/// of the store.
std::variant<ServeSetup, SetupProblem> serve_setup(const ServeOptions& options);

/// The parts of it, each a problem or nothing.
std::optional<std::string> scene_problem(const ServeOptions& options);
std::optional<std::string> web_problem(const ServeOptions& options);
std::optional<std::string> store_problem(const ServeOptions& options);
/// Whom to let in: as options and environment say.
access::AccessResult<std::optional<access::TokenList>> token_list(const ServeOptions& options);
/// The address lets others in, and nothing says whom.
bool is_open_to_strangers(const ServeOptions& options, const net::ListenAddress& listen, bool has_tokens);

/// The built web client: as asked for, installed beside the program, or in the source tree it was built from.
std::filesystem::path web_root(const ServeOptions& options);

}  // namespace spectra::app
