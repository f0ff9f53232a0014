#pragma once

#include <string>

#include "server/net/net_metrics.hpp"
#include "server/session/served_scene.hpp"

namespace spectra::server {

/// Everything that is counted, in the text format of Prometheus.
std::string metrics_text(const ServedScene& served, const NetMetrics& net);

}  // namespace spectra::server
