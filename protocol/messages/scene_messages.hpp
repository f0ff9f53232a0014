#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/messages/fusion_messages.hpp"
#include "protocol/messages/message.hpp"
#include "protocol/messages/quality_messages.hpp"

namespace spectra::protocol {

/// x, y, z in metres.
using Vector3 = std::array<double, 3>;

/// Smallest and largest coordinates, metres relative to the scene origin.
struct Bounds {
  Vector3 min{};
  Vector3 max{};
};

/// Facts of all temperatures, degC; nullopt = null: no thermal data.
struct SceneTemperature {
  std::optional<double> min;
  std::optional<double> max;
  std::optional<double> mean;
  std::optional<double> sigma;  ///< Population standard deviation.
  std::uint64_t missing_count = 0;
  std::uint64_t over_range_count = 0;  ///< Hotter than the sensor could tell; in no other fact.
  std::uint64_t under_range_count = 0;
};

/// Something that was repaired, left out or interpreted while the scene was read.
struct SceneNote {
  std::string id;  ///< snake_case, stable.
  std::uint64_t count = 0;
  std::string message;  ///< One sentence for a person, with the count.
};

/// The direction that is up in the scene's coordinates.
enum class UpAxis { X, Y, Z, MinusX, MinusY, MinusZ };

/// When parts of the scene were seen, Unix seconds; nullopt = null: of no part that is known.
struct SceneObserved {
  std::optional<double> oldest;
  std::optional<double> newest;
};

/// What temperatures are compared with.
struct SceneBaseline {
  std::optional<double> marked_at;  ///< Unix seconds; null = never: with what they were when first seen.
};

/// SCENE: what is served.
struct SceneDescription {
  std::string name;
  std::uint32_t revision = 0;
  std::uint64_t vertex_count = 0;
  std::uint64_t triangle_count = 0;
  bool point_cloud = false;
  Vector3 origin{};  ///< In the coordinates of the input file.
  Bounds bounds;
  std::optional<Bounds> core_bounds;  ///< Without strays; absent: unknown.
  SceneTemperature temperature;
  std::uint64_t tile_count = 0;
  std::uint32_t levels = 0;
  double position_step_m = 0;  ///< Default step of the positions, the largest where tiles differ; above 0.
  UpAxis up = UpAxis::Z;
  std::optional<bool> metric;  ///< Positions are known to be in metres; else they are taken for it.
  std::optional<bool> live;    ///< A map that began empty and is expected to grow.
  std::optional<SceneObserved> observed;
  std::optional<SceneBaseline> baseline;  ///< Absent: the scene does not remember, as a file.
  std::vector<SceneNote> notes;           ///< What loading noticed.
};

/// Params of scene.changed.
struct SceneChanged {
  SceneDescription scene;
};

struct ServerInfo {
  std::string name;
  std::string version;
};

/// What a client must keep to.
struct Limits {
  std::uint64_t max_message_bytes = 64 * 1024;
  std::uint32_t max_depth = 16;
  double max_requests_per_s = 0;  ///< Above 0.
};

enum class Role { Operator, Viewer };

inline constexpr const char* kProtocolName = "spectra.v1";

/// Methods and palettes: the same for every viewer of a server. What is found where Hello::catalogue says.
struct Catalogue {
  std::vector<MethodDescription> methods;
  std::vector<PaletteDescription> palettes;
};

/// Params of hello, the first message of every connection. Either it holds methods and palettes, or it is brief and tells
/// where they are.
struct Hello {
  std::string protocol = kProtocolName;
  ServerInfo server;
  std::string session_id;
  Role role = Role::Viewer;
  std::vector<std::string> capabilities;
  Limits limits;
  std::optional<SceneDescription> scene;  ///< null: none yet.
  std::optional<std::vector<MethodDescription>> methods;
  std::optional<std::vector<PaletteDescription>> palettes;
  std::optional<std::string> catalogue;  ///< Path of a Catalogue over HTTP, relative to the folder of /ws.
  FusionState fusion;
  QualityState quality;
};

extern template struct Wire<Bounds>;
extern template struct Wire<SceneTemperature>;
extern template struct Wire<SceneNote>;
extern template struct Wire<SceneDescription>;
extern template struct Wire<SceneChanged>;
extern template struct Wire<ServerInfo>;
extern template struct Wire<Limits>;
extern template struct Wire<Catalogue>;
extern template struct Wire<Hello>;

}  // namespace spectra::protocol
