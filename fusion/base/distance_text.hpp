#pragma once

#include <string>

namespace spectra::base {

/// A distance in metres for people: three digits, and kilometres from 1000 m on (with an exponent from a million of them on).
std::string distance_text(double metres);

}  // namespace spectra::base
