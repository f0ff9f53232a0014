#pragma once

namespace spectra::stream {

/// The knobs of PROTOCOL quality.set, as in force.
///
/// In automatic mode colour_bits and pixel_error are what a viewer gets in the end. Each change of the settings is first
/// answered at the finest point of a frontier (coarser colours, then larger pixel errors) that is expected to arrive
/// within latency_target_ms at the measured rate; when that is delivered and nothing newer has come, the rest follows.
struct StreamQuality {
  bool automatic = false;
  float position_step_m = 0;  ///< Always a lattice_step(); 0 = the scene's suggestion.
  int colour_bits = 8;
  double pixel_error = 1;
  int encoder_speed = 7;
  double latency_target_ms = 200;
  bool marks = false;  ///< Where the method highlights something, colours carry which vertices.
  friend bool operator==(const StreamQuality&, const StreamQuality&) = default;
};

/// The largest step <= `wanted_m` of the form m * 2^e with m in 4..7, so that lattice * step is exact in float.
float lattice_step(double wanted_m);

}  // namespace spectra::stream
