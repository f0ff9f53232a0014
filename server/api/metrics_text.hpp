#pragma once

#include <string>

#include "server/net/net_metrics.hpp"
#include "server/session/served_scene.hpp"
#include "server/sources/map_keeper.hpp"

namespace spectra::api {

/// Everything that is counted, in the text format of Prometheus.
std::string metrics_text(const session::ServedScene& served, const sources::MapKeeper& map, const net::NetMetrics& net);

}  // namespace spectra::api
