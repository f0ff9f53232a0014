// Made by protocol/generate from protocol/schema. Not to be edited.
#include "protocol/messages/query_messages.hpp"

#include "protocol/messages/fields.hpp"
#include "protocol/messages/rules.hpp"

namespace spectra::protocol {

template <>
std::span<const EnumWord<BeyondRange>> words_of() {
  static constexpr EnumWord<BeyondRange> kWords[] = {{BeyondRange::Over, "over"}, {BeyondRange::Under, "under"}};
  return kWords;
}

template <>
std::span<const EnumWord<BaselineAction>> words_of() {
  static constexpr EnumWord<BaselineAction> kWords[] = {{BaselineAction::Mark, "mark"}, {BaselineAction::Get, "get"}};
  return kWords;
}

static void describe(auto& fields, Is<HistogramRequest> auto& message) {
  fields.field("bins", message.bins);
  fields.require(
      "bins", [&] { return message.bins >= 1 && message.bins <= 4096; }, "an integer from 1 to 4096");
  rules(fields, message);
}

static void describe(auto& fields, Is<HistogramReply> auto& message) {
  fields.field("edges", message.edges);
  fields.field("counts", message.counts);
  fields.nullable("mean", message.mean);
  fields.nullable("sigma", message.sigma);
  fields.field("highlighted", message.highlighted);
  fields.optional("highlighted_share", message.highlighted_share);
  fields.require(
      "highlighted_share",
      [&] {
        return !message.highlighted_share || (*message.highlighted_share >= 0 && *message.highlighted_share <= 1);
      },
      "a number from 0 to 1");
  rules(fields, message);
}

static void describe(auto& fields, Is<ProbeRequest> auto& message) {
  fields.field("position", message.position);
  fields.require(
      "position",
      [&] {
        return each(message.position,
                    [](const auto& item) { return item >= -3.4028234663852886e+38 && item <= 3.4028234663852886e+38; });
      },
      "a list of 3 numbers that fit a 32-bit float");
  rules(fields, message);
}

static void describe(auto& fields, Is<ProbeReply> auto& message) {
  fields.field("vertex_index", message.vertex_index);
  fields.field("position", message.position);
  fields.nullable("temperature", message.temperature);
  fields.optional("temperature_range", message.temperature_range);
  fields.field("visible", message.visible);
  fields.field("fused", message.fused);
  fields.field("distance", message.distance);
  fields.require(
      "distance", [&] { return message.distance >= 0; }, "a number not below 0");
  fields.nullable("observed_at", message.observed_at);
  fields.nullable("baseline", message.baseline);
  fields.nullable("baseline_at", message.baseline_at);
  fields.optional("temperature_sigma", message.temperature_sigma);
  fields.require(
      "temperature_sigma", [&] { return !message.temperature_sigma || (*message.temperature_sigma >= 0); },
      "a number not below 0");
  fields.optional("temperature_at", message.temperature_at);
  rules(fields, message);
}

static void describe(auto& fields, Is<BaselineRequest> auto& message) {
  fields.field("action", message.action);
  rules(fields, message);
}

static void describe(auto& fields, Is<BaselineReply> auto& message) {
  fields.nullable("marked_at", message.marked_at);
  fields.field("revision", message.revision);
  rules(fields, message);
}

static void describe(auto& fields, Is<Extreme> auto& message) {
  fields.field("position", message.position);
  fields.field("temperature", message.temperature);
  rules(fields, message);
}

static void describe(auto& fields, Is<ExtremesRequest> auto& message) {
  fields.optional("camera", message.camera);
  fields.optional("window", message.window);
  fields.require(
      "window",
      [&] {
        return !message.window || (each(*message.window, [](const auto& item) { return item >= 0 && item <= 1; }));
      },
      "a list of 4 numbers from 0 to 1");
  rules(fields, message);
}

static void describe(auto& fields, Is<ExtremesReply> auto& message) {
  fields.nullable("hottest", message.hottest);
  fields.nullable("coldest", message.coldest);
  fields.optional("over_range", message.over_range);
  fields.optional("under_range", message.under_range);
  rules(fields, message);
}

static void describe(auto& fields, Is<FactsRequest> auto& message) {
  fields.optional("bins", message.bins);
  fields.require(
      "bins", [&] { return !message.bins || (*message.bins >= 1 && *message.bins <= 4096); },
      "an integer from 1 to 4096");
  fields.optional("hues", message.hues);
  rules(fields, message);
}

static void describe(auto& fields, Is<FactsReply> auto& message) {
  fields.field("finite_count", message.finite_count);
  fields.field("missing_count", message.missing_count);
  fields.field("over_range_count", message.over_range_count);
  fields.field("under_range_count", message.under_range_count);
  fields.field("min", message.min);
  fields.field("max", message.max);
  fields.field("mean", message.mean);
  fields.field("sigma", message.sigma);
  fields.optional("counts", message.counts);
  fields.optional("hues", message.hues);
  rules(fields, message);
}

template struct Wire<HistogramRequest>;
template struct Wire<HistogramReply>;
template struct Wire<ProbeRequest>;
template struct Wire<ProbeReply>;
template struct Wire<BaselineRequest>;
template struct Wire<BaselineReply>;
template struct Wire<Extreme>;
template struct Wire<ExtremesRequest>;
template struct Wire<ExtremesReply>;
template struct Wire<FactsRequest>;
template struct Wire<FactsReply>;

}  // namespace spectra::protocol
