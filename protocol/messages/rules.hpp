#pragma once

#include "protocol/messages/fields.hpp"
#include "protocol/messages/frames_messages.hpp"
#include "protocol/messages/fusion_messages.hpp"
#include "protocol/messages/query_messages.hpp"
#include "protocol/messages/scene_messages.hpp"
#include "protocol/messages/stream_messages.hpp"

/// What a schema cannot say: how the fields of one message depend on each other. The generated `describe` asks for the rules after it
/// has told the fields; most have none.
namespace spectra::protocol {

void rules(auto&, auto&) {}

void rules(auto& fields, Is<RangeChange> auto& range) {
  const bool is_manual = range.mode == RangeMode::Manual;
  fields.require(
      "min", [&] { return !is_manual || range.min; }, "a number (degC) for a manual range");
  fields.require(
      "max", [&] { return !is_manual || range.max; }, "a number (degC) for a manual range");
  fields.require(
      "max", [&] { return !is_manual || range.min <= range.max; }, "a number not below min");
}

void rules(auto& fields, Is<ChangeScale> auto& scale) {
  fields.require(
      "max", [&] { return scale.min < scale.max; }, "a number above min");
}

void rules(auto& fields, Is<Hello> auto& hello) {
  fields.require(
      "methods", [&] { return hello.methods || hello.catalogue; }, "a list, where catalogue is absent");
  fields.require(
      "palettes", [&] { return hello.palettes || hello.catalogue; }, "a list, where catalogue is absent");
}

void rules(auto& fields, Is<HistogramReply> auto& histogram) {
  fields.require(
      "edges", [&] { return histogram.edges.size() == histogram.counts.size() + (histogram.counts.empty() ? 0U : 1U); },
      "a list of one more than counts");
}

void rules(auto& fields, Is<ExtremesRequest> auto& request) {
  const auto is_part = [](const std::array<double, 4>& w) { return w[0] < w[2] && w[1] < w[3]; };
  fields.require(
      "window", [&] { return !request.window || is_part(*request.window); }, "left below right and top below bottom");
}

void rules(auto& fields, Is<FrameHead> auto& head) {
  constexpr std::uint64_t kLargestSequence = (std::uint64_t{1} << 53U) - 1;
  fields.require(
      "sequence", [&] { return head.sequence <= kLargestSequence; }, "an integer from 1 to 2^53 - 1");
  const bool is_picture = head.kind == FramesKind::Picture;
  fields.require(
      "time", [&] { return !is_picture || head.time; }, "the stamp of the picture, seconds");
  fields.require(
      "sensor", [&] { return !is_picture || head.sensor; }, "depth, color or thermal");
  fields.require(
      "encoding", [&] { return !is_picture || head.encoding; }, "png, jpeg or raw16");
  const bool is_raw = is_picture && head.encoding == FrameEncoding::Raw16;
  fields.require(
      "width", [&] { return !is_raw || head.width; }, "an integer from 1 to 8192");
  fields.require(
      "height", [&] { return !is_raw || head.height; }, "an integer from 1 to 8192");
}

void rules(auto& fields, Is<ResumeRequest> auto& resume) {
  const auto is_claim = [&](std::uint32_t place) { return place < resume.tiles.size(); };
  fields.require(
      "raw", [&] { return !resume.raw || each(*resume.raw, is_claim); }, "a list of places in tiles, from 0");
  fields.require(
      "temperature_sigma", [&] { return !resume.temperature_sigma || each(*resume.temperature_sigma, is_claim); },
      "a list of places in tiles, from 0");
  const auto is_of_a_claim = [&](const std::array<std::uint32_t, 2>& pair) { return is_claim(pair[0]); };
  fields.require(
      "colours", [&] { return !resume.colours || each(*resume.colours, is_of_a_claim); },
      "a list of pairs of a place in tiles, from 0, and a sequence");
}

}  // namespace spectra::protocol
