#pragma once

#include <array>

#include "fusion/base/vertex_types.hpp"

namespace spectra::fusion {

/// CIELAB under D65: L* in 0..100, a*, b*.
using Lab = std::array<double, 3>;

/// CIELAB of an sRGB colour whose channels are sRGB-encoded, 0..255, real-valued (IEC 61966-2-1, D65 white).
Lab lab_of(const std::array<double, 3>& srgb);
Lab lab_of(base::Rgb8 colour);

/// CIEDE2000 colour difference with kL = kC = kH = 1 (CIE 142-2001; formulation of Sharma, Wu and Dalal 2005). About 1 is
/// just noticeable.
double ciede2000(const Lab& first, const Lab& second);

}  // namespace spectra::fusion
