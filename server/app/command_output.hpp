#pragma once

#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/files/ply_reader.hpp"
#include "server/app/progress_line.hpp"

namespace spectra::app {

/// Writes "spectra: MESSAGE" to standard error and returns `status`.
int fail(int status, std::string_view message);

/// The same for an error of the fusion library: what was asked for wrongly is wrong usage, the rest a failed job.
int fail(const base::Error& error);

/// Writes "spectra: warning: MESSAGE" to standard error.
void warn(std::string_view message);

/// Writes what was repaired, left out or interpreted to standard error, one line each.
void print_notes(const std::vector<files::Note>& notes);

/// The stages of reading a scene, and those that follow.
std::vector<ProgressStage> with_loading(const std::filesystem::path& scene,
                                        const std::optional<std::filesystem::path>& thermal,
                                        std::vector<ProgressStage> next);

/// The options, with their progress told to the line.
files::ReadOptions watched(files::ReadOptions options, ProgressLine& line);

/// Reads a scene, with the temperatures of a second file where one is given, and surveys it.
base::Result<files::LoadedScene> load_scene(const std::filesystem::path& scene,
                                            const std::optional<std::filesystem::path>& thermal,
                                            const files::ReadOptions& options);

}  // namespace spectra::app
