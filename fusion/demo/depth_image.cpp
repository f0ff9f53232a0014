#include "fusion/demo/depth_image.hpp"

#include <algorithm>
#include <cmath>

namespace spectra::demo {

DepthImage draw(const std::vector<ImagePoint>& points, const std::vector<base::Triangle>& triangles,
                const std::vector<float>& values, std::size_t width, std::size_t height) {
  DepthImage image{width, height, std::vector<float>(width * height, 0.0F), {}};
  if (!values.empty()) image.value.assign(width * height, 0.0F);
  const float right = static_cast<float>(width), bottom = static_cast<float>(height);
  for (const base::Triangle& t : triangles) {
    const ImagePoint &a = points[t[0]], &b = points[t[1]], &c = points[t[2]];
    if (a.nearness <= 0 || b.nearness <= 0 || c.nearness <= 0) continue;
    const float area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
    if (area == 0) continue;
    const float low_x = std::max(0.0F, std::ceil(std::min({a.x, b.x, c.x}) - 0.5F));
    const float low_y = std::max(0.0F, std::ceil(std::min({a.y, b.y, c.y}) - 0.5F));
    const float high_x = std::min(right, std::ceil(std::max({a.x, b.x, c.x}) - 0.5F));
    const float high_y = std::min(bottom, std::ceil(std::max({a.y, b.y, c.y}) - 0.5F));
    for (float y = low_y; y < high_y; ++y) {
      for (float x = low_x; x < high_x; ++x) {
        const float px = x + 0.5F, py = y + 0.5F;
        const float v = ((px - a.x) * (c.y - a.y) - (c.x - a.x) * (py - a.y)) / area;
        const float w = ((b.x - a.x) * (py - a.y) - (px - a.x) * (b.y - a.y)) / area;
        const float u = 1 - v - w;
        if (u < 0 || v < 0 || w < 0) continue;
        const float nearness = u * a.nearness + v * b.nearness + w * c.nearness;
        const std::size_t pixel = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
        if (nearness <= image.nearness[pixel]) continue;
        image.nearness[pixel] = nearness;
        if (!values.empty()) image.value[pixel] = u * values[t[0]] + v * values[t[1]] + w * values[t[2]];
      }
    }
  }
  return image;
}

}  // namespace spectra::demo
