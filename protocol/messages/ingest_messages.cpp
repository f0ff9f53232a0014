// Made by protocol/generate from protocol/schema. Not to be edited.
#include "protocol/messages/ingest_messages.hpp"

#include "protocol/messages/fields.hpp"
#include "protocol/messages/rules.hpp"

namespace spectra::protocol {

static void describe(auto& fields, Is<IngestCredit> auto& message) {
  fields.field("blocks", message.blocks);
  fields.field("bytes", message.bytes);
  rules(fields, message);
}

static void describe(auto& fields, Is<IngestLimits> auto& message) {
  fields.field("max_block_bytes", message.max_block_bytes);
  fields.field("max_target_bytes", message.max_target_bytes);
  rules(fields, message);
}

static void describe(auto& fields, Is<IngestHello> auto& message) {
  fields.field("protocol", message.protocol);
  fields.field("limits", message.limits);
  fields.field("credit", message.credit);
  rules(fields, message);
}

static void describe(auto& fields, Is<IngestAcknowledged> auto& message) {
  fields.field("sequence", message.sequence);
  fields.require(
      "sequence", [&] { return message.sequence >= 1U; }, "an integer not below 1");
  fields.field("revision", message.revision);
  fields.unless_empty("notes", message.notes);
  fields.field("credit", message.credit);
  rules(fields, message);
}

static void describe(auto& fields, Is<IngestRefused> auto& message) {
  fields.field("sequence", message.sequence);
  fields.require(
      "sequence", [&] { return message.sequence >= 1U; }, "an integer not below 1");
  fields.field("code", message.code);
  fields.field("field", message.field);
  fields.field("reason", message.reason);
  fields.unless_empty("limits", message.limits);
  fields.field("credit", message.credit);
  rules(fields, message);
}

template struct Wire<IngestCredit>;
template struct Wire<IngestLimits>;
template struct Wire<IngestHello>;
template struct Wire<IngestAcknowledged>;
template struct Wire<IngestRefused>;

}  // namespace spectra::protocol
