#pragma once

#include <string>

#include "server/app/served_scene.hpp"
#include "server/net/net_metrics.hpp"

namespace spectra::server {

/// Everything that is counted, in the text format of Prometheus.
std::string metrics_text(const ServedScene& served, const NetMetrics& net);

}  // namespace spectra::server
