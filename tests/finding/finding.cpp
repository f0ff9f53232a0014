#include "tests/finding/finding.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

#include "fusion/colour/colour_difference.hpp"

namespace spectra::fusion::test {
namespace {

constexpr double kChanged = 10;  // CIEDE2000

double triangle_area(base::Vec3f a, base::Vec3f b, base::Vec3f c) {
  const std::array u = {double{b.x} - double{a.x}, double{b.y} - double{a.y}, double{b.z} - double{a.z}};
  const std::array v = {double{c.x} - double{a.x}, double{c.y} - double{a.y}, double{c.z} - double{a.z}};
  return std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]) / 2;
}

float median_of(std::span<const float> temperature) {
  std::vector<float> finite;
  std::ranges::copy_if(temperature, std::back_inserter(finite), [](float t) { return std::isfinite(t); });
  if (finite.empty()) return 0;
  const auto middle = finite.begin() + static_cast<std::ptrdiff_t>(finite.size() / 2);
  std::nth_element(finite.begin(), middle, finite.end());
  return *middle;
}

/// Hue may be chosen against the scene, and percentiles need a histogram.
fusion::SceneTemperature facts_of(const mesh::MultispectralMesh& mesh) {
  fusion::TemperatureAccumulator accumulator;
  accumulator.add(mesh.temperature_celsius());
  fusion::SceneTemperature facts;
  facts.summary = accumulator.summary();
  facts.histogram = [&mesh, summary = facts.summary](std::uint32_t bins) {
    fusion::Histogram histogram{summary.minimum, summary.maximum, std::vector<std::uint64_t>(bins)};
    fusion::add_to_histogram(mesh.temperature_celsius(), histogram);
    return histogram;
  };
  facts.hues = [&mesh] {
    fusion::Hues hues;
    fusion::add_to_hues(mesh.visible(), hues);
    return hues;
  };
  return facts;
}

}  // namespace

Surface::Surface(mesh::MultispectralMesh scene)
    : mesh(std::move(scene)), area(mesh.vertex_count()), neighbours(mesh.vertex_count()), facts(facts_of(mesh)) {
  const auto positions = mesh.positions();
  for (const base::Triangle& triangle : mesh.triangles()) {
    const double part = triangle_area(positions[triangle[0]], positions[triangle[1]], positions[triangle[2]]) / 3;
    for (unsigned corner = 0; corner < 3; ++corner) {
      area[triangle[corner]] += part;
      neighbours[triangle[corner]].push_back(triangle[(corner + 1) % 3]);
      neighbours[triangle[corner]].push_back(triangle[(corner + 2) % 3]);
    }
  }
}

Thing thing_from(const Surface& surface, std::string name, std::vector<std::uint8_t> is_part) {
  Thing thing{std::move(name), std::move(is_part), {}};
  for (std::size_t v = 0; v < thing.is_part.size(); ++v) {
    if (std::isnan(surface.mesh.temperature_celsius()[v])) thing.is_part[v] = 0;
  }
  thing.is_ring.resize(thing.is_part.size());
  double area = 0;
  for (std::size_t v = 0; v < thing.is_part.size(); ++v) area += thing.is_part[v] != 0 ? surface.area[v] : 0;
  const double radius = std::sqrt(area / std::numbers::pi);
  const double reach = 1.5 * radius;
  if (!(reach > 0)) return thing;
  // The vertices of the thing by cells as large as the ring is wide, so that a vertex looks into its own and the next ones.
  using Cell = std::array<std::int64_t, 3>;
  const auto positions = surface.mesh.positions();
  const auto cell_of = [&](base::Vec3f p) {
    return Cell{static_cast<std::int64_t>(std::floor(double{p.x} / reach)),
                static_cast<std::int64_t>(std::floor(double{p.y} / reach)),
                static_cast<std::int64_t>(std::floor(double{p.z} / reach))};
  };
  std::map<Cell, std::vector<std::uint32_t>> cells;
  for (std::uint32_t v = 0; v < thing.is_part.size(); ++v) {
    if (thing.is_part[v] != 0) cells[cell_of(positions[v])].push_back(v);
  }
  const auto squared_distance_to_thing = [&](std::uint32_t v) {
    double nearest = std::numeric_limits<double>::infinity();
    const Cell middle = cell_of(positions[v]);
    for (std::int64_t step = 0; step < 27; ++step) {
      const auto found = cells.find({middle[0] + step % 3 - 1, middle[1] + step / 3 % 3 - 1, middle[2] + step / 9 - 1});
      if (found == cells.end()) continue;
      for (const std::uint32_t other : found->second) {
        const double dx = double{positions[v].x} - double{positions[other].x};
        const double dy = double{positions[v].y} - double{positions[other].y};
        const double dz = double{positions[v].z} - double{positions[other].z};
        nearest = std::min(nearest, dx * dx + dy * dy + dz * dz);
      }
    }
    return nearest;
  };
  for (std::uint32_t v = 0; v < thing.is_part.size(); ++v) {
    if (thing.is_part[v] != 0) continue;
    const double squared = squared_distance_to_thing(v);
    thing.is_ring[v] = squared > radius * radius / 4 && squared <= reach * reach ? 1 : 0;
  }
  return thing;
}

std::vector<Thing> hottest_things(const Surface& surface, std::size_t count) {
  const auto temperature = surface.mesh.temperature_celsius();
  const float median = median_of(temperature);
  std::vector<std::uint8_t> is_taken(temperature.size());
  std::vector<Thing> things;
  while (things.size() < count) {
    std::optional<std::uint32_t> hottest;
    for (std::uint32_t v = 0; v < temperature.size(); ++v) {
      if (is_taken[v] != 0 || !std::isfinite(temperature[v])) continue;
      if (!hottest || temperature[v] > temperature[*hottest]) hottest = v;
    }
    if (!hottest) break;
    const float limit = median / 2 + temperature[*hottest] / 2;
    std::vector<std::uint8_t> is_part(temperature.size());
    std::vector<std::uint32_t> open = {*hottest};
    is_part[*hottest] = 1;
    std::size_t size = 0;
    while (!open.empty()) {
      const std::uint32_t v = open.back();
      open.pop_back();
      ++size;
      for (const std::uint32_t neighbour : surface.neighbours[v]) {
        if (is_part[neighbour] != 0 || !(temperature[neighbour] > limit)) continue;
        is_part[neighbour] = 1;
        open.push_back(neighbour);
      }
    }
    for (std::size_t v = 0; v < is_part.size(); ++v) is_taken[v] |= is_part[v];
    // A handful of vertices is noise, or a splinter of what was taken before.
    if (size * 2000 < temperature.size()) continue;
    // The slope of what was found is not another thing.
    const bool touches = std::ranges::any_of(things, [&](const Thing& other) {
      for (std::uint32_t v = 0; v < is_part.size(); ++v) {
        if (is_part[v] == 0) continue;
        for (const std::uint32_t neighbour : surface.neighbours[v]) {
          if (other.is_part[neighbour] != 0) return true;
        }
      }
      return false;
    });
    if (!touches) things.push_back(thing_from(surface, "hot " + std::to_string(things.size() + 1), std::move(is_part)));
  }
  return things;
}

std::vector<Finding> findings(const Surface& surface, const fusion::FusionPlan& plan,
                              const std::vector<Thing>& things) {
  const std::size_t count = surface.mesh.vertex_count();
  std::vector<base::Rgb8> fused(count);
  plan.fuse(surface.mesh.temperature_celsius(), surface.mesh.visible(), fused);
  std::vector<std::uint8_t> has_changed(count);
  for (std::size_t v = 0; v < count; ++v) {
    const base::Rgb8 seen = surface.mesh.visible()[v];
    has_changed[v] =
        fused[v] != seen && fusion::ciede2000(fusion::lab_of(fused[v]), fusion::lab_of(seen)) >= kChanged ? 1 : 0;
  }
  // Share of the surface of some vertices that has changed.
  const auto changed = [&](auto is_in) {
    double all = 0, marked = 0;
    for (std::size_t v = 0; v < count; ++v) {
      if (!is_in(v)) continue;
      all += surface.area[v];
      if (has_changed[v] != 0) marked += surface.area[v];
    }
    return all > 0 ? marked / all : 0;
  };
  const auto mean_colour = [&](const std::vector<std::uint8_t>& is_in) {
    fusion::Lab sum{};
    double all = 0;
    for (std::size_t v = 0; v < count; ++v) {
      if (is_in[v] == 0) continue;
      const fusion::Lab colour = fusion::lab_of(fused[v]);
      for (std::size_t c = 0; c < 3; ++c) sum[c] += surface.area[v] * colour[c];
      all += surface.area[v];
    }
    for (double& channel : sum) channel /= std::max(all, 1e-300);
    return sum;
  };
  const double rest = changed([&](std::size_t v) {
    return std::ranges::none_of(things, [v](const Thing& thing) { return thing.is_part[v] != 0; });
  });
  std::vector<Finding> result;
  for (const Thing& thing : things) {
    const bool has_ring = std::ranges::find(thing.is_ring, 1) != thing.is_ring.end();
    result.push_back({changed([&](std::size_t v) { return thing.is_part[v] != 0; }), rest,
                      has_ring ? fusion::ciede2000(mean_colour(thing.is_part), mean_colour(thing.is_ring)) : 0});
  }
  return result;
}

fusion::FusionPlan first_view_plan(const Surface& surface, const std::string& method,
                                   const fusion::ParameterValues& params) {
  fusion::FusionChange change;
  change.method = method;
  change.params = params;
  const auto settings = fusion::with_change(fusion::first_view_settings(surface.facts.summary), change).value();
  return fusion::FusionPlan::prepare(settings, surface.facts).value();
}

}  // namespace spectra::fusion::test
