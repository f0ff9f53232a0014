#include "server/session/scene_questions.hpp"

#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "fusion/age.hpp"
#include "fusion/registry.hpp"
#include "protocol/messages/query_messages.hpp"
#include "server/session/conversions.hpp"
#include "server/session/refusals.hpp"

namespace spectra::session {
using nlohmann::json;
using protocol::refusal;
using protocol::Result;
using protocol::RpcErrorCode;

namespace {

/// Of an answer as text, at most: anything but bins, and a bin with its edge and its count.
constexpr std::size_t kSmallAnswerBytes = 4096;
constexpr std::size_t kBinBytes = 48;

}  // namespace

Result<SceneQuestion> histogram_question(const json& params, const AskedAbout& about) {
  const auto request = protocol::from_json<protocol::HistogramRequest>(params);
  if (!request) return refused(request.error());
  if (!about.scene) return no_scene();
  const auto bins = static_cast<std::uint32_t>(request.value().bins);
  return SceneQuestion{kSmallAnswerBytes + std::size_t{bins} * kBinBytes,
                       [scene = about.scene, plan = *about.plan, bins]() -> Result<json> {
                         const auto& temperature = scene->temperature();
                         const auto counted =
                             temperature.summary.has_temperature() ? temperature.histogram(bins) : fusion::Histogram{};
                         const bool highlights = fusion::find_method(plan.settings().method)->highlights;
                         const auto share = highlights ? std::optional(scene->highlighted_share(plan)) : std::nullopt;
                         return protocol::to_json(to_message(counted, temperature.summary, plan.highlighted(), share));
                       }};
}

Result<SceneQuestion> facts_question(const json& params, const AskedAbout& about) {
  const auto request = protocol::from_json<protocol::FactsRequest>(params);
  if (!request) return refused(request.error());
  if (!about.scene) return no_scene();
  const auto bins =
      request.value().bins ? std::optional(static_cast<std::uint32_t>(*request.value().bins)) : std::nullopt;
  // With what plans are prepared, which follows a live map in steps.
  const std::size_t size_bytes =
      kSmallAnswerBytes + (std::size_t{bins.value_or(0)} + fusion::Hues::kSectors) * kBinBytes;
  return SceneQuestion{
      size_bytes,
      [temperature = about.scene->reference_temperature(), bins, request = request.value()]() -> Result<json> {
        protocol::FactsReply reply = facts_message(temperature->summary);
        if (bins && temperature->summary.has_temperature()) reply.counts = temperature->histogram(*bins).counts;
        if (bins && !reply.counts) reply.counts.emplace(*bins, 0);
        if (request.hues.value_or(false)) {
          const auto chroma = temperature->hues().chroma;
          reply.hues.emplace(chroma.begin(), chroma.end());
        }
        return protocol::to_json(reply);
      }};
}

Result<SceneQuestion> probe_question(const json& params, const AskedAbout& about) {
  const auto request = protocol::from_json<protocol::ProbeRequest>(params);
  if (!request) return refused(request.error());
  if (!about.scene) return no_scene();
  const auto& p = request.value().position;
  const base::Vec3f position{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
  return SceneQuestion{
      kSmallAnswerBytes, [scene = about.scene, plan = *about.plan, position, now_s = about.now_s]() -> Result<json> {
        const auto found = scene->probe(position);
        if (!found) return refusal(RpcErrorCode::NoScene, "the scene has no vertex");
        const float celsius = found->temperature_celsius.value_or(std::numeric_limits<float>::quiet_NaN());
        base::Rgb8 fused;
        const float baseline = found->baseline_celsius.value_or(std::numeric_limits<float>::quiet_NaN());
        std::uint8_t freshness = fusion::AgeSteps::kFresh;
        if (const auto& age = plan.settings().age; age.mode == fusion::AgeMode::Fade && found->observed_at) {
          freshness = fusion::AgeSteps(age.half_life_s).freshness(now_s - *found->observed_at);
        }
        plan.fuse({{&celsius, 1}, {&found->visible, 1}, {&baseline, 1}, {&freshness, 1}}, {&fused, 1});
        return protocol::to_json(to_message(*found, fused));
      }};
}

Result<SceneQuestion> extremes_question(const json& params, const AskedAbout& about) {
  const auto request = protocol::from_json<protocol::ExtremesRequest>(params);
  if (!request) return refused(request.error());
  if (!about.scene) return no_scene();
  return SceneQuestion{kSmallAnswerBytes, [scene = about.scene, request = request.value()]() -> Result<json> {
                         return protocol::to_json(extremes_message(*scene, request));
                       }};
}

}  // namespace spectra::session
