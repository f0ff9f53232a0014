#include <cmath>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/bench/fusion/scalar_loops.hpp"

namespace spectra::fusion::bench {
namespace {

/// The palette as applyColorMap wants it. The order of channels is left as it is, here and everywhere below.
cv::Mat colour_map(const fusion::PaletteTable& palette) {
  cv::Mat map(256, 1, CV_8UC3);
  for (int row = 0; row < 256; ++row) {
    const auto& colour = palette[static_cast<std::size_t>(row)];
    map.at<cv::Vec3b>(row) = {cv::saturate_cast<uchar>(colour[0]), cv::saturate_cast<uchar>(colour[1]),
                              cv::saturate_cast<uchar>(colour[2])};
  }
  return map;
}

/// Buffers that live over the calls, so that only arithmetic is timed.
struct Work {
  cv::Mat level, thermal, mixed, mask, map, hsv, value;
  std::vector<cv::Mat> planes;
};

}  // namespace

Loop opencv_composition(const Scene& scene, const fusion::FusionPlan& plan, const fusion::PaletteTable& palette) {
  cv::setNumThreads(1);
  const std::string method = plan.settings().method;
  const fusion::ParameterValues& params = plan.params_in_force();
  const auto number = [&params](const char* name) {
    const auto found = params.find(name);
    return found != params.end() && std::holds_alternative<double>(found->second) ? std::get<double>(found->second)
                                                                                  : 0.0;
  };
  const bool known = method == "thermal_only" || method == "thermal_visible_blend" ||
                     method == "monochrome_threshold" || method == "colour_mapped_threshold" ||
                     method == "inverse_intensity_hue" || method == "histogram_distribution";
  if (!known) return {};
  auto work = std::make_shared<Work>();
  work->map = colour_map(palette);
  const double scale = 255 / (plan.range_maximum() - plan.range_minimum());
  const double offset = -plan.range_minimum() * scale;
  const double alpha = number("alpha");
  const double limit = number("threshold");
  const double k = number("k");
  const double lower = scene.summary.mean - k * scene.summary.sigma;
  const double upper = scene.summary.mean + k * scene.summary.sigma;
  return [=, &scene](std::span<base::Rgb8> fused) {
    Work& w = *work;
    const int count = static_cast<int>(fused.size());
    // OpenCV has no view of constant data; nothing below writes to these two.
    const cv::Mat temperature(count, 1, CV_32F, const_cast<float*>(scene.temperature.data()));
    const cv::Mat visible(count, 1, CV_8UC3, const_cast<base::Rgb8*>(scene.visible.data()));
    cv::Mat out(count, 1, CV_8UC3, fused.data());
    temperature.convertTo(w.level, CV_8U, scale, offset);
    if (method == "thermal_only") {
      cv::applyColorMap(w.level, out, w.map);
    } else if (method == "thermal_visible_blend") {
      cv::applyColorMap(w.level, w.thermal, w.map);
      cv::addWeighted(w.thermal, alpha, visible, 1 - alpha, 0, out);
    } else if (method == "colour_mapped_threshold" || method == "histogram_distribution") {
      cv::applyColorMap(w.level, w.thermal, w.map);
      cv::addWeighted(w.thermal, alpha, visible, 1 - alpha, 0, w.mixed);
      if (method == "colour_mapped_threshold") {
        cv::compare(temperature, limit, w.mask, cv::CMP_GT);
      } else {
        cv::inRange(temperature, lower, upper, w.mask);
        cv::bitwise_not(w.mask, w.mask);
      }
      visible.copyTo(out);
      w.mixed.copyTo(out, w.mask);
    } else if (method == "monochrome_threshold") {
      w.planes = {cv::Mat::zeros(count, 1, CV_8U), w.level, w.level};
      cv::merge(w.planes, w.hsv);
      cv::cvtColor(w.hsv, w.thermal, cv::COLOR_HSV2RGB_FULL);
      cv::addWeighted(w.thermal, alpha, visible, 1 - alpha, 0, w.mixed);
      cv::compare(temperature, limit, w.mask, cv::CMP_GT);
      visible.copyTo(out);
      w.mixed.copyTo(out, w.mask);
    } else {
      temperature.convertTo(w.value, CV_32F, scale / 255, offset / 255);
      cv::pow(w.value, k, w.value);
      cv::cvtColor(visible, w.hsv, cv::COLOR_RGB2HSV_FULL);
      cv::split(w.hsv, w.planes);
      w.value.convertTo(w.planes[2], CV_8U, 255);
      cv::merge(w.planes, w.hsv);
      cv::cvtColor(w.hsv, out, cv::COLOR_HSV2RGB_FULL);
    }
  };
}

}  // namespace spectra::fusion::bench
