// Visible only: the picture of the colour camera, untouched.
//
//   F = V
//
// Source: the visible modality as the paper's figures show it. Cost: a copy.
// Missing temperature: the visible colour always; a fixed colour for missing temperature is not applied, because
// temperature plays no part in this picture.

#include <algorithm>

#include "fusion/parameter_schema.hpp"

namespace spectra::fusion::methods {
namespace {

struct VisibleOnly {};

class Copy final : public Kernel {
 public:
  void fuse(std::span<const float>, std::span<const Rgb8> visible, std::span<Rgb8> fused) const noexcept override {
    std::copy(visible.begin(), visible.end(), fused.begin());
  }
};

PreparedMethod prepare(const VisibleOnly&, const MethodContext&) {
  return {std::make_shared<Copy>(), {}};
}

}  // namespace

Method visible_only() {
  Method method;
  method.id = "visible_only";
  method.label = "Visible only";
  method.summary = "The visible picture as the colour camera saw it.";
  method.needs_temperature = false;
  method.uses_palette = false;
  return make_method(std::move(method), ParameterSchema<VisibleOnly>{}, &prepare);
}

}  // namespace spectra::fusion::methods
