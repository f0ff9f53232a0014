#pragma once

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

/// The other way round: what a query says of reading options.
std::vector<std::pair<std::string, std::string>> query_of(const files::ReadOptions& read);

/// The same from the text that it keeps of its reading options.
base::Result<IncomingBlock> incoming_block(std::string id, const std::string& read_text);

}  // namespace spectra::sources
