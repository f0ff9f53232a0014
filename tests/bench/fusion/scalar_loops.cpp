#include "tests/bench/fusion/scalar_loops.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace spectra::fusion::bench {
namespace {

using Colour = std::array<double, 3>;

base::Rgb8 rounded(const Colour& colour) {
  const auto level = [](double value) { return static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0) + 0.5); };
  return {level(colour[0]), level(colour[1]), level(colour[2])};
}

Colour mixed(double a, const Colour& over, const Colour& under) {
  return {a * over[0] + (1 - a) * under[0], a * over[1] + (1 - a) * under[1], a * over[2] + (1 - a) * under[2]};
}

/// The loop around a per-vertex function of temperature, t and visible colour.
template <class Shade>
Loop loop(const Scene& scene, const fusion::FusionPlan& plan, Shade shade) {
  return [&scene, lo = plan.range_minimum(), hi = plan.range_maximum(), shade](std::span<base::Rgb8> fused) {
    for (std::size_t i = 0; i < fused.size(); ++i) {
      const float temperature = scene.temperature[i];
      const base::Rgb8 v = scene.visible[i];
      if (!std::isfinite(temperature)) {
        fused[i] = v;
        continue;
      }
      const double t = hi > lo ? std::clamp((double{temperature} - lo) / (hi - lo), 0.0, 1.0) : 0.5;
      fused[i] = rounded(shade(temperature, t, Colour{double(v.r), double(v.g), double(v.b)}));
    }
  };
}

}  // namespace

Loop scalar_double_loop(const Scene& scene, const fusion::FusionPlan& plan, const fusion::PaletteTable& palette) {
  const std::string& method = plan.settings().method;
  const fusion::ParameterValues& params = plan.params_in_force();
  const auto number = [&params](const char* name) { return std::get<double>(params.at(name)); };
  const auto thermal = [&palette](double t) { return fusion::palette_colour(palette, t); };
  if (method == "thermal_only") {
    return loop(scene, plan, [=](float, double t, const Colour&) { return thermal(t); });
  }
  if (method == "thermal_visible_blend") {
    return loop(scene, plan,
                [=, a = number("alpha")](float, double t, const Colour& v) { return mixed(a, thermal(t), v); });
  }
  if (method == "monochrome_threshold") {
    // The bench keeps the default hue, red.
    return loop(scene, plan,
                [a = number("alpha"), limit = static_cast<float>(number("threshold"))](float temperature, double t,
                                                                                       const Colour& v) {
                  if (!(temperature > limit)) return v;
                  return mixed(a, {255 * t, 255 * t * (1 - t), 255 * t * (1 - t)}, v);
                });
  }
  if (method == "colour_mapped_threshold") {
    return loop(scene, plan,
                [=, a = number("alpha"), limit = static_cast<float>(number("threshold"))](float temperature, double t,
                                                                                          const Colour& v) {
                  return temperature > limit ? mixed(a, thermal(t), v) : v;
                });
  }
  if (method == "thermal_highlighting") {
    return loop(scene, plan,
                [=, low = number("low"), high = number("high"), k = number("k"), lo = plan.range_minimum(),
                 hi = plan.range_maximum()](float temperature, double t, const Colour& v) {
                  double u = 0;
                  if (temperature > static_cast<float>(high)) {
                    u = (double{temperature} - high) / (hi - high);
                  } else if (temperature < static_cast<float>(low)) {
                    u = (low - double{temperature}) / (low - lo);
                  } else {
                    return v;
                  }
                  u = std::clamp(u, 0.0, 1.0);
                  return mixed(std::min(1.0, k * u * u), thermal(t), v);
                });
  }
  if (method == "intensity_hue") {
    return loop(scene, plan, [=, k = number("k")](float, double t, const Colour& v) {
      const double grey = (299 * v[0] + 587 * v[1] + 114 * v[2]) / 1000;
      const double lightness = std::clamp(k * (2 * grey / 255 - 1), -1.0, 1.0);
      Colour m = thermal(t);
      for (double& channel : m) channel += lightness > 0 ? lightness * (255 - channel) : lightness * channel;
      return m;
    });
  }
  if (method == "inverse_intensity_hue") {
    return loop(scene, plan, [k = number("k")](float, double t, const Colour& v) {
      const double value = 255 * std::pow(t, k);
      const double brightest = std::max({v[0], v[1], v[2]});
      if (brightest == 0) return Colour{value, value, value};
      return Colour{value * v[0] / brightest, value * v[1] / brightest, value * v[2] / brightest};
    });
  }
  if (method == "histogram_bin") {
    const auto n = static_cast<std::size_t>(std::get<std::int64_t>(params.at("n")));
    std::vector<std::size_t> order;
    for (std::size_t bin = 0; bin < scene.counts.size(); ++bin) {
      if (scene.counts[bin] > 0) order.push_back(bin);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return scene.counts[a] < scene.counts[b]; });
    std::vector<std::uint8_t> flags(scene.counts.size());
    for (std::size_t i = 0; i < std::min(n, order.size()); ++i) flags[order[i]] = 1;
    return loop(scene, plan,
                [=, a = number("alpha"), min = double{scene.summary.minimum}, max = double{scene.summary.maximum},
                 flags = std::move(flags)](float temperature, double t, const Colour& v) {
                  const auto bins = static_cast<double>(flags.size());
                  const double position = std::floor((double{temperature} - min) / (max - min) * bins);
                  const auto bin = static_cast<std::size_t>(std::clamp(position, 0.0, bins - 1));
                  return flags[bin] ? mixed(a, thermal(t), v) : v;
                });
  }
  if (method == "histogram_distribution") {
    const double k = number("k");
    return loop(scene, plan,
                [=, a = number("alpha"), lower = scene.summary.mean - k * scene.summary.sigma,
                 upper = scene.summary.mean + k * scene.summary.sigma](float temperature, double t, const Colour& v) {
                  return double{temperature} < lower || double{temperature} > upper ? mixed(a, thermal(t), v) : v;
                });
  }
  if (method == "thermal_change") {
    const double span = number("span");
    return [&scene, thermal, span, a = number("alpha"),
            limit = static_cast<float>(number("threshold"))](std::span<base::Rgb8> fused) {
      for (std::size_t i = 0; i < fused.size(); ++i) {
        const float change = scene.temperature[i] - scene.baseline[i];
        const base::Rgb8 v = scene.visible[i];
        const Colour visible{double(v.r), double(v.g), double(v.b)};
        const double t = std::clamp((double{change} / span + 1) / 2, 0.0, 1.0);
        fused[i] = std::abs(change) > limit ? rounded(mixed(a, thermal(t), visible)) : v;
      }
    };
  }
  return {};
}

Loop plain_float_blend(const Scene& scene, const fusion::FusionPlan& plan, const fusion::PaletteTable& palette) {
  if (plan.settings().method != "thermal_visible_blend") return {};
  std::vector<std::array<float, 3>> rows;
  for (const auto& row : palette) {
    rows.push_back({static_cast<float>(row[0]), static_cast<float>(row[1]), static_cast<float>(row[2])});
  }
  return [&scene, rows, lo = static_cast<float>(plan.range_minimum()),
          scale = static_cast<float>(255 / (plan.range_maximum() - plan.range_minimum())),
          a = static_cast<float>(std::get<double>(plan.params_in_force().at("alpha")))](std::span<base::Rgb8> fused) {
    for (std::size_t i = 0; i < fused.size(); ++i) {
      const float temperature = scene.temperature[i];
      const base::Rgb8 v = scene.visible[i];
      if (!std::isfinite(temperature)) {
        fused[i] = v;
        continue;
      }
      const float position = std::clamp((temperature - lo) * scale, 0.0F, 255.0F);
      const auto row = std::min<std::size_t>(static_cast<std::size_t>(position), 254);
      const float part = position - static_cast<float>(row);
      const auto channel = [&](std::size_t c, std::uint8_t visible) {
        const float m = rows[row][c] + part * (rows[row + 1][c] - rows[row][c]);
        return static_cast<std::uint8_t>(a * m + (1 - a) * static_cast<float>(visible) + 0.5F);
      };
      fused[i] = {channel(0, v.r), channel(1, v.g), channel(2, v.b)};
    }
  };
}

}  // namespace spectra::fusion::bench
