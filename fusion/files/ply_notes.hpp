#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "fusion/files/ply_stream.hpp"

namespace spectra::files {

/// "3 faces", "1 face".
std::string counted(std::uint64_t count, std::string_view one, std::string_view many);

/// What has to be said about a PLY file after a reading, for people: what was guessed, converted, repaired and left out. The
/// ids are listed in docs/input.md.
std::vector<Note> ply_notes(const PlyHeader& header, const PlyInterpretation& interpretation,
                            const ReadOptions& options, const PlyBodyFacts& facts);

}  // namespace spectra::files
