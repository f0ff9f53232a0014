#include "fusion/registry.hpp"

#include <vector>

/// Every fusion method, one line each, in the order a person should see them. methods/<id>.cpp defines the function
/// of that name.
#define SPECTRA_FUSION_METHODS(METHOD) \
  METHOD(thermal_only)                 \
  METHOD(visible_only)                 \
  METHOD(thermal_visible_blend)        \
  METHOD(monochrome_threshold)         \
  METHOD(colour_mapped_threshold)      \
  METHOD(thermal_highlighting)         \
  METHOD(intensity_hue)                \
  METHOD(inverse_intensity_hue)        \
  METHOD(histogram_bin)                \
  METHOD(histogram_distribution)       \
  METHOD(thermal_change)

namespace spectra::fusion {
namespace methods {
#define SPECTRA_DECLARE(id) Method id();
SPECTRA_FUSION_METHODS(SPECTRA_DECLARE)
#undef SPECTRA_DECLARE
}  // namespace methods

std::span<const Method* const> all_methods() {
#define SPECTRA_CALL(id) methods::id(),
  static const std::vector<Method> list = {SPECTRA_FUSION_METHODS(SPECTRA_CALL)};
#undef SPECTRA_CALL
  static const std::vector<const Method*> pointers = [] {
    std::vector<const Method*> result;
    for (const Method& method : list) result.push_back(&method);
    return result;
  }();
  return pointers;
}

const Method* find_method(std::string_view id) {
  for (const Method* method : all_methods()) {
    if (method->id == id) return method;
  }
  return nullptr;
}

}  // namespace spectra::fusion
