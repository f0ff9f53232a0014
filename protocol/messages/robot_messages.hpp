// Made by protocol/generate from protocol/schema. Not to be edited.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/messages/message.hpp"
#include "protocol/messages/scene_messages.hpp"

/// Where the robot is that maps the scene.
namespace spectra::protocol {

/// A part of the way the robot has come.
struct RobotPath {
  /// What the client has of the way from this point on is replaced.
  std::uint32_t first = 0;
  /// Metres, in the coordinates of the map.
  std::vector<Vector3> points;
};

/// Params of the notification robot.moved.
struct RobotMoved {
  /// Unix seconds.
  double at = 0;
  /// Of its depth camera: metres, in the coordinates of the map; minus SCENE.origin they are those of the scene.
  Vector3 position{};
  /// Where that looks; of length 1.
  Vector3 forward{};
  /// Up in its picture; of length 1.
  Vector3 up{};
  /// True: it does not know where it is, and this is where it was last.
  std::optional<bool> lost;
  RobotPath path;
};

extern template struct Wire<RobotPath>;
extern template struct Wire<RobotMoved>;

}  // namespace spectra::protocol
