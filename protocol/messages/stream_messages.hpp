#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/messages/message.hpp"
#include "protocol/tile_frame.hpp"

namespace spectra::protocol {

enum class Channel { Fused, Temperature, Visible };

/// Tiles that a client still has, with colours, from an earlier connection.
struct ResumeRequest {
  std::string session_id;                           ///< Of the hello of that connection.
  std::vector<std::array<std::uint32_t, 5>> tiles;  ///< Level (0..255), x, y, z, revision (from 1); at most 1,500.
  /// Which of `tiles`, by their places in it, it has both raw layers of, in the form that it asks for now; absent: none.
  std::optional<std::vector<std::uint32_t>> raw;
};

/// Params of scene.subscribe; at least one channel.
struct SubscribeRequest {
  std::vector<Channel> channels;
  std::optional<std::uint32_t> in_flight_bytes;  ///< 1..2^31-1; absent: the server's choice.
  std::optional<std::uint32_t> cache_bytes;  ///< 1..2^31-1, of decoded tiles; absent: no bound to what is asked for.
  std::optional<ColourTransform> colour_transform;  ///< Absent: none.
  std::optional<double>
      temperature_step_celsius;  ///< Of the channel temperature; above 0; absent: the server's choice.
  std::optional<ResumeRequest> resume;
};

/// Result of scene.subscribe.
struct SubscribeReply {
  std::optional<std::uint32_t> resumed_tiles;  ///< There when the request had `resume`: claims that hold.
};

/// Params of camera.set; metres relative to the scene origin, finite as float.
struct CameraSet {
  std::array<double, 3> eye{};
  std::array<double, 3> target{};
  std::array<double, 3> up{};
  double fov_y_deg = 50;              ///< Above 0, below 180.
  std::array<int, 2> viewport{1, 1};  ///< Width and height, 1..32768 pixels.
};

/// Params of stream.ack: every frame up to this one is decoded.
struct StreamAck {
  std::uint32_t sequence = 0;
};

/// Params of stream.complete.
struct StreamComplete {
  std::uint32_t generation = 0;
  std::uint32_t scene_revision = 0;
  std::uint64_t tiles = 0;
  std::uint64_t vertices = 0;
};

/// What is on the screen now; nullopt = null: nothing yet.
struct StreamAccuracy {
  std::optional<double> position_mm;
  int colour_levels = 256;
  std::optional<double> pixel_error;
  std::optional<double> temperature_celsius;
};

/// Params of stream.stats; nullopt = null: not measured yet.
struct StreamStats {
  std::optional<double> round_trip_ms;
  std::optional<double> throughput_bytes_per_s;
  std::uint64_t queued_bytes = 0;
  std::uint64_t skipped_frames = 0;
  std::uint64_t viewers = 0;
  StreamAccuracy accuracy;
};

enum class StatusLevel { Info, Warning, Error };

/// Params of status; the same id replaces, message null clears.
struct Status {
  std::string id;
  StatusLevel level = StatusLevel::Info;
  std::optional<std::string> message;
};

extern template struct Wire<ResumeRequest>;
extern template struct Wire<SubscribeRequest>;
extern template struct Wire<SubscribeReply>;
extern template struct Wire<CameraSet>;
extern template struct Wire<StreamAck>;
extern template struct Wire<StreamComplete>;
extern template struct Wire<StreamAccuracy>;
extern template struct Wire<StreamStats>;
extern template struct Wire<Status>;

}  // namespace spectra::protocol
