#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "fusion/base/vertex_types.hpp"
#include "fusion/mesh/surface.hpp"

namespace spectra::mesh {

/// A surface with what is seen on it, and what of it must stay.
struct SimplifyInput {
  const Surface& surface;  ///< Without degenerate triangles.
  std::span<const base::Rgb8> visible;
  std::span<const float> temperature_celsius;  ///< NaN = none, infinite = beyond what the sensor can tell.
  const std::vector<bool>& is_locked;          ///< Stays, as it is.
  double span_celsius = 1;                     ///< A difference that counts as much as one between black and white.
};

/// Fewer triangles over the same vertices. Values count at vertices that are used.
struct Simplified {
  std::vector<base::Triangle> triangles;
  std::vector<base::Rgb8> visible;
  std::vector<float> temperature_celsius;
};

/// The large arrays of a simplification. Asking the system for them takes a fifth of its time, so they are used again.
class SimplifyArrays {
 public:
  SimplifyArrays();
  ~SimplifyArrays();
  SimplifyArrays(SimplifyArrays&&) noexcept;
  SimplifyArrays& operator=(SimplifyArrays&&) noexcept;

  struct State;
  State& state() { return *state_; }

 private:
  std::unique_ptr<State> state_;
};

/// Arrays for as many simplifications as go on at a time; kept until they are cleared. Thread-safe.
class SimplifyMemory {
 public:
  SimplifyArrays take();
  void give_back(SimplifyArrays arrays);
  void clear();

 private:
  std::mutex mutex_;
  std::vector<SimplifyArrays> free_;
};

/// Draws vertices into neighbours, always where that changes the least of form, colour and temperature together, until about
/// `wanted_count` are left.
///
/// The change is measured by quadrics: squared distances from the planes of the triangles that a vertex stands for, and
/// squared differences from colour and temperature as these triangles spread them, weighted by area. Full contrast weighs as
/// much as a shift by half the mean distance of the vertices that are left. What remains takes the colour and the temperature that fit
/// what it stands for best. Open edges are drawn along themselves alone; where sheets meet nothing moves; topology does not
/// change.
///
/// A hot or cold spot that stands out from all around it by at least a sixteenth of `span_celsius` counts as much as
/// what one vertex will stand for, however small it is, and its apex keeps its temperature: it is still there, and its
/// surroundings are not warmer for it.
Simplified simplified(const SimplifyInput& input, std::size_t wanted_count, SimplifyMemory& memory);

}  // namespace spectra::mesh
