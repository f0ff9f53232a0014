#pragma once

#include <span>
#include <string>

namespace spectra::server {

/// One number for /metrics.
struct Metric {
  std::string name;
  std::string help;
  double value = 0;
  bool is_counter = false;  ///< Only ever rises; its name ends in _total.
  std::string label_name;   ///< Empty: no label.
  std::string label_value;
};

/// The metrics in the text format of Prometheus.
std::string prometheus_text(std::span<const Metric> metrics);

}  // namespace spectra::server
