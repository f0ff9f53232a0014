// Made by protocol/generate from protocol/schema. Not to be edited.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/messages/message.hpp"
#include "protocol/messages/scene_messages.hpp"
#include "protocol/tile_frame.hpp"

/// Subscription, camera, stream and status.
namespace spectra::protocol {

/// Params of the notification camera.set; metres relative to the scene origin.
struct CameraSet {
  Position eye{};
  Position target{};
  Position up{};
  double fov_y_deg = 50;
  /// Width and height, pixels.
  std::array<int, 2> viewport{1, 1};
};

enum class Channel { Fused, Temperature, Visible, TemperatureSigma };

/// Tiles that the client still has, with colours, from an earlier connection.
struct ResumeRequest {
  /// Of the hello of that connection.
  std::string session_id;
  /// Those it holds.
  std::vector<std::array<std::uint32_t, 5>> tiles;
  /// Places in `tiles` of those of which it has both raw layers, in the form that it asks for now; absent: none.
  std::optional<std::vector<std::uint32_t>> raw;
  /// Places in `tiles` of those of which it has how sure temperatures are; absent: none.
  std::optional<std::vector<std::uint32_t>> temperature_sigma;
  /// Which colours it holds: a place in `tiles`, and the sequence of the frame that brought them on that
  /// connection, 0 where they are as that connection's own resume named them. Absent: colours come anew.
  std::optional<std::vector<std::array<std::uint32_t, 2>>> colours;
};

/// Params of scene.subscribe.
struct SubscribeRequest {
  std::vector<Channel> channels;
  /// Most frame bytes beyond the last stream.ack; absent: the server's choice.
  std::optional<std::uint32_t> in_flight_bytes;
  /// Most bytes of decoded tiles (16 a vertex, 12 a triangle) held by the client; absent: no bound to what it asks
  /// for.
  std::optional<std::uint32_t> cache_bytes;
  /// How colours are written: frames of kind 2, or of kind 6. Absent: none.
  std::optional<ColourTransform> colour_transform;
  /// Step of the channel temperature; absent: the larger of 0.01 degC and a 65,000th of the tile's span.
  std::optional<double> temperature_step_celsius;
  /// Absent: the client holds nothing. Refused while frames flow.
  std::optional<ResumeRequest> resume;
};

/// Result of scene.subscribe.
struct SubscribeReply {
  /// There when the request had `resume`: how many of the claimed tiles are current and are not sent again.
  std::optional<int> resumed_tiles;
  /// There when `resume` had `colours`: places in `tiles` of those whose colours are what the settings in force
  /// give, rounded to no fewer bits, so that they are not sent again either. Empty where nothing is known of the
  /// connection.
  std::optional<std::vector<std::uint32_t>> current_colours;
  /// There with `current_colours`: the generation that those colours count as. 0: there is no scene yet.
  std::optional<std::uint32_t> generation;
};

/// Params of the notification stream.ack.
struct StreamAck {
  /// Every frame up to this one is decoded.
  std::uint32_t sequence = 0;
};

/// Params of the notification stream.complete: all that camera and quality ask for has been sent.
struct StreamComplete {
  std::uint32_t generation = 0;
  std::uint32_t scene_revision = 0;
  std::uint64_t tiles = 0;
  std::uint64_t vertices = 0;
};

/// What is on the screen now.
struct StreamAccuracy {
  /// Largest error per axis. nullopt = null.
  std::optional<double> position_mm;
  /// Levels of a colour channel that can be told apart; coarse tiles count.
  int colour_levels = 256;
  /// nullopt = null.
  std::optional<double> pixel_error;
  /// Of temperatures, for 95 % of the surface; null: there are none.
  std::optional<double> temperature_celsius;
};

/// Params of the notification stream.stats.
struct StreamStats {
  /// null: not measured yet.
  std::optional<double> round_trip_ms;
  /// null: not measured yet.
  std::optional<double> throughput_bytes_per_s;
  std::uint64_t queued_bytes = 0;
  /// Superseded before they were sent.
  std::uint64_t skipped_frames = 0;
  /// Connected now.
  std::uint64_t viewers = 0;
  StreamAccuracy accuracy;
  /// Of the settings in force.
  std::uint32_t generation = 0;
  /// All that is to be drawn has been sent in that generation as it was in this revision of the scene, or later. Of
  /// a map that changes all the time it rises, while stream.complete hardly ever comes.
  std::uint32_t scene_revision = 0;
};

enum class StatusLevel { Info, Warning, Error };

/// Params of the notification status; the same id replaces, message null clears.
struct Status {
  std::string id;
  StatusLevel level = StatusLevel::Info;
  /// nullopt = null.
  std::optional<std::string> message;
};

extern template struct Wire<CameraSet>;
extern template struct Wire<ResumeRequest>;
extern template struct Wire<SubscribeRequest>;
extern template struct Wire<SubscribeReply>;
extern template struct Wire<StreamAck>;
extern template struct Wire<StreamComplete>;
extern template struct Wire<StreamAccuracy>;
extern template struct Wire<StreamStats>;
extern template struct Wire<Status>;

}  // namespace spectra::protocol
