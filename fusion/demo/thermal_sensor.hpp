#pragma once

#include <cstdint>
#include <vector>

#include "fusion/demo/scan_view.hpp"

namespace spectra::demo {

/// The thermal cameras of the demo scene: a few views of 384 x 288 pixels with the faults of a real sensor (point
/// spread, noise of 50 mK, quantisation, a drift from view to view), taken of a stand-in of the scene.
class ThermalSensor {
 public:
  ThermalSensor(const SurfaceMesh& stand_in, std::uint64_t seed);

  /// What the views measured at this point, weighted by how well each sees it; NaN where none does.
  float celsius_at(Vec position, Vec normal) const;

 private:
  struct View {
    ScanView depth;  ///< Finer than the picture.
    std::vector<float> celsius;
  };
  std::vector<View> views_;
};

}  // namespace spectra::demo
