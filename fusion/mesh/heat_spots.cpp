#include "fusion/mesh/heat_spots.hpp"

#include <cmath>
#include <utility>

namespace spectra::mesh {
namespace {

/// Grows the spot around one vertex; empty when the vertex is not its apex, or it is too large.
class SpotSearch {
 public:
  SpotSearch(const Surface& surface, std::span<const float> temperature, std::span<const double> area, double contrast,
             double most_area)
      : surface_(surface),
        temperature_(temperature),
        area_(area),
        contrast_(contrast),
        most_area_(most_area),
        visited_in_(temperature.size()) {}

  /// `sign` 1: hot, -1: cold.
  HeatSpot spot_at(std::uint32_t apex, float sign) {
    ++search_;
    const float peak = sign * temperature_[apex];
    const double floor = static_cast<double>(peak) - contrast_;
    HeatSpot spot{apex, {apex}, 0};
    visited_in_[apex] = search_;
    bool has_surroundings = false;
    for (std::size_t next = 0; next < spot.members.size(); ++next) {
      const std::uint32_t v = spot.members[next];
      spot.area_m2 += area_[v];
      if (spot.area_m2 > most_area_) return {};
      for (const std::uint32_t t : surface_.triangles_around(v)) {
        for (const std::uint32_t w : surface_.triangles()[t]) {
          if (visited_in_[w] == search_) continue;
          visited_in_[w] = search_;
          const float other = sign * temperature_[w];
          if (other > peak || (other == peak && w < apex)) return {};
          if (static_cast<double>(other) > floor) {
            spot.members.push_back(w);
          } else if (!std::isnan(other)) {
            has_surroundings = true;
          }
        }
      }
    }
    return has_surroundings ? spot : HeatSpot{};
  }

 private:
  const Surface& surface_;
  std::span<const float> temperature_;
  std::span<const double> area_;
  double contrast_, most_area_;
  std::vector<std::uint32_t> visited_in_;
  std::uint32_t search_ = 0;
};

}  // namespace

std::vector<double> vertex_areas(const Surface& surface) {
  std::vector<double> areas(surface.positions().size());
  for (const base::Triangle& t : surface.triangles()) {
    const double third =
        triangle_area(surface.positions()[t[0]], surface.positions()[t[1]], surface.positions()[t[2]]) / 3;
    for (const std::uint32_t v : t) areas[v] += third;
  }
  return areas;
}

std::vector<HeatSpot> heat_spots(const Surface& surface, std::span<const float> temperature_celsius,
                                 std::span<const double> vertex_area_m2, double contrast_celsius, double most_area_m2) {
  std::vector<HeatSpot> spots;
  SpotSearch search(surface, temperature_celsius, vertex_area_m2, contrast_celsius, most_area_m2);
  for (std::uint32_t v = 0; v < temperature_celsius.size(); ++v) {
    if (std::isnan(temperature_celsius[v]) || surface.triangles_around(v).empty()) continue;
    for (const float sign : {1.0f, -1.0f}) {
      HeatSpot spot = search.spot_at(v, sign);
      if (!spot.members.empty()) spots.push_back(std::move(spot));
    }
  }
  return spots;
}

}  // namespace spectra::mesh
