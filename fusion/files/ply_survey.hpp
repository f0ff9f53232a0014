#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/base/vertex_types.hpp"
#include "fusion/files/block_file.hpp"
#include "fusion/files/ply_header.hpp"
#include "fusion/files/ply_schema.hpp"
#include "fusion/files/read_options.hpp"
#include "fusion/files/vertex_colour.hpp"
#include "fusion/files/vertex_temperature.hpp"

namespace spectra::files {

/// What the values of a PLY file tell that its header does not, for the few files whose reading depends on it: how far
/// their colours go, whether a doubtful property is a temperature, and what the faces around a vertex carry.
struct PlySurvey {
  /// Of the colours that are neither bytes nor packed.
  ColourRange colour_range;

  /// Of a doubtful temperature: what was seen of it.
  double least_doubtful = std::numeric_limits<double>::infinity();
  double most_doubtful = -std::numeric_limits<double>::infinity();
  bool is_temperature_plausible = true;

  /// The mean over the faces of each vertex, when the faces have colours or temperatures: mid grey and NaN without any.
  std::vector<base::Rgb8> face_colours;
  std::vector<float> face_temperature_celsius;
  TemperatureFacts face_temperature;
  std::uint64_t clamped_colour_count = 0;  ///< Vertices.
};

/// The type that colours must have which are declared as uchar but hold other numbers in the first vertices of a text: a
/// floating one, or one of 16 bits; nullopt: they are as declared, or nothing can be told. Moves the file.
std::optional<PlyScalar> true_colour_type(BlockFile& file, const PlyHeader& header, const PlySchema& schema);

/// Why the positions of a binary file make no sense: they begin some bytes later, or their bytes are the other way round. Empty:
/// they do, as far as the beginning of the file tells, or no reason is known. Moves the file.
std::string misplaced_positions(BlockFile& file, const PlyHeader& header, const PlySchema& schema);

/// The file's values must be looked at before they are read.
bool needs_survey(const PlyHeader& header, const PlySchema& schema);

/// One reading of the body. Memory is constant, but for files whose faces have colours (16 bytes a vertex) or temperatures
/// (12 bytes a vertex).
base::Result<PlySurvey> ply_survey(BlockFile& file, const PlyHeader& header, const PlySchema& schema,
                                   const ReadOptions& options);

}  // namespace spectra::files
