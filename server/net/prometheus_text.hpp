#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace spectra::net {

/// One number, or one distribution, for /metrics.
struct Metric {
  std::string name;
  std::string help;
  double value = 0;
  bool is_counter = false;  ///< Only ever rises; its name ends in _total.
  std::string label_name;   ///< Empty: no label.
  std::string label_value;

  /// How often values were up to each bound, and beyond the last.
  struct Distribution {
    std::vector<double> bounds;
    std::vector<std::uint64_t> counts;  ///< One more than bounds; not cumulative.
    double sum = 0;
  };
  std::optional<Distribution> distribution = {};  ///< Instead of the value.
};

/// The metrics in the text format of Prometheus. Those of one name, which differ in their label, stand one after the other.
std::string prometheus_text(std::span<const Metric> metrics);

}  // namespace spectra::net
