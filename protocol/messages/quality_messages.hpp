#pragma once

#include <optional>

#include "protocol/messages/message.hpp"

namespace spectra::protocol {

enum class QualityMode { Auto, Manual };

/// QUALITY: the knobs of speed against accuracy, as in force.
struct QualityState {
  QualityMode mode = QualityMode::Manual;
  double position_step_mm = 1;  ///< Above 0; the largest error per axis is half of it.
  int colour_bits = 8;          ///< 4..8.
  double pixel_error = 1;       ///< Above 0; pixels on the screen.
  int encoder_speed = 7;        ///< 0 smallest .. 10 fastest.
  double latency_target_ms = 200;
  bool marks = false;  ///< Colours carry which vertices the method highlights.
};

/// Params of quality.set; what is absent stays.
struct QualityChange {
  std::optional<QualityMode> mode;
  std::optional<double> position_step_mm;
  std::optional<int> colour_bits;
  std::optional<double> pixel_error;
  std::optional<int> encoder_speed;
  std::optional<double> latency_target_ms;
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
