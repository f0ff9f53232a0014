#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace spectra::net {

/// A request target taken apart and decoded.
struct RequestTarget {
  std::string path;  ///< Begins with '/', percent-decoded once, without empty, "." or ".." segments.
  std::vector<std::pair<std::string, std::string>> query;  ///< In the order of the text, decoded.
};

/// Takes a request target apart. Nothing for what no client of ours sends: another form than "/path?query", bad percent
/// encoding, control characters, backslashes, "." and ".." segments (encoded ones too). Safe on untrusted input.
std::optional<RequestTarget> parsed_target(std::string_view target);

/// The other way round, without the first slash: what parsed_target reads again, after a slash.
std::string target_text(std::string_view path, const std::vector<std::pair<std::string, std::string>>& query);

}  // namespace spectra::net
