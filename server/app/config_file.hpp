#pragma once

namespace CLI {
class App;
}

namespace spectra::app {

/// Gives the program the option `--config`: a TOML file whose section named like `command` holds that command's options by their
/// long names, and its positional ones by theirs. The command line decides where both say something. What cannot be meant
/// (no TOML, an unknown section or key, a value that the option refuses) ends parsing with a CLI::ParseError that names the file, the line
/// and the key. Both apps must outlive the parsing.
void add_config_file(CLI::App& program, CLI::App& command);

}  // namespace spectra::app
