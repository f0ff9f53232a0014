#include "tests/bench/fusion/scalar_loops.hpp"

namespace spectra::fusion::bench {

Loop opencv_composition(const Scene&, const FusionPlan&, const PaletteTable&) {
  return {};
}

}  // namespace spectra::fusion::bench
