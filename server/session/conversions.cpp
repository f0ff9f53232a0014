#include "server/session/conversions.hpp"

#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "fusion/registry.hpp"
#include "server/session/settings_text.hpp"
#include "server/stream/extremes_in_view.hpp"
#include "server/stream/lattice.hpp"

namespace spectra::session {
namespace {

constexpr double kMillimetresPerMetre = 1000;
/// Tells the wire's placeholder step (it must be positive) while no scene says which one suits it.
constexpr double kUnknownStepMm = 1;

protocol::ParameterKind to_message(fusion::ParameterKind kind) {
  switch (kind) {
    case fusion::ParameterKind::Number:
      return protocol::ParameterKind::Number;
    case fusion::ParameterKind::Integer:
      return protocol::ParameterKind::Integer;
    case fusion::ParameterKind::Toggle:
      return protocol::ParameterKind::Toggle;
    case fusion::ParameterKind::Choice:
      return protocol::ParameterKind::Choice;
    case fusion::ParameterKind::Temperature:
      return protocol::ParameterKind::Temperature;
  }
  return protocol::ParameterKind::Number;
}

protocol::UpAxis to_message(base::UpAxis up) {
  switch (up) {
    case base::UpAxis::X:
      return protocol::UpAxis::X;
    case base::UpAxis::Y:
      return protocol::UpAxis::Y;
    case base::UpAxis::Z:
      return protocol::UpAxis::Z;
    case base::UpAxis::MinusX:
      return protocol::UpAxis::MinusX;
    case base::UpAxis::MinusY:
      return protocol::UpAxis::MinusY;
    case base::UpAxis::MinusZ:
      return protocol::UpAxis::MinusZ;
  }
  return protocol::UpAxis::Z;
}

protocol::RangeMode to_message(fusion::RangeMode mode) {
  switch (mode) {
    case fusion::RangeMode::Auto:
      return protocol::RangeMode::Auto;
    case fusion::RangeMode::Manual:
      return protocol::RangeMode::Manual;
    case fusion::RangeMode::Percentile:
      return protocol::RangeMode::Percentile;
  }
  return protocol::RangeMode::Auto;
}

fusion::RangeSetting from_message(const protocol::RangeChange& range) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const fusion::RangeSetting usual;
  switch (range.mode) {
    case protocol::RangeMode::Auto:
      break;
    case protocol::RangeMode::Manual:
      return fusion::RangeSetting::manual(range.min.value_or(kNone), range.max.value_or(kNone));
    case protocol::RangeMode::Percentile:
      return fusion::RangeSetting::percentile(range.low.value_or(usual.low_percent),
                                              range.high.value_or(usual.high_percent));
  }
  return usual;
}

protocol::ParameterValue to_message(const fusion::ParameterValue& value) {
  return std::visit(
      [](const auto& held) -> protocol::ParameterValue {
        if constexpr (std::is_same_v<std::decay_t<decltype(held)>, fusion::Automatic>) {
          return nullptr;
        } else {
          return held;
        }
      },
      value);
}

fusion::ParameterValue from_message(const protocol::ParameterValue& value) {
  return std::visit(
      [](const auto& held) -> fusion::ParameterValue {
        if constexpr (std::is_same_v<std::decay_t<decltype(held)>, std::nullptr_t>) {
          return fusion::Automatic{};
        } else {
          return held;
        }
      },
      value);
}

protocol::ParameterValues to_message(const fusion::ParameterValues& values) {
  protocol::ParameterValues message;
  for (const auto& [name, value] : values) message.emplace(name, to_message(value));
  return message;
}

std::optional<double> bound(double value) {
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

protocol::ParameterDescription to_message(const fusion::Parameter& parameter) {
  protocol::ParameterDescription message;
  message.name = parameter.name;
  message.label = parameter.label;
  message.help = parameter.help;
  message.kind = to_message(parameter.kind);
  message.default_value = to_message(parameter.default_value);
  message.min = bound(parameter.min);
  message.max = bound(parameter.max);
  message.exclusive_min = bound(parameter.exclusive_min);
  if (parameter.step > 0) message.step = parameter.step;
  message.unit = parameter.unit;
  message.options = parameter.options;
  if (parameter.automatic) message.automatic = true;
  return message;
}

/// What is left out where it is false.
std::optional<bool> if_true(bool value) {
  return value ? std::optional(true) : std::nullopt;
}

protocol::Vector3 to_message(const base::Vec3f& v) {
  return {double{v.x}, double{v.y}, double{v.z}};
}

std::array<std::uint8_t, 3> to_message(base::Rgb8 colour) {
  return {colour.r, colour.g, colour.b};
}

std::optional<protocol::Extreme> to_message(const std::optional<map::Extreme>& extreme) {
  if (!extreme) return std::nullopt;
  return protocol::Extreme{to_message(extreme->position), double{extreme->temperature_celsius}};
}

base::Vec3f to_vec3f(const std::array<double, 3>& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

}  // namespace

protocol::MethodDescription to_message(const fusion::Method& method) {
  protocol::MethodDescription message{method.id,
                                      method.label,
                                      method.summary,
                                      method.needs_temperature,
                                      method.uses_palette,
                                      method.wants_fusion_safe_palette,
                                      if_true(method.wants_diverging_palette),
                                      if_true(method.compares_with_baseline),
                                      {}};
  for (const auto& parameter : method.parameters) message.params.push_back(to_message(parameter));
  return message;
}

protocol::PaletteDescription to_message(const fusion::Palette& palette) {
  return {palette.id,
          palette.label,
          palette.fusion_safe,
          if_true(palette.diverging),
          {palette.table.begin(), palette.table.end()}};
}

std::vector<protocol::MethodDescription> method_messages() {
  std::vector<protocol::MethodDescription> messages;
  for (const fusion::Method* method : fusion::all_methods()) messages.push_back(to_message(*method));
  return messages;
}

std::vector<protocol::PaletteDescription> palette_messages() {
  std::vector<protocol::PaletteDescription> messages;
  for (const auto& palette : fusion::all_palettes()) messages.push_back(to_message(palette));
  return messages;
}

protocol::FusionState to_message(const fusion::FusionPlan& plan, const fusion::TemperatureSummary& scene) {
  const auto& settings = plan.settings();
  protocol::FusionState message;
  message.method = settings.method;
  message.params = to_message(settings.params);
  message.params_in_force = to_message(plan.params_in_force());
  message.palette = settings.palette;
  message.range.mode = to_message(settings.range.mode);
  message.missing = missing_to_text(settings.missing);
  if (scene.has_temperature() || settings.range.mode == fusion::RangeMode::Manual) {
    message.range.min = plan.range_minimum();
    message.range.max = plan.range_maximum();
  }
  if (settings.range.mode == fusion::RangeMode::Percentile) {
    message.range.low = settings.range.low_percent;
    message.range.high = settings.range.high_percent;
  }
  message.age = {settings.age.mode == fusion::AgeMode::Fade ? protocol::AgeMode::Fade : protocol::AgeMode::Off,
                 settings.age.half_life_s};
  if (const auto& scale = plan.change_scale()) message.change_scale = {scale->minimum, scale->maximum};
  for (const auto& [name, value] : settings.params) {
    if (!scene.has_temperature() && std::holds_alternative<fusion::Automatic>(value)) {
      message.params_in_force.insert_or_assign(name, nullptr);
    }
  }
  return message;
}

protocol::Result<fusion::FusionChange> from_message(const protocol::FusionChange& message) {
  fusion::FusionChange change;
  change.method = message.method;
  change.palette = message.palette;
  for (const auto& [name, value] : message.params) change.params.emplace(name, from_message(value));
  if (message.range) {
    change.range = from_message(*message.range);
  }
  if (message.missing) {
    auto missing = missing_from_text(*message.missing);
    if (!missing) return protocol::refusal(protocol::RpcErrorCode::InvalidParams, missing.error().message, "missing");
    change.missing = missing.value();
  }
  if (message.age) {
    if (message.age->mode) {
      change.age.mode = *message.age->mode == protocol::AgeMode::Fade ? fusion::AgeMode::Fade : fusion::AgeMode::Off;
    }
    change.age.half_life_s = message.age->half_life_s;
  }
  return change;
}

protocol::RpcError to_rpc_error(const base::Error& error) {
  protocol::RpcError message;
  message.code = protocol::RpcErrorCode::InvalidParams;
  message.message = error.message;
  const bool is_own_field = error.field.empty() || error.field == "method" || error.field == "palette" ||
                            error.field == "range" || error.field.starts_with("range.") || error.field == "missing" ||
                            error.field.starts_with("age.") || error.field.starts_with("params.");
  message.field = is_own_field ? error.field : "params." + error.field;
  return message;
}

std::optional<std::string> palette_warning(const fusion::Method& method, const fusion::Palette* palette) {
  if (!method.wants_fusion_safe_palette || palette == nullptr || palette->fusion_safe) return std::nullopt;
  return "The palette " + palette->label + " does not carry temperature by hue alone, so " + method.label +
         " hides part of it; choose one that is marked as safe.";
}

std::optional<std::string> direction_warning(const fusion::Method& method, const fusion::Palette* palette) {
  if (!method.wants_diverging_palette || palette == nullptr || palette->diverging) return std::nullopt;
  return "The palette " + palette->label + " has no neutral middle, so " + method.label +
         " does not tell warmer from colder at a glance; choose one that is marked as diverging.";
}

protocol::SceneTemperature to_message(const fusion::TemperatureSummary& summary) {
  protocol::SceneTemperature message;
  message.missing_count = summary.missing_count;
  message.over_range_count = summary.over_range_count;
  message.under_range_count = summary.under_range_count;
  if (summary.has_temperature()) {
    message.min = double{summary.minimum};
    message.max = double{summary.maximum};
    message.mean = summary.mean;
    message.sigma = summary.sigma;
  }
  return message;
}

protocol::SceneDescription to_message(const map::SceneSnapshot& scene) {
  protocol::SceneDescription message;
  message.name = scene.name();
  message.revision = scene.revision();
  message.vertex_count = scene.vertex_count();
  message.triangle_count = scene.triangle_count();
  message.point_cloud = scene.is_point_cloud();
  message.origin = {scene.origin().x, scene.origin().y, scene.origin().z};
  message.bounds = {to_message(scene.bounds().min), to_message(scene.bounds().max)};
  message.core_bounds = protocol::Bounds{to_message(scene.core_bounds().min), to_message(scene.core_bounds().max)};
  message.temperature = to_message(scene.temperature().summary);
  message.tile_count = scene.tiles().size();
  message.levels = static_cast<std::uint32_t>(scene.level_count());
  message.position_step_m = double{stream::coarsest_step(scene, scene.suggested_position_step_m())};
  message.up = to_message(scene.up());
  message.metric = scene.is_metric();
  message.live = scene.is_live();
  if (scene.has_temperature_sigma()) message.has_temperature_sigma = true;
  message.observed.emplace();
  if (const auto observed = scene.observed()) {
    message.observed->oldest = observed->first;
    message.observed->newest = observed->second;
  }
  if (scene.baseline_mark()) message.baseline = protocol::SceneBaseline{scene.baseline_marked_at()};
  for (const auto& note : scene.notes()) message.notes.push_back({note.id, note.count, note.message});
  return message;
}

protocol::FactsReply facts_message(const fusion::TemperatureSummary& summary) {
  protocol::FactsReply message;
  message.finite_count = summary.finite_count;
  message.missing_count = summary.missing_count;
  message.over_range_count = summary.over_range_count;
  message.under_range_count = summary.under_range_count;
  message.min = double{summary.minimum};
  message.max = double{summary.maximum};
  message.mean = summary.mean;
  message.sigma = summary.sigma;
  return message;
}

protocol::HistogramReply to_message(const fusion::Histogram& histogram, const fusion::TemperatureSummary& scene,
                                    const std::vector<fusion::TemperatureInterval>& highlighted,
                                    std::optional<double> highlighted_share) {
  protocol::HistogramReply message;
  message.highlighted_share = highlighted_share;
  if (!scene.has_temperature()) return message;
  message.counts = histogram.counts;
  for (std::size_t i = 0; i <= histogram.counts.size(); ++i) {
    message.edges.push_back(fusion::histogram_edge(histogram, i));
  }
  message.mean = scene.mean;
  message.sigma = scene.sigma;
  for (const auto& interval : highlighted) message.highlighted.push_back({interval.low, interval.high});
  return message;
}

protocol::ProbeReply to_message(const map::Probe& probe, base::Rgb8 fused) {
  protocol::ProbeReply message;
  message.vertex_index = probe.vertex_index;
  message.position = to_message(probe.position);
  if (const auto celsius = probe.temperature_celsius) {
    if (std::isfinite(*celsius)) {
      message.temperature = double{*celsius};
    } else {
      message.temperature_range = *celsius > 0 ? protocol::BeyondRange::Over : protocol::BeyondRange::Under;
    }
  }
  message.visible = to_message(probe.visible);
  message.fused = to_message(fused);
  message.distance = probe.distance_m;
  message.observed_at = probe.observed_at;
  if (probe.baseline_celsius && std::isfinite(*probe.baseline_celsius)) {
    message.baseline = double{*probe.baseline_celsius};
  }
  message.baseline_at = probe.baseline_at;
  if (probe.sigma_kelvin) message.temperature_sigma = double{*probe.sigma_kelvin};
  message.temperature_at = probe.looked_at;
  return message;
}

static protocol::ExtremesReply to_message(const stream::ExtremesInView& extremes) {
  const auto place_of = [](const std::optional<map::Extreme>& extreme) -> std::optional<protocol::Vector3> {
    if (!extreme) return std::nullopt;
    return to_message(extreme->position);
  };
  return {to_message(extremes.hottest), to_message(extremes.coldest), place_of(extremes.over_range),
          place_of(extremes.under_range)};
}

protocol::ExtremesReply extremes_message(const map::SceneSnapshot& scene) {
  return to_message(stream::ExtremesInView{scene.hottest(), scene.coldest(), scene.over_range(), scene.under_range()});
}

protocol::ExtremesReply extremes_message(const map::SceneSnapshot& scene, const protocol::ExtremesRequest& request) {
  if (!request.camera) return extremes_message(scene);
  return to_message(
      stream::extremes_in_view(scene, from_message(*request.camera), request.window.value_or(stream::kWholePicture)));
}

protocol::QualityState to_message(const stream::StreamQuality& quality) {
  protocol::QualityState message;
  message.mode = quality.automatic ? protocol::QualityMode::Auto : protocol::QualityMode::Manual;
  message.position_step_mm =
      quality.position_step_m > 0 ? double{quality.position_step_m} * kMillimetresPerMetre : kUnknownStepMm;
  message.colour_bits = quality.colour_bits;
  message.pixel_error = quality.pixel_error;
  message.encoder_speed = quality.encoder_speed;
  message.latency_target_ms = quality.latency_target_ms;
  message.marks = quality.marks;
  return message;
}

protocol::Result<stream::StreamQuality> with_change(const stream::StreamQuality& quality,
                                                    const protocol::QualityChange& change) {
  stream::StreamQuality changed = quality;
  if (change.mode) changed.automatic = *change.mode == protocol::QualityMode::Auto;
  if (change.position_step_mm) {
    changed.position_step_m = stream::lattice_step(*change.position_step_mm / kMillimetresPerMetre);
  }
  if (change.colour_bits) changed.colour_bits = *change.colour_bits;
  if (change.pixel_error) changed.pixel_error = *change.pixel_error;
  if (change.encoder_speed) changed.encoder_speed = *change.encoder_speed;
  if (change.latency_target_ms) changed.latency_target_ms = *change.latency_target_ms;
  if (change.marks) changed.marks = *change.marks;
  return changed;
}

stream::Camera from_message(const protocol::CameraSet& message) {
  return {to_vec3f(message.eye), to_vec3f(message.target), to_vec3f(message.up), message.fov_y_deg, message.viewport};
}

protocol::StreamComplete to_message(const stream::StreamComplete& complete) {
  return {complete.generation, complete.scene_revision, complete.tile_count, complete.vertex_count};
}

}  // namespace spectra::session
