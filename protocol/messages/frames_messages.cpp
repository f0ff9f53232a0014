// Made by protocol/generate from protocol/schema. Not to be edited.
#include "protocol/messages/frames_messages.hpp"

#include "protocol/messages/fields.hpp"
#include "protocol/messages/rules.hpp"

namespace spectra::protocol {

template <>
std::span<const EnumWord<FramesKind>> words_of() {
  static constexpr EnumWord<FramesKind> kWords[] = {{FramesKind::Calibration, "calibration"},
                                                    {FramesKind::Poses, "poses"},
                                                    {FramesKind::CorrectedPoses, "corrected_poses"},
                                                    {FramesKind::Picture, "picture"},
                                                    {FramesKind::End, "end"}};
  return kWords;
}

template <>
std::span<const EnumWord<FrameSensor>> words_of() {
  static constexpr EnumWord<FrameSensor> kWords[] = {
      {FrameSensor::Depth, "depth"}, {FrameSensor::Color, "color"}, {FrameSensor::Thermal, "thermal"}};
  return kWords;
}

template <>
std::span<const EnumWord<FrameEncoding>> words_of() {
  static constexpr EnumWord<FrameEncoding> kWords[] = {
      {FrameEncoding::Png, "png"}, {FrameEncoding::Jpeg, "jpeg"}, {FrameEncoding::Raw16, "raw16"}};
  return kWords;
}

static void describe(auto& fields, Is<FrameHead> auto& message) {
  fields.field("kind", message.kind);
  fields.field("sequence", message.sequence);
  fields.require(
      "sequence", [&] { return message.sequence >= 1U; }, "an integer not below 1");
  fields.optional("time", message.time);
  fields.optional("sensor", message.sensor);
  fields.optional("encoding", message.encoding);
  fields.optional("width", message.width);
  fields.require(
      "width", [&] { return !message.width || (*message.width >= 1 && *message.width <= 8192); },
      "an integer from 1 to 8192");
  fields.optional("height", message.height);
  fields.require(
      "height", [&] { return !message.height || (*message.height >= 1 && *message.height <= 8192); },
      "an integer from 1 to 8192");
  fields.unless_empty("poses", message.poses);
  fields.require(
      "poses", [&] { return each(message.poses, [](const auto& item) { return item.size() == 8; }); },
      "a list of poses of 8 numbers");
  rules(fields, message);
}

static void describe(auto& fields, Is<FramesCredit> auto& message) {
  fields.field("messages", message.messages);
  fields.field("bytes", message.bytes);
  rules(fields, message);
}

static void describe(auto& fields, Is<FramesLimits> auto& message) {
  fields.field("max_message_bytes", message.max_message_bytes);
  fields.field("max_head_bytes", message.max_head_bytes);
  rules(fields, message);
}

static void describe(auto& fields, Is<FramesHello> auto& message) {
  fields.field("protocol", message.protocol);
  fields.field("limits", message.limits);
  fields.field("credit", message.credit);
  rules(fields, message);
}

static void describe(auto& fields, Is<FramesTaken> auto& message) {
  fields.field("sequence", message.sequence);
  fields.optional("skipped", message.skipped);
  fields.optional("pictures_per_s", message.pictures_per_s);
  fields.require(
      "pictures_per_s", [&] { return !message.pictures_per_s || (*message.pictures_per_s > 0); }, "a number above 0");
  fields.field("credit", message.credit);
  rules(fields, message);
}

static void describe(auto& fields, Is<FramesRefused> auto& message) {
  fields.field("sequence", message.sequence);
  fields.field("code", message.code);
  fields.field("field", message.field);
  fields.field("reason", message.reason);
  fields.field("credit", message.credit);
  rules(fields, message);
}

template struct Wire<FrameHead>;
template struct Wire<FramesCredit>;
template struct Wire<FramesLimits>;
template struct Wire<FramesHello>;
template struct Wire<FramesTaken>;
template struct Wire<FramesRefused>;

}  // namespace spectra::protocol
