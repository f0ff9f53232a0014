#include "comparison.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "fusion/mesh/nearest_surface.hpp"

namespace spectra::mapping {

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

Comparison compare(const mapping::UnitMesh& mesh, const mesh::MultispectralMesh& truth) {
  constexpr double kFarthest = 0.5, kSameSurface = 0.05, kWarm = 25;
  const mesh::NearestSurface surface(truth.positions(), truth.triangles());
  Comparison found;
  found.vertices = mesh.positions.size();
  std::vector<double> distances, differences, absolute, warm, sigmas;
  std::size_t within = 0;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const base::Vec3f& p = mesh.positions[i];
    const base::Vec3f at{static_cast<float>(static_cast<double>(p.x) - truth.origin.x),
                         static_cast<float>(static_cast<double>(p.y) - truth.origin.y),
                         static_cast<float>(static_cast<double>(p.z) - truth.origin.z)};
    const auto hit = surface.find(at, kFarthest);
    distances.push_back(hit ? hit->distance : kFarthest);
    if (!hit || hit->distance > kSameSurface || std::isnan(mesh.celsius[i])) continue;
    double celsius = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      celsius += hit->weights[k] * static_cast<double>(truth.temperature_celsius()[hit->corners[k]]);
    }
    if (!std::isfinite(celsius)) continue;
    const double difference = static_cast<double>(mesh.celsius[i]) - celsius;
    const auto sigma = static_cast<double>(mesh.sigma_kelvin[i]);
    differences.push_back(difference);
    absolute.push_back(std::abs(difference));
    sigmas.push_back(sigma);
    if (celsius > kWarm) warm.push_back(std::abs(difference));
    if (std::abs(difference) <= 2 * sigma) ++within;
  }
  const auto root_mean_square = [](const std::vector<double>& values, double from) {
    double sum = 0;
    for (const double v : values) sum += (v - from) * (v - from);
    return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
  };
  found.surface_median_m = quantile(distances, 0.5);
  found.surface_rmse_m = root_mean_square(distances, 0);
  found.surface_beyond_50mm =
      static_cast<double>(std::count_if(distances.begin(), distances.end(), [](double d) { return d > 0.05; })) /
      static_cast<double>(std::max<std::size_t>(1, distances.size()));
  found.temperatures = differences.size();
  for (const double d : absolute) found.heat_mean_error += d / static_cast<double>(absolute.size());
  found.heat_p95 = quantile(absolute, 0.95);
  found.heat_rmse = root_mean_square(differences, 0);
  found.heat_median = quantile(differences, 0.5);
  found.heat_rmse_without_median = root_mean_square(differences, found.heat_median);
  found.warm = warm.size();
  found.warm_p95 = quantile(warm, 0.95);
  found.within_two_sigma =
      static_cast<double>(within) / static_cast<double>(std::max<std::size_t>(1, differences.size()));
  found.sigma_median = quantile(sigmas, 0.5);
  return found;
}

void print_head() {
  std::printf("%-34s %9s %7s %7s %6s | %9s %6s %6s %6s %6s %6s %7s %6s\n", "", "vertices", "median", "RMSE", ">50mm",
              "with heat", "MAE", "p95", "RMSE", "RMSE-m", "warm95", "in 2 s", "sigma");
}

void print(const char* name, const Comparison& c) {
  std::printf("%-34s %9zu %5.2fmm %5.1fmm %5.2f%% | %9zu %6.3f %6.3f %6.3f %6.3f %6.2f %6.1f%% %6.3f\n", name,
              c.vertices, 1000 * c.surface_median_m, 1000 * c.surface_rmse_m, 100 * c.surface_beyond_50mm,
              c.temperatures, c.heat_mean_error, c.heat_p95, c.heat_rmse, c.heat_rmse_without_median, c.warm_p95,
              100 * c.within_two_sigma, c.sigma_median);
  std::fflush(stdout);
}

}  // namespace spectra::mapping
