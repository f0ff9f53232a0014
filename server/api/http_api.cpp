#include "server/api/http_api.hpp"

#include <spdlog/spdlog.h>

#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include "fusion/fusion_plan.hpp"
#include "protocol/messages/scene_messages.hpp"
#include "server/api/metrics_text.hpp"
#include "server/exports/fused_file.hpp"
#include "server/jobs/priority.hpp"
#include "server/session/conversions.hpp"
#include "server/session/settings_text.hpp"

namespace spectra::api {
namespace {

constexpr std::string_view kExportPrefix = "/api/v1/scene.";

net::HttpReply json_error(unsigned status, std::string_view field, std::string_view message) {
  const nlohmann::json body{{"error", {{"field", field}, {"message", message}}}};
  return net::text_reply(status, body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n",
                         "application/json");
}

net::HttpReply no_scene_reply() {
  auto reply = json_error(503, "", "there is no scene yet");
  reply.headers.emplace_back("Retry-After", "2");
  return reply;
}

net::HttpReply reply_of(const exports::ExportShelf::SharedFile& file, const net::RequestTarget& target,
                        exports::SceneFileFormat format) {
  net::HttpReply reply{200, std::string(exports::content_type_of(format)), {file, &file->bytes}, {}};
  if (!file->losses.empty()) reply.headers.emplace_back("Spectra-Note", file->losses);
  reply.headers.emplace_back("Content-Disposition",
                             "attachment; filename=\"" + target.path.substr(target.path.rfind('/') + 1) + '"');
  return reply;
}

/// What was asked for, of which version of the scene.
std::string key_of(const net::RequestTarget& target, const map::SceneSnapshot& scene) {
  std::string key = std::to_string(scene.revision()) + target.path;
  for (const auto& [name, value] : target.query) key += '\n' + name + '\n' + value;
  return key;
}

/// What was lost, on one line.
std::string losses_of(const exports::SceneFile& file) {
  std::string losses;
  for (const auto& loss : file.losses) losses += (losses.empty() ? "" : " | ") + loss.message;
  return losses;
}

session::SettingsText settings_text_of(const net::RequestTarget& target) {
  session::SettingsText text;
  for (const auto& [name, value] : target.query) {
    if (name == "method") {
      text.method = value;
    } else if (name == "palette") {
      text.palette = value;
    } else if (name == "range") {
      text.range = value;
    } else if (name == "missing") {
      text.missing = value;
    } else {
      text.params.emplace_back(name, value);
    }
  }
  return text;
}

base::Result<bool> flag_from_text(const std::string& name, const std::string& text) {
  if (text == "true" || text == "false") return text == "true";
  return base::failure(base::ErrorCode::WrongType, name + " is \"" + text + "\"; it must be true or false", name);
}

/// What the query says of the file, and not of the fusion; taken out of the query.
base::Result<exports::SceneFileOptions> file_options_of(net::RequestTarget& target, exports::SceneFileFormat format) {
  exports::SceneFileOptions options;
  options.format = format;
  bool keep_order = false;
  bool is_lossless = false;
  for (const auto& [name, value] : target.query) {
    if (name != "keep_order" && name != "lossless") continue;
    BOOST_OUTCOME_TRY(const bool is_wanted, flag_from_text(name, value));
    (name == "lossless" ? is_lossless : keep_order) = is_wanted;
  }
  std::erase_if(target.query,
                [](const auto& entry) { return entry.first == "keep_order" || entry.first == "lossless"; });
  if (keep_order) options.keeping = protocol::codec::DracoKeeping::Order;
  if (is_lossless) options.keeping = protocol::codec::DracoKeeping::Everything;
  return options;
}

base::Result<exports::SceneFile> fused_export(const map::SceneSnapshot& scene, const fusion::FusionSettings& settings,
                                              exports::SceneFileOptions options) {
  BOOST_OUTCOME_TRY(const auto plan, fusion::FusionPlan::prepare(settings, scene.temperature()));
  auto mesh = scene.whole_mesh();
  const bool is_rounded =
      options.format == exports::SceneFileFormat::Draco && options.keeping != protocol::codec::DracoKeeping::Everything;
  if (is_rounded) {
    BOOST_OUTCOME_TRYV(exports::round_for_file(scene, mesh, options));
  }
  return exports::scene_file(mesh, exports::fused_colours(mesh, plan, scene.whole_baseline()), options);
}

}  // namespace

HttpApi::HttpApi(session::ServedScene& served, sources::MapKeeper& map, const net::NetLimits& limits)
    : served_(served), exports_(limits.exports_at_once, limits.export_bytes), blocks_(served, map, exports_) {}

void HttpApi::handle(const net::HttpRequest& request, const std::function<void(net::HttpReply)>& reply) {
  const std::string& path = request.target.path;
  if (path == "/healthz") return reply(net::text_reply(200, "alive\n"));
  if (path == "/readyz") {
    if (served_.scenes.current()) return reply(net::text_reply(200, "ready\n"));
    return reply(net::text_reply(503, served_.progress.message().value_or("no scene") + "\n"));
  }
  if (path == "/metrics") {
    return reply(net::text_reply(200, metrics_text(served_, blocks_.map(), *net_metrics_),
                                 "text/plain; version=0.0.4; charset=utf-8"));
  }
  if (path == "/api/v1/scene") {
    const auto scene = served_.scenes.current();
    if (!scene) return reply(no_scene_reply());
    return reply(
        net::text_reply(200, protocol::to_json(session::to_message(*scene)).dump() + "\n", "application/json"));
  }
  if (path == session::Catalogue::kPath || path.starts_with(std::string(session::Catalogue::kPath) + '/')) {
    return reply(served_.catalogue.reply(request));
  }
  if (path == net::kBlocksPath || path.starts_with(std::string(net::kBlocksPath) + '/'))
    return blocks_.handle(request, reply);
  if (path.starts_with(kExportPrefix)) return handle_export(request.target, reply);
  reply(net::text_reply(404, "not found\n"));
}

void HttpApi::handle_export(net::RequestTarget target, const std::function<void(net::HttpReply)>& reply) {
  const auto format = exports::scene_file_format(target.path);
  if (!format || target.path.size() != kExportPrefix.size() + 3) return reply(net::text_reply(404, "not found\n"));
  const net::RequestTarget asked = target;
  const auto file_options = file_options_of(target, *format);
  if (!file_options) return reply(json_error(400, file_options.error().field, file_options.error().message));
  const auto settings = session::settings_from_text(settings_text_of(target));
  if (!settings) return reply(json_error(400, settings.error().field, settings.error().message));
  const auto scene = served_.scenes.current();
  if (!scene) return reply(no_scene_reply());
  const std::string key = key_of(asked, *scene);
  if (const auto file = exports_.find(key)) return reply(reply_of(file, asked, *format));
  exports::ExportShelf::Slot slot = exports_.take();
  if (!slot) {
    auto busy = json_error(503, "", "other exports are being made already, or too much is being sent");
    busy.headers.emplace_back("Retry-After", "5");
    return reply(std::move(busy));
  }
  served_.pool.post(
      [this, slot = std::move(slot), scene, settings = settings.value(), options = file_options.value(), reply, asked,
       key]() mutable {
        try {
          auto file = fused_export(*scene, settings, options);
          if (!file) return reply(json_error(400, file.error().field, file.error().message));
          std::string losses = losses_of(file.value());
          const auto kept = exports_.keep(key, {std::move(file.value().bytes), std::move(losses)});
          slot.reset();  // Whoever asks for another as soon as this one is there is not told that it is being made.
          reply(reply_of(kept, asked, options.format));
        } catch (const std::exception& error) {
          spdlog::error("an export failed: {}", error.what());
          reply(json_error(500, "", "the export failed"));
        }
      },
      jobs::kExportPriority);
}

}  // namespace spectra::api
