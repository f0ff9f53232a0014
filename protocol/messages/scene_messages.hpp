// Made by protocol/generate from protocol/schema. Not to be edited.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "protocol/messages/fusion_messages.hpp"
#include "protocol/messages/message.hpp"
#include "protocol/messages/quality_messages.hpp"

/// Scene and hello.
namespace spectra::protocol {

/// Something that was repaired, left out or interpreted while the scene was read.
struct SceneNote {
  /// snake_case, stable.
  std::string id;
  std::uint64_t count = 0;
  /// One sentence for a person, with the count.
  std::string message;
};

/// x, y, z, metres relative to the scene origin
using Position = std::array<double, 3>;

/// x, y, z, metres
using Vector3 = std::array<double, 3>;

/// Smallest and largest coordinates, metres relative to the scene origin.
struct Bounds {
  Vector3 min{};
  Vector3 max{};
};

/// Facts of all temperatures of the scene, degC; null without thermal data.
struct SceneTemperature {
  /// nullopt = null.
  std::optional<double> min;
  /// nullopt = null.
  std::optional<double> max;
  /// nullopt = null.
  std::optional<double> mean;
  /// Population standard deviation. nullopt = null.
  std::optional<double> sigma;
  /// Vertices without temperature.
  std::uint64_t missing_count = 0;
  /// Vertices hotter than the sensor could tell; in no other fact.
  std::uint64_t over_range_count = 0;
  /// Vertices colder than the sensor could tell.
  std::uint64_t under_range_count = 0;
};

enum class UpAxis { X, Y, Z, MinusX, MinusY, MinusZ };

/// When parts of the scene were seen, Unix seconds; of the parts of which that is known.
struct SceneObserved {
  /// nullopt = null.
  std::optional<double> oldest;
  /// nullopt = null.
  std::optional<double> newest;
};

/// What temperatures are compared with.
struct SceneBaseline {
  /// When the baseline was marked, Unix seconds; null = never: each vertex is compared with what it was when first
  /// seen.
  std::optional<double> marked_at;
};

/// SCENE: what is served. origin: metres, double precision, in the coordinates of the input file. core_bounds:
/// bounds without the few vertices that lie far from everything else.
struct SceneDescription {
  std::string name;
  /// Rises with every change of the scene.
  std::uint32_t revision = 0;
  std::uint64_t vertex_count = 0;
  std::uint64_t triangle_count = 0;
  bool point_cloud = false;
  Vector3 origin{};
  Bounds bounds;
  std::optional<Bounds> core_bounds;
  SceneTemperature temperature;
  std::uint64_t tile_count = 0;
  /// Levels of the tile tree.
  std::uint32_t levels = 0;
  /// Default step of the positions, metres; the largest where tiles differ.
  double position_step_m = 0;
  UpAxis up = UpAxis::Z;
  /// Whether somebody (the file, or who serves it) has said that positions are in metres; otherwise they are taken
  /// for it. Absent: unknown.
  std::optional<bool> metric;
  /// A map that began empty and is expected to grow.
  std::optional<bool> live;
  std::optional<SceneObserved> observed;
  /// Absent in a scene that does not remember, as a file.
  std::optional<SceneBaseline> baseline;
  /// Of some vertices it is known how sure their temperature is. Absent: of none.
  std::optional<bool> has_temperature_sigma;
  /// What loading noticed.
  std::vector<SceneNote> notes;
};

/// Params of the notification scene.changed.
struct SceneChanged {
  SceneDescription scene;
};

/// Who serves.
struct ServerInfo {
  std::string name;
  std::string version;
};

/// What a client must keep to.
struct Limits {
  /// Largest text message from a client; a larger one closes with 1009.
  std::uint64_t max_message_bytes = 65536;
  /// Deepest nesting of JSON.
  std::uint32_t max_depth = 16;
  /// More are answered with -32003.
  double max_requests_per_s = 0;
};

enum class Role { Operator, Viewer };

/// Params of the notification hello, the first message of every connection.
struct Hello {
  std::string protocol = "spectra.v1";
  ServerInfo server;
  /// Opaque; see "Resuming after a drop-out".
  std::string session_id;
  Role role = Role::Viewer;
  /// Names of optional parts that this server has.
  std::vector<std::string> capabilities;
  Limits limits;
  /// null: no scene yet.
  std::optional<SceneDescription> scene;
  /// Absent in the brief form.
  std::optional<std::vector<MethodDescription>> methods;
  /// Absent in the brief form.
  std::optional<std::vector<PaletteDescription>> palettes;
  /// Of the brief form only: where methods and palettes are, a path relative to the folder of `/ws`.
  std::optional<std::string> catalogue;
  FusionState fusion;
  QualityState quality;
};

/// Body of GET /api/v1/catalogue: methods and palettes, the same for every viewer of a server.
struct Catalogue {
  std::vector<MethodDescription> methods;
  std::vector<PaletteDescription> palettes;
};

extern template struct Wire<SceneNote>;
extern template struct Wire<Bounds>;
extern template struct Wire<SceneTemperature>;
extern template struct Wire<SceneObserved>;
extern template struct Wire<SceneBaseline>;
extern template struct Wire<SceneDescription>;
extern template struct Wire<SceneChanged>;
extern template struct Wire<ServerInfo>;
extern template struct Wire<Limits>;
extern template struct Wire<Hello>;
extern template struct Wire<Catalogue>;

}  // namespace spectra::protocol
