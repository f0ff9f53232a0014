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

namespace spectra::server {
namespace {

constexpr std::string_view kExportPrefix = "/api/v1/scene.";

HttpReply json_error(unsigned status, std::string_view field, std::string_view message) {
  const nlohmann::json body{{"error", {{"field", field}, {"message", message}}}};
  return text_reply(status, body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n",
                    "application/json");
}

HttpReply no_scene_reply() {
  auto reply = json_error(503, "", "there is no scene yet");
  reply.headers.emplace_back("Retry-After", "2");
  return reply;
}

HttpReply reply_of(const ExportShelf::SharedFile& file, const RequestTarget& target, SceneFileFormat format) {
  HttpReply reply{200, std::string(content_type_of(format)), {file, &file->bytes}, {}};
  if (!file->losses.empty()) reply.headers.emplace_back("Spectra-Note", file->losses);
  reply.headers.emplace_back("Content-Disposition",
                             "attachment; filename=\"" + target.path.substr(target.path.rfind('/') + 1) + '"');
  return reply;
}

/// What was asked for, of which version of the scene.
std::string key_of(const RequestTarget& target, const SceneSnapshot& scene) {
  std::string key = std::to_string(scene.revision()) + target.path;
  for (const auto& [name, value] : target.query) key += '\n' + name + '\n' + value;
  return key;
}

/// What was lost, on one line.
std::string losses_of(const SceneFile& file) {
  std::string losses;
  for (const auto& loss : file.losses) losses += (losses.empty() ? "" : " | ") + loss.message;
  return losses;
}

SettingsText settings_text_of(const RequestTarget& target) {
  SettingsText text;
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

fusion::Result<bool> flag_from_text(const std::string& name, const std::string& text) {
  if (text == "true" || text == "false") return text == "true";
  return fusion::failure(fusion::ErrorCode::WrongType, name + " is \"" + text + "\"; it must be true or false", name);
}

/// What the query says of the file, and not of the fusion; taken out of the query.
fusion::Result<SceneFileOptions> file_options_of(RequestTarget& target, SceneFileFormat format) {
  SceneFileOptions options;
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
  if (keep_order) options.keeping = protocol::DracoKeeping::Order;
  if (is_lossless) options.keeping = protocol::DracoKeeping::Everything;
  return options;
}

fusion::Result<SceneFile> fused_export(const SceneSnapshot& scene, const fusion::FusionSettings& settings,
                                       SceneFileOptions options) {
  BOOST_OUTCOME_TRY(const auto plan, fusion::FusionPlan::prepare(settings, scene.temperature()));
  auto mesh = scene.whole_mesh();
  const bool is_rounded =
      options.format == SceneFileFormat::Draco && options.keeping != protocol::DracoKeeping::Everything;
  if (is_rounded) {
    BOOST_OUTCOME_TRYV(round_for_file(scene, mesh, options));
  }
  return scene_file(mesh, fused_colours(mesh, plan, scene.whole_baseline()), options);
}

}  // namespace

HttpApi::HttpApi(ServedScene& served, MapKeeper& map) : served_(served), blocks_(served, map, exports_) {}

void HttpApi::handle(const HttpRequest& request, const std::function<void(HttpReply)>& reply) {
  const std::string& path = request.target.path;
  if (path == "/healthz") return reply(text_reply(200, "alive\n"));
  if (path == "/readyz") {
    if (served_.scenes.current()) return reply(text_reply(200, "ready\n"));
    return reply(text_reply(503, served_.progress.message().value_or("no scene") + "\n"));
  }
  if (path == "/metrics") {
    return reply(text_reply(200, metrics_text(served_, *net_metrics_), "text/plain; version=0.0.4; charset=utf-8"));
  }
  if (path == "/api/v1/scene") {
    const auto scene = served_.scenes.current();
    if (!scene) return reply(no_scene_reply());
    return reply(text_reply(200, protocol::to_json(to_message(*scene)).dump() + "\n", "application/json"));
  }
  if (path == Catalogue::kPath || path.starts_with(std::string(Catalogue::kPath) + '/')) {
    return reply(served_.catalogue.reply(request));
  }
  if (path == kBlocksPath || path.starts_with(std::string(kBlocksPath) + '/')) return blocks_.handle(request, reply);
  if (path.starts_with(kExportPrefix)) return handle_export(request.target, reply);
  reply(text_reply(404, "not found\n"));
}

void HttpApi::handle_export(RequestTarget target, const std::function<void(HttpReply)>& reply) {
  const auto format = scene_file_format(target.path);
  if (!format || target.path.size() != kExportPrefix.size() + 3) return reply(text_reply(404, "not found\n"));
  const RequestTarget asked = target;
  const auto file_options = file_options_of(target, *format);
  if (!file_options) return reply(json_error(400, file_options.error().field, file_options.error().message));
  const auto settings = settings_from_text(settings_text_of(target));
  if (!settings) return reply(json_error(400, settings.error().field, settings.error().message));
  const auto scene = served_.scenes.current();
  if (!scene) return reply(no_scene_reply());
  const std::string key = key_of(asked, *scene);
  if (const auto file = exports_.find(key)) return reply(reply_of(file, asked, *format));
  const ExportShelf::Slot slot = exports_.take();
  if (!slot) {
    auto busy = json_error(503, "", "two exports are being made already, or too much is being sent");
    busy.headers.emplace_back("Retry-After", "5");
    return reply(std::move(busy));
  }
  served_.pool.post(
      [this, slot, scene, settings = settings.value(), options = file_options.value(), reply, asked, key] {
        try {
          auto file = fused_export(*scene, settings, options);
          if (!file) return reply(json_error(400, file.error().field, file.error().message));
          std::string losses = losses_of(file.value());
          const auto kept = exports_.keep(key, {std::move(file.value().bytes), std::move(losses)});
          reply(reply_of(kept, asked, options.format));
        } catch (const std::exception& error) {
          spdlog::error("an export failed: {}", error.what());
          reply(json_error(500, "", "the export failed"));
        }
      },
      kExportPriority);
}

}  // namespace spectra::server
