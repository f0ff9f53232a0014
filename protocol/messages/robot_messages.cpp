// Made by protocol/generate from protocol/schema. Not to be edited.
#include "protocol/messages/robot_messages.hpp"

#include "protocol/messages/fields.hpp"
#include "protocol/messages/rules.hpp"

namespace spectra::protocol {

static void describe(auto& fields, Is<RobotPath> auto& message) {
  fields.field("first", message.first);
  fields.field("points", message.points);
  rules(fields, message);
}

static void describe(auto& fields, Is<RobotMoved> auto& message) {
  fields.field("at", message.at);
  fields.field("position", message.position);
  fields.field("forward", message.forward);
  fields.field("up", message.up);
  fields.optional("lost", message.lost);
  fields.field("path", message.path);
  rules(fields, message);
}

template struct Wire<RobotPath>;
template struct Wire<RobotMoved>;

}  // namespace spectra::protocol
