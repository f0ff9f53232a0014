#pragma once

#include "fusion/colour/palette.hpp"

namespace spectra::fusion {

/// Published tables, kept with their decimals; each file in colour/data names its origin and licence.
extern const PaletteTable kInfernoTable;
extern const PaletteTable kMagmaTable;
extern const PaletteTable kPlasmaTable;
extern const PaletteTable kViridisTable;
extern const PaletteTable kCividisTable;
extern const PaletteTable kTurboTable;

}  // namespace spectra::fusion
