#include "tests/bench/fusion/scalar_loops.hpp"

namespace spectra::fusion::bench {

Loop opencv_composition(const Scene&, const fusion::FusionPlan&, const fusion::PaletteTable&) {
  return {};
}

}  // namespace spectra::fusion::bench
