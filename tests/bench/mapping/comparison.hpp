#pragma once

#include <cstddef>
#include <vector>

#include "fusion/mesh/multispectral_mesh.hpp"
#include "server/mapping/surface_mesh.hpp"

namespace spectra::mapping {

/// How a map differs from what is known to be there. Metres and kelvin.
struct Comparison {
  std::size_t vertices = 0;
  double surface_median_m = 0, surface_rmse_m = 0, surface_beyond_50mm = 0;
  std::size_t temperatures = 0;  ///< Vertices with one whose surface is known to 5 cm.
  double heat_mean_error = 0;    ///< Of the absolute differences.
  double heat_p95 = 0, heat_rmse = 0;
  double heat_rmse_without_median = 0, heat_median = 0;
  double warm_p95 = 0;  ///< Of surfaces above 25 degC.
  std::size_t warm = 0;
  double within_two_sigma = 0;  ///< Share.
  double sigma_median = 0;
};

/// Compares every vertex with the nearest point of the truth, at most half a metre away; farther ones count as half a metre. Temperatures of
/// vertices beyond 5 cm count in nothing.
Comparison compare(const mapping::UnitMesh& mesh, const mesh::MultispectralMesh& truth);

/// Median, for example, is 0.5. 0 of nothing.
double quantile(std::vector<double> values, double share);

void print(const char* name, const Comparison& comparison);
void print_head();

}  // namespace spectra::mapping
