#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace spectra::app {

/// How the log of a server looks and where it goes.
struct LogOptions {
  std::string format = "text";  ///< Or "json": an object with time (UTC), level and message in each line.
  std::string level = "info";   ///< debug, info, warning or error: what is less is left out.
  /// Absent: standard error, which journald takes. A file is begun anew at 10 MB, and five earlier ones are kept (FILE with .1 to .5 before its
  /// ending).
  std::optional<std::filesystem::path> file;
};

/// Takes the place of the program's log. A sentence when the file cannot be written.
std::optional<std::string> set_up_log(const LogOptions& options);

}  // namespace spectra::app
