#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "fusion/fusion_plan.hpp"
#include "server/stream/frame_cache_state.hpp"

namespace spectra::stream {

/// Which layers beside fused colours one viewer is to have. An epoch rises when what it has of a layer is to be sent in another form.
struct RawDemand {
  /// The layers, in the order in which they are sent.
  static constexpr std::array<Layer, 3> kLayers = {Layer::Temperature, Layer::Visible, Layer::TemperatureSigma};
  // Their places in it.
  static constexpr std::size_t kTemperature = 0, kVisible = 1, kSigma = 2;
  /// So many of them, the first, are what colours are made of: the raw layers.
  static constexpr std::size_t kRawCount = 2;

  std::array<bool, kLayers.size()> is_wanted{};
  std::array<std::uint64_t, kLayers.size()> epoch = {1, 1, 1};
  double temperature_step_celsius = 0;  ///< 0 = TemperatureCodes::kDefaultStepCelsius.
};

/// What fused colours show, beside the tile's own look.
struct Picture {
  std::shared_ptr<const PlanIdentity> plan;  ///< Null: none.
  bool has_marks = false;
  friend bool operator==(const Picture&, const Picture&) = default;
};

/// What one viewer is to be shown, as a job needs it: the settings in force. An epoch rises with each change that makes
/// frames of that kind stale; 0 stands for none.
struct Demand {
  /// Older than every epoch of a stream: of colours that the viewer has from an earlier connection.
  static constexpr std::uint64_t kEarlierColourEpoch = 1;

  std::uint64_t geometry_epoch = 1;
  std::uint64_t colour_epoch = kEarlierColourEpoch + 1;
  float position_step_m = 0;
  int encoder_speed = 7;
  int colour_bits = 8;
  int preview_colour_bits = 8;  ///< Of tiles that are drawn only until their children are there.
  protocol::ColourTransform colour_transform = protocol::ColourTransform::None;
  bool fused = true;  ///< Colours are wanted, not the geometry alone.
  RawDemand raw;
  bool marks = false;                              ///< Of what is highlighted are wanted beside the colours.
  std::shared_ptr<const fusion::FusionPlan> plan;  ///< Null before there are settings.
  std::shared_ptr<const PlanIdentity> plan_identity;
  LookRules look_rules;

  GeometryKey geometry_key(const std::shared_ptr<const map::Tile>& tile) const {
    return {Identity(tile), position_step_m, encoder_speed};
  }
  /// `bits` is one of the two above.
  ColourKey colour_key(const EncodedTile& geometry, int bits, const TileLook& look) const {
    return {.revision = geometry.revision,
            .plan = plan_identity,
            .colour_bits = bits,
            .transform = colour_transform,
            .has_marks = carries_marks(),
            .look = look};
  }
  ColourKey raw_key(std::uint32_t revision, Layer layer) const {
    const bool is_visible = layer == Layer::Visible;
    return {.revision = revision,
            .plan = nullptr,
            .colour_bits = 8,
            .transform = is_visible ? colour_transform : protocol::ColourTransform::None,
            .layer = layer,
            .step_celsius = layer == Layer::Temperature ? raw.temperature_step_celsius : 0};
  }
  Picture picture() const { return {plan_identity, carries_marks()}; }
  /// A method that highlights nothing has no marks to carry.
  bool carries_marks() const { return marks && plan && plan->highlights(); }
};

}  // namespace spectra::stream
