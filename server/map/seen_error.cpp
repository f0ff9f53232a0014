#include "server/map/seen_error.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "fusion/base/box.hpp"
#include "fusion/mesh/heat_spots.hpp"

namespace spectra::map {
namespace {

using base::Triangle;
using base::Vec3f;

constexpr std::size_t kLeafSamples = 1024;
constexpr std::size_t kMostSamples = 4096;
/// 95 % of the surface, and what chance may do to a share of the samples: 1.5 of its deviations, and no less than this.
constexpr double kShare = 0.95, kLeastMargin = 0.015;
/// A tile is looked at in up to so many parts (a power of two) along each axis, but not in those that hold a smaller share of its surface.
constexpr std::size_t kParts = 4;
constexpr double kLeastShare = 1.0 / 32;
/// Cells from a 1024th to an eighth of the tile.
constexpr int kFinestBits = 10, kCoarsestBits = 3;

std::array<double, 3> channels_of(const base::Rgb8& c) {
  return {static_cast<double>(c.r), static_cast<double>(c.g), static_cast<double>(c.b)};
}

Shown shown_at_vertex(const Tile& tile, std::uint32_t v) {
  return {channels_of(tile.visible[v]), static_cast<double>(tile.temperature_celsius[v])};
}

Shown shown_at(const Tile& tile, const mesh::Surface& surface, const base::Vec3f& p, std::uint32_t start) {
  if (surface.triangles().empty() || surface.triangles_around(start).empty()) return shown_at_vertex(tile, start);
  const base::Triangle& t = surface.triangles()[surface.triangle_near(p, start, 0).triangle];
  const auto weights = mesh::nearest_weights(p, tile.positions[t[0]], tile.positions[t[1]], tile.positions[t[2]]);
  Shown shown;
  double celsius_weight = 0;
  for (unsigned i = 0; i < 3; ++i) {
    const auto channels = channels_of(tile.visible[t[i]]);
    for (unsigned j = 0; j < 3; ++j) shown.channels[j] += weights[i] * channels[j];
    if (!std::isfinite(tile.temperature_celsius[t[i]])) continue;
    shown.celsius += weights[i] * static_cast<double>(tile.temperature_celsius[t[i]]);
    celsius_weight += weights[i];
  }
  shown.celsius = celsius_weight > 0 ? shown.celsius / celsius_weight : std::numeric_limits<double>::quiet_NaN();
  return shown;
}

/// Differences of the samples of a part, and how much of the surface each stands for.
struct Differences {
  std::vector<std::pair<float, float>> value_and_weight;
  double weight = 0;

  void add(double value, float its_weight) {
    value_and_weight.emplace_back(static_cast<float>(value), its_weight);
    weight += static_cast<double>(its_weight);
  }
  void join(const Differences& other) {
    value_and_weight.insert(value_and_weight.end(), other.value_and_weight.begin(), other.value_and_weight.end());
    weight += other.weight;
  }
  /// The value that 95 % of the surface do not exceed.
  double percentile() {
    if (value_and_weight.empty()) return 0;
    std::sort(value_and_weight.begin(), value_and_weight.end());
    const double deviation = std::sqrt(kShare * (1 - kShare) / static_cast<double>(value_and_weight.size()));
    const double share = std::min(kShare + std::max(kLeastMargin, 1.5 * deviation), 1.0);
    double sum = 0;
    for (const auto& [value, its_weight] : value_and_weight) {
      sum += static_cast<double>(its_weight);
      if (sum >= share * weight) return static_cast<double>(value);
    }
    return static_cast<double>(value_and_weight.back().first);
  }
};

using Parts = std::array<Differences, kParts * kParts * kParts>;

/// The largest of the tile as a whole, of its eighths and of its parts: whoever is near has few of them on the screen.
double largest_percentile(const Parts& parts) {
  double largest = 0;
  double whole_weight = 0;
  for (std::size_t along = 1; along <= kParts; along *= 2) {
    std::vector<Differences> joined(along * along * along);
    for (std::size_t part = 0; part < parts.size(); ++part) {
      const auto place = [&](std::size_t in_parts) { return in_parts % kParts * along / kParts; };
      joined[(place(part / kParts / kParts) * along + place(part / kParts)) * along + place(part)].join(parts[part]);
    }
    if (along == 1) whole_weight = joined[0].weight;
    for (Differences& some : joined) {
      if (along == 1 || some.weight > kLeastShare * whole_weight) largest = std::max(largest, some.percentile());
    }
  }
  return largest;
}

std::size_t part_of(const base::Vec3f& p, const base::Bounds& bounds) {
  const auto along = [](float at, float low, float high) {
    const double share = high > low ? (static_cast<double>(at) - static_cast<double>(low)) /
                                          (static_cast<double>(high) - static_cast<double>(low))
                                    : 0;
    return static_cast<std::size_t>(std::clamp(share * kParts, 0.0, kParts - 1.0));
  };
  return (along(p.x, bounds.min.x, bounds.max.x) * kParts + along(p.y, bounds.min.y, bounds.max.y)) * kParts +
         along(p.z, bounds.min.z, bounds.max.z);
}

}  // namespace

std::vector<FullSample> leaf_samples(const Tile& leaf) {
  std::vector<FullSample> samples;
  double area = 0;
  std::vector<double> areas;
  areas.reserve(leaf.triangles.size());
  for (const base::Triangle& t : leaf.triangles) {
    areas.push_back(mesh::triangle_area(leaf.positions[t[0]], leaf.positions[t[1]], leaf.positions[t[2]]));
    area += areas.back();
  }
  const std::size_t elements = leaf.triangles.empty() ? leaf.positions.size() : leaf.triangles.size();
  const std::size_t count = std::min(elements, kLeafSamples);
  if (!(area > 0) || !std::isfinite(area)) {
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t element = i * elements / count;
      const auto v = leaf.triangles.empty() ? static_cast<std::uint32_t>(element) : leaf.triangles[element][0];
      samples.push_back({leaf.positions[v], 1, leaf.visible[v], leaf.temperature_celsius[v], v});
    }
    return samples;
  }
  const double spacing = area / static_cast<double>(count);
  double passed = 0;
  std::uint32_t random = 1;
  for (std::size_t i = 0; i < leaf.triangles.size(); ++i) {
    passed += areas[i];
    while ((static_cast<double>(samples.size()) + 0.5) * spacing < passed && samples.size() < count) {
      // Any point of the triangle, the same in every run.
      random = random * 1664525u + 1013904223u;
      double u = static_cast<double>(random >> 8) * 0x1p-24;
      random = random * 1664525u + 1013904223u;
      double w = static_cast<double>(random >> 8) * 0x1p-24;
      if (u + w > 1) {
        u = 1 - u;
        w = 1 - w;
      }
      const base::Triangle& t = leaf.triangles[i];
      const auto mix = [&](auto value) {
        return static_cast<float>((1 - u - w) * static_cast<double>(value(t[0])) +
                                  u * static_cast<double>(value(t[1])) + w * static_cast<double>(value(t[2])));
      };
      const auto channel = [&](auto value) { return static_cast<std::uint8_t>(std::lround(mix(value))); };
      FullSample sample;
      sample.position = {mix([&](auto v) { return leaf.positions[v].x; }),
                         mix([&](auto v) { return leaf.positions[v].y; }),
                         mix([&](auto v) { return leaf.positions[v].z; })};
      sample.weight = static_cast<float>(spacing);
      sample.visible = {channel([&](auto v) { return leaf.visible[v].r; }),
                        channel([&](auto v) { return leaf.visible[v].g; }),
                        channel([&](auto v) { return leaf.visible[v].b; })};
      sample.celsius = mix([&](auto v) { return leaf.temperature_celsius[v]; });
      sample.near = t[0];
      samples.push_back(sample);
    }
  }
  return samples;
}

void thin_out(std::vector<FullSample>& samples) {
  const std::size_t stride = (samples.size() + kMostSamples - 1) / kMostSamples;
  if (stride <= 1) return;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < samples.size(); i += stride) samples[kept++] = samples[i];
  samples.resize(kept);
}

void measure_seen_error(Tile& tile, const mesh::Surface& surface, std::span<const FullSample> samples) {
  Parts colour, temperature;
  for (const FullSample& sample : samples) {
    const std::size_t part = part_of(sample.position, tile.bounds);
    const Shown shown = shown_at(tile, surface, sample.position, sample.near);
    const auto channels = channels_of(sample.visible);
    double largest = 0;
    for (unsigned j = 0; j < 3; ++j) largest = std::max(largest, std::fabs(channels[j] - shown.channels[j]));
    colour[part].add(largest, sample.weight);
    const double difference = std::fabs(static_cast<double>(sample.celsius) - shown.celsius);
    if (std::isfinite(difference)) temperature[part].add(difference, sample.weight);
  }
  const auto raise = [](float& error, double by) { error = std::fmax(error, static_cast<float>(by)); };
  raise(tile.colour_error_levels, largest_percentile(colour));
  if (!std::isnan(tile.lowest_celsius)) raise(tile.temperature_error_celsius, largest_percentile(temperature));
}

double lost_detail_m(const Tile& tile, const mesh::Surface& surface, const MergedTiles& mesh, const mesh::Surface& fine,
                     const Thinning& thinning, const SeenContrast& contrast) {
  struct Excess {
    std::uint64_t cell;
    std::array<double, 4> sum;  // In contrasts times square metres.
  };
  const std::vector<double> areas = mesh::vertex_areas(fine);
  const base::Bounds& bounds = tile.bounds;
  const auto extent = static_cast<double>(
      std::max({bounds.max.x - bounds.min.x, bounds.max.y - bounds.min.y, bounds.max.z - bounds.min.z}));
  if (!(extent > 0) || !std::isfinite(extent)) return 0;
  std::vector<Excess> excesses;
  excesses.reserve(mesh.positions.size());
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    if (!(areas[v] > 0)) continue;
    const std::uint32_t k = thinning.kept_of_merged[v];
    const base::Vec3f& p = mesh.positions[v];
    const Shown shown = thinning.kept[k] == v ? shown_at_vertex(tile, k) : shown_at(tile, surface, p, k);
    const auto channels = channels_of(mesh.visible[v]);
    Excess excess{};
    for (unsigned j = 0; j < 3; ++j) excess.sum[j] = areas[v] * (channels[j] - shown.channels[j]) / contrast.levels;
    const double difference = static_cast<double>(mesh.temperature_celsius[v]) - shown.celsius;
    if (std::isfinite(difference)) excess.sum[3] = areas[v] * difference / contrast.celsius;
    const auto cell = [&](float c, float low) {
      const double share = (static_cast<double>(c) - static_cast<double>(low)) / extent;
      return static_cast<std::uint32_t>(std::clamp(share * (1 << kFinestBits), 0.0, (1 << kFinestBits) - 1.0));
    };
    excess.cell = base::morton_code(cell(p.x, bounds.min.x), cell(p.y, bounds.min.y), cell(p.z, bounds.min.z));
    excesses.push_back(excess);
  }
  std::sort(excesses.begin(), excesses.end(), [](const Excess& a, const Excess& b) { return a.cell < b.cell; });
  double largest_squared = 0;
  for (int bits = kFinestBits; bits >= kCoarsestBits; --bits) {
    const double edge = extent / (1 << bits);
    const double least = edge * edge;
    std::size_t joined = 0;
    for (std::size_t i = 0; i < excesses.size(); ++i) {
      const std::uint64_t cell = excesses[i].cell >> (bits == kFinestBits ? 0 : 3);
      if (joined > 0 && excesses[joined - 1].cell == cell) {
        for (unsigned j = 0; j < 4; ++j) excesses[joined - 1].sum[j] += excesses[i].sum[j];
      } else {
        excesses[joined] = excesses[i];
        excesses[joined++].cell = cell;
      }
    }
    excesses.resize(joined);
    for (const Excess& excess : excesses) {
      for (const double sum : excess.sum) {
        if (std::fabs(sum) >= least) largest_squared = std::max(largest_squared, std::fabs(sum));
      }
    }
  }
  return std::sqrt(largest_squared);
}

}  // namespace spectra::map
