#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/files/ply_header.hpp"
#include "fusion/files/read_options.hpp"

namespace spectra::files {

/// What a property means to us.
enum PlySlot : std::size_t { kX, kY, kZ, kRed, kGreen, kBlue, kTemperature, kSigma, kSeen, kSlotCount };

/// Slot -> index of the element's property.
using PlySlots = std::array<std::optional<std::size_t>, kSlotCount>;

/// How a file has its colours.
enum class ColourCoding {
  Channels,  ///< Three numbers from 0 up to some largest value.
  Packed,    ///< One number, 0xRRGGBB, possibly as the bits of a float; all three slots are the same property.
  Splat,     ///< The first coefficients of spherical harmonics, as Gaussian splats have them.
};

/// What the header of a PLY file promises that is of use here.
struct PlySchema {
  PlySlots vertex;
  /// Colours and temperature of the faces, when the vertices have none.
  PlySlots face;
  ColourCoding colour_coding = ColourCoding::Channels;
  /// The colours have names that are customary nowhere, but say what they are; or the options name them.
  bool has_unusual_colour_names = false;
  /// The type that the vertices' colours of a text really have, where they are declared as uchar but hold something else.
  std::optional<PlyScalar> true_colour_type;
  /// The temperature is a property of a name that says too little: its values must be looked at.
  bool is_temperature_doubtful = false;
  std::optional<std::size_t> corner_list;  ///< Of the element face, when it has entries.
  std::optional<std::size_t> strip_list;   ///< Of the element tristrips, when it has entries.

  bool has_vertex_colours() const { return vertex[kRed].has_value(); }
  bool has_face_colours() const { return face[kRed].has_value(); }
  bool has_vertex_temperature() const { return vertex[kTemperature].has_value(); }
  bool has_confidence() const { return vertex[kSigma].has_value(); }
  bool has_face_temperature() const { return face[kTemperature].has_value(); }
};

/// Finds what is of use. BadHeader, or Unsupported when the options name properties that are not there.
base::Result<PlySchema> ply_schema(const PlyHeader& header, const ReadOptions& options);

}  // namespace spectra::files
