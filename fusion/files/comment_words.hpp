#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace spectra::files {

/// The words and numbers of a line "comment ..." or "obj_info ...", without that beginning, in lower case. ':' and '=' become
/// "="; a comma or semicolon between words becomes "," and parts them; brackets and full stops vanish; the sign for micro becomes "u". A sign belongs to what follows it,
/// except behind a letter, where '-' and '_' only part words.
std::vector<std::string> comment_words(std::string_view line);

}  // namespace spectra::files
