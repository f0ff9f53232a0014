#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "fusion/fusion_plan.hpp"
#include "fusion/parameter.hpp"

namespace spectra::fusion {

/// A fusion method as the rest of Spectra sees it. The id and the parameter names are wire and command line names.
struct Method {
  std::string id;
  std::string label;
  std::string summary;  ///< One line for a list.
  std::vector<Parameter> parameters;
  bool needs_temperature = true;
  bool uses_palette = true;
};

}  // namespace spectra::fusion
