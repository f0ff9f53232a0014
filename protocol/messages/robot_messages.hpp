#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/messages/message.hpp"

namespace spectra::protocol {

/// A part of the way the robot has come.
struct RobotPath {
  std::uint32_t first = 0;                    ///< What the client has of the way from this point on is replaced.
  std::vector<std::array<double, 3>> points;  ///< Metres, in the coordinates of the map.
};

/// Params of robot.moved.
struct RobotMoved {
  double at = 0;                     ///< Unix seconds.
  std::array<double, 3> position{};  ///< Of its depth camera: metres, in the coordinates of the map.
  std::array<double, 3> forward{};   ///< Where that looks; of length 1.
  std::array<double, 3> up{};        ///< Up in its picture; of length 1.
  std::optional<bool> lost;          ///< True: it does not know where it is, and this is where it was last.
  RobotPath path;
};

extern template struct Wire<RobotPath>;
extern template struct Wire<RobotMoved>;

}  // namespace spectra::protocol
