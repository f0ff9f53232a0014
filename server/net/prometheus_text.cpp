#include "server/net/prometheus_text.hpp"

#include <prometheus/metric_family.h>
#include <prometheus/text_serializer.h>

#include <limits>
#include <utility>
#include <vector>

namespace spectra::net {
namespace {

prometheus::ClientMetric::Histogram histogram_of(const Metric::Distribution& distribution) {
  prometheus::ClientMetric::Histogram histogram;
  histogram.sample_sum = distribution.sum;
  for (std::size_t i = 0; i < distribution.counts.size(); ++i) {
    histogram.sample_count += distribution.counts[i];
    const double bound =
        i < distribution.bounds.size() ? distribution.bounds[i] : std::numeric_limits<double>::infinity();
    histogram.bucket.push_back({histogram.sample_count, bound});
  }
  return histogram;
}

}  // namespace

std::string prometheus_text(std::span<const Metric> metrics) {
  std::vector<prometheus::MetricFamily> families;
  families.reserve(metrics.size());
  for (const auto& metric : metrics) {
    prometheus::ClientMetric value;
    if (metric.distribution) {
      value.histogram = histogram_of(*metric.distribution);
    } else if (metric.is_counter) {
      value.counter.value = metric.value;
    } else {
      value.gauge.value = metric.value;
    }
    if (!metric.label_name.empty()) value.label.push_back({metric.label_name, metric.label_value});
    if (families.empty() || families.back().name != metric.name) {
      const auto type = metric.distribution ? prometheus::MetricType::Histogram
                        : metric.is_counter ? prometheus::MetricType::Counter
                                            : prometheus::MetricType::Gauge;
      families.push_back({metric.name, metric.help, type, {}});
    }
    families.back().metric.push_back(std::move(value));
  }
  return prometheus::TextSerializer().Serialize(families);
}

}  // namespace spectra::net
