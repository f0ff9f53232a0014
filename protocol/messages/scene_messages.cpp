// Made by protocol/generate from protocol/schema. Not to be edited.
#include "protocol/messages/scene_messages.hpp"

#include "protocol/messages/fields.hpp"
#include "protocol/messages/rules.hpp"

namespace spectra::protocol {

template <>
std::span<const EnumWord<UpAxis>> words_of() {
  static constexpr EnumWord<UpAxis> kWords[] = {{UpAxis::X, "x"},       {UpAxis::Y, "y"},       {UpAxis::Z, "z"},
                                                {UpAxis::MinusX, "-x"}, {UpAxis::MinusY, "-y"}, {UpAxis::MinusZ, "-z"}};
  return kWords;
}

template <>
std::span<const EnumWord<Role>> words_of() {
  static constexpr EnumWord<Role> kWords[] = {{Role::Operator, "operator"}, {Role::Viewer, "viewer"}};
  return kWords;
}

static void describe(auto& fields, Is<SceneNote> auto& message) {
  fields.field("id", message.id);
  fields.field("count", message.count);
  fields.field("message", message.message);
  rules(fields, message);
}

static void describe(auto& fields, Is<Bounds> auto& message) {
  fields.field("min", message.min);
  fields.field("max", message.max);
  rules(fields, message);
}

static void describe(auto& fields, Is<SceneTemperature> auto& message) {
  fields.nullable("min", message.min);
  fields.nullable("max", message.max);
  fields.nullable("mean", message.mean);
  fields.nullable("sigma", message.sigma);
  fields.field("missing_count", message.missing_count);
  fields.field("over_range_count", message.over_range_count);
  fields.field("under_range_count", message.under_range_count);
  rules(fields, message);
}

static void describe(auto& fields, Is<SceneObserved> auto& message) {
  fields.nullable("oldest", message.oldest);
  fields.nullable("newest", message.newest);
  rules(fields, message);
}

static void describe(auto& fields, Is<SceneBaseline> auto& message) {
  fields.nullable("marked_at", message.marked_at);
  rules(fields, message);
}

static void describe(auto& fields, Is<SceneDescription> auto& message) {
  fields.field("name", message.name);
  fields.field("revision", message.revision);
  fields.field("vertex_count", message.vertex_count);
  fields.field("triangle_count", message.triangle_count);
  fields.field("point_cloud", message.point_cloud);
  fields.field("origin", message.origin);
  fields.field("bounds", message.bounds);
  fields.optional("core_bounds", message.core_bounds);
  fields.field("temperature", message.temperature);
  fields.field("tile_count", message.tile_count);
  fields.field("levels", message.levels);
  fields.field("position_step_m", message.position_step_m);
  fields.require(
      "position_step_m", [&] { return message.position_step_m > 0; }, "a number above 0");
  fields.field("up", message.up);
  fields.optional("metric", message.metric);
  fields.optional("live", message.live);
  fields.optional("observed", message.observed);
  fields.optional("baseline", message.baseline);
  fields.optional("has_temperature_sigma", message.has_temperature_sigma);
  fields.field("notes", message.notes);
  rules(fields, message);
}

static void describe(auto& fields, Is<SceneChanged> auto& message) {
  fields.field("scene", message.scene);
  rules(fields, message);
}

static void describe(auto& fields, Is<ServerInfo> auto& message) {
  fields.field("name", message.name);
  fields.field("version", message.version);
  rules(fields, message);
}

static void describe(auto& fields, Is<Limits> auto& message) {
  fields.field("max_message_bytes", message.max_message_bytes);
  fields.require(
      "max_message_bytes", [&] { return message.max_message_bytes >= 1U; }, "an integer not below 1");
  fields.field("max_depth", message.max_depth);
  fields.require(
      "max_depth", [&] { return message.max_depth >= 1U; }, "an integer from 1 to 4294967295");
  fields.field("max_requests_per_s", message.max_requests_per_s);
  fields.require(
      "max_requests_per_s", [&] { return message.max_requests_per_s > 0; }, "a number above 0");
  rules(fields, message);
}

static void describe(auto& fields, Is<Hello> auto& message) {
  fields.field("protocol", message.protocol);
  fields.require(
      "protocol", [&] { return message.protocol == "spectra.v1"; }, "\"spectra.v1\"");
  fields.field("server", message.server);
  fields.field("session_id", message.session_id);
  fields.field("role", message.role);
  fields.field("capabilities", message.capabilities);
  fields.field("limits", message.limits);
  fields.nullable("scene", message.scene);
  fields.optional("methods", message.methods);
  fields.optional("palettes", message.palettes);
  fields.optional("catalogue", message.catalogue);
  fields.field("fusion", message.fusion);
  fields.field("quality", message.quality);
  rules(fields, message);
}

static void describe(auto& fields, Is<Catalogue> auto& message) {
  fields.field("methods", message.methods);
  fields.field("palettes", message.palettes);
  rules(fields, message);
}

template struct Wire<SceneNote>;
template struct Wire<Bounds>;
template struct Wire<SceneTemperature>;
template struct Wire<SceneObserved>;
template struct Wire<SceneBaseline>;
template struct Wire<SceneDescription>;
template struct Wire<SceneChanged>;
template struct Wire<ServerInfo>;
template struct Wire<Limits>;
template struct Wire<Hello>;
template struct Wire<Catalogue>;

}  // namespace spectra::protocol
