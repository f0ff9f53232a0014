#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/settings.hpp"

namespace spectra::session {

/// Fusion settings as a person writes them: on the command line and in the query of an export. What is absent has its
/// default.
struct SettingsText {
  std::optional<std::string> method{};
  std::vector<std::pair<std::string, std::string>> params{};  ///< name, value; a later one of the same name wins.
  std::optional<std::string> palette{};
  std::optional<std::string> range{};    ///< As range_from_text() reads it.
  std::optional<std::string> missing{};  ///< "visible" or "#rrggbb".
};

/// The settings of the text, or an Error that names the field and what would be accepted.
base::Result<fusion::FusionSettings> settings_from_text(const SettingsText& text);

/// "auto", "LO:HI" in degC, "percentile" or "percentile:LO:HI" in percent.
base::Result<fusion::RangeSetting> range_from_text(std::string_view text);

/// "visible" or "#rrggbb".
base::Result<fusion::MissingDisplay> missing_from_text(std::string_view text);

/// The inverse of missing_from_text.
std::string missing_to_text(const fusion::MissingDisplay& missing);

}  // namespace spectra::session
