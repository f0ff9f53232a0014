#include <cstdio>
#include <variant>

#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/serve_setup.hpp"

namespace spectra::app {

int run_check_config(const std::filesystem::path& file, const ServeOptions& options) {
  const auto setup = serve_setup(options);
  if (const auto* problem = std::get_if<SetupProblem>(&setup)) {
    return fail(problem->status, file.string() + ": " + problem->text);
  }
  const auto& good = std::get<ServeSetup>(setup);
  const std::string scene = options.scene                      ? options.scene->string()
                            : options.is_live || options.store ? "a live map"
                                                               : "the demo scene";
  std::printf("%s is good: %s on %s, %s, %s\n", file.c_str(), scene.c_str(), options.listen.c_str(),
              good.tls ? "encrypted" : "not encrypted",
              good.tokens ? (std::to_string(good.tokens->tokens.size()) + " tokens").c_str() : "no tokens");
  return kDone;
}

}  // namespace spectra::app
