#include "server/stream/quality_frontier.hpp"

#include <algorithm>

namespace spectra::stream {
namespace {

constexpr std::array<QualityPoint, 8> kFrontier{{{1, 8}, {1, 7}, {1, 6}, {2, 6}, {4, 6}, {8, 6}, {16, 6}, {16, 5}}};
constexpr std::array<double, 9> kPlainCost{0, 0, 0, 0, 0.45, 0.70, 1.14, 1.45, 1.78};
constexpr std::array<double, 9> kSubtractGreenCost{0, 0, 0, 0, 0.44, 0.62, 0.83, 1.11, 1.43};
constexpr std::size_t kFewestVerticesToLearnFrom = 1000;  // Below, the frame is mostly its fixed part.
constexpr double kLearningRate = 0.1;

}  // namespace

std::span<const QualityPoint> quality_frontier() {
  return kFrontier;
}

ColourCost::ColourCost(protocol::ColourTransform transform)
    : bytes_per_vertex_(transform == protocol::ColourTransform::None ? kPlainCost : kSubtractGreenCost) {}

void ColourCost::learn(int colour_bits, std::size_t vertex_count, std::size_t payload_bytes) {
  if (vertex_count < kFewestVerticesToLearnFrom) return;
  double& known = bytes_per_vertex_[static_cast<std::size_t>(std::clamp(colour_bits, 4, 8))];
  known += kLearningRate * (static_cast<double>(payload_bytes) / static_cast<double>(vertex_count) - known);
}

double ColourCost::bytes_per_vertex(int colour_bits) const {
  return bytes_per_vertex_[static_cast<std::size_t>(std::clamp(colour_bits, 4, 8))];
}

QualityPoint first_answer(const StreamQuality& quality, double rate_bytes_per_s, double round_trip_s,
                          const ColourCost& cost,
                          const std::function<std::uint64_t(double pixel_error)>& target_vertex_count) {
  QualityPoint answer{.pixel_error_factor = 1, .colour_bits = quality.colour_bits};
  if (!quality.automatic || rate_bytes_per_s <= 0) return answer;
  for (const QualityPoint& point : quality_frontier()) {
    answer = {point.pixel_error_factor, std::min(point.colour_bits, quality.colour_bits)};
    const double bytes = static_cast<double>(target_vertex_count(quality.pixel_error * answer.pixel_error_factor)) *
                         cost.bytes_per_vertex(answer.colour_bits);
    if ((bytes / rate_bytes_per_s + round_trip_s) * 1e3 <= quality.latency_target_ms) break;
  }
  return answer;
}

}  // namespace spectra::stream
