#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "fusion/base/error.hpp"
#include "server/sources/map_keeper.hpp"

namespace spectra::sources {

/// What a query says of a block: observed_at, sensor, and the reading options of the command line with underscores. WrongType,
/// OutOfRange or UnknownParameter, naming the field.
base::Result<IncomingBlock> incoming_block(std::string id,
                                           const std::vector<std::pair<std::string, std::string>>& query);

/// A field that stands in a query more than once and may not (no_data may); nothing when there is none.
std::optional<std::string> repeated_field(const std::vector<std::pair<std::string, std::string>>& query);

/// Between which values a field of a query may be, for people; empty where nothing is to be said.
std::string limits_of(std::string_view field);

/// The other way round: what a query says of reading options.
std::vector<std::pair<std::string, std::string>> query_of(const files::ReadOptions& read);

/// The same from the text that it keeps of its reading options.
base::Result<IncomingBlock> incoming_block(std::string id, const std::string& read_text);

}  // namespace spectra::sources
