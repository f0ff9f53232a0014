#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace spectra::access {

/// Writes a file that its owner alone can read; an old one stays until the new one is whole. Nothing, or a sentence that says what is wrong.
std::optional<std::string> write_private_file(const std::filesystem::path& file, const std::string& text);

}  // namespace spectra::access
