#include "protocol/messages/query_messages.hpp"

#include "protocol/messages/fields.hpp"

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
  fields.require("bins", message.bins >= 1 && message.bins <= 4096, "an integer from 1 to 4096");
}

static void describe(auto& fields, Is<HistogramReply> auto& message) {
  fields.field("edges", message.edges);
  fields.field("counts", message.counts);
  fields.require("edges", message.edges.size() == message.counts.size() + (message.counts.empty() ? 0U : 1U),
                 "a list of one more than counts");
  fields.nullable("mean", message.mean);
  fields.nullable("sigma", message.sigma);
  fields.field("highlighted", message.highlighted);
  fields.optional("highlighted_share", message.highlighted_share);
}

static void describe(auto& fields, Is<ProbeRequest> auto& message) {
  fields.field("position", message.position);
  fields.require("position", are_float_coordinates(message.position), "a list of 3 numbers that fit a 32-bit float");
}

static void describe(auto& fields, Is<ProbeReply> auto& message) {
  fields.field("vertex_index", message.vertex_index);
  fields.field("position", message.position);
  fields.nullable("temperature", message.temperature);
  fields.optional("temperature_range", message.temperature_range);
  fields.field("visible", message.visible);
  fields.field("fused", message.fused);
  fields.field("distance", message.distance);
  fields.require("distance", message.distance >= 0, "a number not below 0");
  fields.nullable("observed_at", message.observed_at);
  fields.nullable("baseline", message.baseline);
  fields.nullable("baseline_at", message.baseline_at);
  fields.optional("temperature_sigma", message.temperature_sigma);
  fields.require("temperature_sigma", message.temperature_sigma.value_or(0) >= 0, "a number not below 0");
  fields.optional("temperature_at", message.temperature_at);
}

static void describe(auto& fields, Is<BaselineRequest> auto& message) {
  fields.field("action", message.action);
}

static void describe(auto& fields, Is<BaselineReply> auto& message) {
  fields.nullable("marked_at", message.marked_at);
  fields.field("revision", message.revision);
}

static void describe(auto& fields, Is<ExtremesRequest> auto& message) {
  fields.optional("camera", message.camera);
  fields.optional("window", message.window);
  const auto is_part = [](const std::array<double, 4>& w) {
    return w[0] >= 0 && w[0] < w[2] && w[2] <= 1 && w[1] >= 0 && w[1] < w[3] && w[3] <= 1;
  };
  fields.require("window", !message.window || is_part(*message.window),
                 "left, top, right and bottom from 0 to 1, left below right and top below bottom");
}

static void describe(auto& fields, Is<Extreme> auto& message) {
  fields.field("position", message.position);
  fields.field("temperature", message.temperature);
}

static void describe(auto& fields, Is<ExtremesReply> auto& message) {
  fields.nullable("hottest", message.hottest);
  fields.nullable("coldest", message.coldest);
  fields.optional("over_range", message.over_range);
  fields.optional("under_range", message.under_range);
}

static void describe(auto& fields, Is<FactsRequest> auto& message) {
  fields.optional("bins", message.bins);
  const std::uint32_t bins = message.bins.value_or(1);
  fields.require("bins", bins >= 1 && bins <= 4096, "an integer from 1 to 4096");
  fields.optional("hues", message.hues);
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
}

template struct Wire<FactsRequest>;
template struct Wire<FactsReply>;
template struct Wire<HistogramRequest>;
template struct Wire<HistogramReply>;
template struct Wire<ProbeRequest>;
template struct Wire<ProbeReply>;
template struct Wire<BaselineRequest>;
template struct Wire<BaselineReply>;
template struct Wire<ExtremesRequest>;
template struct Wire<Extreme>;
template struct Wire<ExtremesReply>;

}  // namespace spectra::protocol
