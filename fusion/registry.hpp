#pragma once

#include <span>
#include <string_view>

#include "fusion/method.hpp"

namespace spectra::fusion {

/// All fusion methods, in the order a person should see them.
std::span<const Method* const> all_methods();

/// The method of that id, or nullptr.
const Method* find_method(std::string_view id);

}  // namespace spectra::fusion
