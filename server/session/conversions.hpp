#pragma once

#include <optional>
#include <string>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/colour/palette.hpp"
#include "fusion/fusion_plan.hpp"
#include "fusion/method.hpp"
#include "fusion/settings.hpp"
#include "fusion/statistics/temperature_statistics.hpp"
#include "protocol/messages/fusion_messages.hpp"
#include "protocol/messages/quality_messages.hpp"
#include "protocol/messages/query_messages.hpp"
#include "protocol/messages/scene_messages.hpp"
#include "protocol/messages/stream_messages.hpp"
#include "protocol/rpc_error.hpp"
#include "server/map/scene_snapshot.hpp"
#include "server/stream/camera.hpp"
#include "server/stream/stream_quality.hpp"
#include "server/stream/stream_report.hpp"
#include "server/stream/subscription.hpp"

/// The one place that translates between what the fusion library, the scene and the streams know and what goes over
/// the wire.
namespace spectra::session {

protocol::MethodDescription to_message(const fusion::Method& method);
protocol::PaletteDescription to_message(const fusion::Palette& palette);
std::vector<protocol::MethodDescription> method_messages();
std::vector<protocol::PaletteDescription> palette_messages();

/// The settings of a plan and what they amount to in the scene it was made for.
protocol::FusionState to_message(const fusion::FusionPlan& plan, const fusion::TemperatureSummary& scene);

/// What a client asks to change. Types and bounds of the parameters are checked by fusion::with_change(), against the
/// schema of the method that then holds.
protocol::Result<fusion::FusionChange> from_message(const protocol::FusionChange& message);

/// Why a palette suits a method badly, in words that say what to do; nothing where it does not.
std::optional<std::string> palette_warning(const fusion::Method& method, const fusion::Palette* palette);
/// The same of one that does not tell two directions apart.
std::optional<std::string> direction_warning(const fusion::Method& method, const fusion::Palette* palette);

/// InvalidParams with the field of the error; `is_known_method` tells a parameter's name from the other fields.
protocol::RpcError to_rpc_error(const base::Error& error);

protocol::SceneTemperature to_message(const fusion::TemperatureSummary& summary);
protocol::SceneDescription to_message(const map::SceneSnapshot& scene);
/// Without histogram and hues.
protocol::FactsReply facts_message(const fusion::TemperatureSummary& summary);
protocol::HistogramReply to_message(const fusion::Histogram& histogram, const fusion::TemperatureSummary& scene,
                                    const std::vector<fusion::TemperatureInterval>& highlighted,
                                    std::optional<double> highlighted_share);
protocol::ProbeReply to_message(const map::Probe& probe, base::Rgb8 fused);
protocol::ExtremesReply extremes_message(const map::SceneSnapshot& scene);
/// Of what the camera of the request sees, where it has one.
protocol::ExtremesReply extremes_message(const map::SceneSnapshot& scene, const protocol::ExtremesRequest& request);

protocol::QualityState to_message(const stream::StreamQuality& quality);

/// `quality` with the change; refuses what this server does not do.
protocol::Result<stream::StreamQuality> with_change(const stream::StreamQuality& quality,
                                                    const protocol::QualityChange& change);

stream::Camera from_message(const protocol::CameraSet& message);
protocol::StreamComplete to_message(const stream::StreamComplete& complete);

}  // namespace spectra::session
