#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/net/net_options.hpp"

namespace spectra::net {

/// A bound that can be set from outside, as people see it.
struct LimitLine {
  std::string name;
  std::string value;  ///< With its unit, such as 64 kB or 9.5 s.
  std::string help;
};

/// All of them, with their values in `limits`.
std::vector<LimitLine> limit_lines(const NetLimits& limits);

/// Sets one from NAME=VALUE: bytes as 4096, 64kB or 2MB (of 1000), times in seconds, others as numbers. A sentence when it is none, which
/// names what there is or between which values it may be.
std::optional<std::string> set_limit(NetLimits& limits, std::string_view text);

}  // namespace spectra::net
