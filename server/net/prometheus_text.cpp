#include "server/net/prometheus_text.hpp"

#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>

#include <utility>
#include <vector>

namespace spectra::server {

std::string prometheus_text(std::span<const Metric> metrics) {
  std::vector<prometheus::MetricFamily> families;
  families.reserve(metrics.size());
  for (const auto& metric : metrics) {
    prometheus::ClientMetric value;
    if (metric.is_counter) {
      value.counter.value = metric.value;
    } else {
      value.gauge.value = metric.value;
    }
    if (!metric.label_name.empty()) value.label.push_back({metric.label_name, metric.label_value});
    families.push_back({metric.name,
                        metric.help,
                        metric.is_counter ? prometheus::MetricType::Counter : prometheus::MetricType::Gauge,
                        {std::move(value)}});
  }
  return prometheus::TextSerializer().Serialize(families);
}

}  // namespace spectra::server
