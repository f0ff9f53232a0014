#include "server/app/config_file.hpp"

#include <toml++/toml.h>

#include <CLI/CLI.hpp>
#include <istream>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace spectra::app {
namespace {

/// Values go into the options as the file is read, so that whatever an option refuses is told with its line: CLI11's own reader knows
/// no lines and takes much that is no TOML.
class TomlConfig final : public CLI::Config {
 public:
  TomlConfig(CLI::App& program, CLI::App& command) : program_(program), command_(command) {}

  std::string to_config(const CLI::App*, bool, bool, std::string) const override { return {}; }

  std::vector<CLI::ConfigItem> from_config(std::istream& in) const override {
    toml::table root;
    try {
      root = toml::parse(in);
    } catch (const toml::parse_error& error) {
      refuse(error.source().begin.line, std::string(error.description()));
    }
    const std::string section = '[' + command_.get_name() + ']';
    for (const auto& [name, value] : root) {
      const auto* table = value.as_table();
      if (name.str() != command_.get_name()) {
        refuse(name.source().begin.line, table != nullptr
                                             ? "there is no section [" + std::string(name.str()) + "], only " + section
                                             : '"' + std::string(name.str()) + "\" stands outside " + section);
      }
      if (table == nullptr) refuse(name.source().begin.line, section + " is a section");
      for (const auto& [key, setting] : *table) set(std::string(key.str()), key.source().begin.line, setting);
    }
    return {};
  }

 private:
  [[noreturn]] void refuse(toml::source_index line, const std::string& what) const {
    const std::string file = program_.get_config_ptr()->as<std::string>();
    throw CLI::ConfigError(file + ", line " + std::to_string(line) + ": " + what, CLI::ExitCodes::ConfigError);
  }

  void set(const std::string& key, toml::source_index line, const toml::node& value) const {
    CLI::Option* option = command_.get_option_no_throw("--" + key);
    if (option == nullptr) option = command_.get_option_no_throw(key);
    if (option == nullptr || option == command_.get_help_ptr() || key.front() == '-') {
      refuse(line, command_.get_name() + " has no option \"" + key + "\" (see: spectra serve --help)");
    }
    if (!option->empty()) return;  // the command line said it
    const bool is_flag = option->get_items_expected_max() == 0;
    std::vector<std::string> texts;
    if (const auto* list = value.as_array(); list != nullptr && option->get_items_expected_max() > 1) {
      for (const auto& item : *list) texts.push_back(text_of(key, line, item));
    } else if (is_flag != value.is_boolean()) {
      refuse(line, key + (is_flag ? ": true or false is wanted" : ": a value is wanted, not true or false"));
    } else {
      texts.push_back(text_of(key, line, value));
    }
    // A flag that is off is one that was not given: it may exclude others.
    if (texts.empty() || (is_flag && texts.front() == "false")) return;
    try {
      option->add_result(texts);
      option->run_callback();
    } catch (const CLI::ParseError& error) {
      refuse(line, error.what());
    }
  }

  std::string text_of(const std::string& key, toml::source_index line, const toml::node& value) const {
    if (value.is_table() || value.is_array()) {
      refuse(line, key + ": one value is wanted, not a " + (value.is_table() ? "section" : "list"));
    }
    if (const auto* text = value.as_string()) return text->get();
    std::ostringstream out;
    value.visit([&out](const auto& node) { out << node; });
    return out.str();
  }

  CLI::App& program_;
  CLI::App& command_;
};

}  // namespace

void add_config_file(CLI::App& program, CLI::App& command) {
  const std::string section = '[' + command.get_name() + ']';
  program.set_config(
      "--config", "",
      "A TOML file; its section " + section + " holds options of " + command.get_name() + " by their long names");
  program.config_formatter(std::make_shared<TomlConfig>(program, command));
}

}  // namespace spectra::app
