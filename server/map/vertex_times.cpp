#include "server/map/vertex_times.hpp"

#include <algorithm>
#include <cmath>

namespace spectra::map {

VertexTimes VertexTimes::of(std::span<const double> times) {
  VertexTimes made;
  const auto is_before = [](double a, double b) { return a < b || (std::isnan(b) && !std::isnan(a)); };
  const auto is_same = [](double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  for (std::size_t v = 0; v < times.size(); ++v) {
    // Neighbours mostly are of one block.
    if (v == 0 || !is_same(times[v], times[v - 1])) made.distinct.push_back(times[v]);
  }
  std::sort(made.distinct.begin(), made.distinct.end(), is_before);
  made.distinct.erase(std::unique(made.distinct.begin(), made.distinct.end(), is_same), made.distinct.end());
  if (made.distinct.size() == 1 && std::isnan(made.distinct[0])) made.distinct.clear();
  if (made.distinct.size() < 2) return made;
  made.of_vertex.reserve(times.size());
  for (const double time : times) {
    const auto place = std::lower_bound(made.distinct.begin(), made.distinct.end(), time, is_before);
    made.of_vertex.push_back(static_cast<std::uint32_t>(place - made.distinct.begin()));
  }
  return made;
}

}  // namespace spectra::map
