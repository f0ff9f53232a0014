// Made by protocol/generate from protocol/schema. Not to be edited.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/messages/message.hpp"

/// Quality.
namespace spectra::protocol {

enum class QualityMode { Auto, Manual };

/// QUALITY: the knobs in force.
struct QualityState {
  QualityMode mode = QualityMode::Manual;
  /// Lattice step; the largest error per axis is half of it.
  double position_step_mm = 1;
  int colour_bits = 8;
  /// Largest error on the screen, pixels.
  double pixel_error = 1;
  /// Draco speed: 0 smallest, 10 fastest.
  int encoder_speed = 7;
  /// Aim of mode auto.
  double latency_target_ms = 200;
  /// Colours carry which vertices the method highlights.
  bool marks = false;
};

/// Params of quality.set; what is absent stays.
struct QualityChange {
  std::optional<QualityMode> mode;
  std::optional<double> position_step_mm;
  std::optional<int> colour_bits;
  std::optional<double> pixel_error;
  std::optional<int> encoder_speed;
  std::optional<double> latency_target_ms;
  /// Colours carry which vertices the method highlights.
  std::optional<bool> marks;
};

/// Result of quality.set.
struct QualityReply {
  QualityState quality;
};

extern template struct Wire<QualityState>;
extern template struct Wire<QualityChange>;
extern template struct Wire<QualityReply>;

}  // namespace spectra::protocol
