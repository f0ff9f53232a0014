#include "server/app/http_api.hpp"

#include <spdlog/spdlog.h>

#include <charconv>
#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include "fusion/fusion_plan.hpp"
#include "protocol/messages/scene_messages.hpp"
#include "server/app/block_options.hpp"
#include "server/app/fused_file.hpp"
#include "server/app/fusion_messages.hpp"
#include "server/app/metrics_text.hpp"
#include "server/app/settings_text.hpp"

namespace spectra::server {
namespace {

constexpr int kMaxExports = 2;
/// So many blocks are listed at a time, at most.
constexpr std::size_t kBlocksOfPage = 1000;
constexpr std::string_view kExportPrefix = "/api/v1/scene.";

HttpReply json_error(unsigned status, std::string_view field, std::string_view message) {
  const nlohmann::json body{{"error", {{"field", field}, {"message", message}}}};
  return text_reply(status, body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n",
                    "application/json");
}

HttpReply refused_block(const BlockRefusal& refusal) {
  nlohmann::json error{{"code", refusal.code}, {"field", refusal.field}, {"reason", refusal.reason}};
  if (!refusal.limits.empty()) error["limits"] = refusal.limits;
  auto reply =
      text_reply(refusal.status,
                 nlohmann::json{{"error", error}}.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n",
                 "application/json");
  if (refusal.status == 503) reply.headers.emplace_back("Retry-After", "1");
  return reply;
}

nlohmann::json json_of(const BlockEntry& entry) {
  const auto list = [](const fusion::Vec3d& v) { return nlohmann::json{v.x, v.y, v.z}; };
  nlohmann::json json{{"id", entry.id},
                      {"revision", entry.revision},
                      {"observed_at", nullptr},
                      {"vertex_count", entry.vertex_count},
                      {"triangle_count", entry.triangle_count},
                      {"bounds", {{"min", list(entry.bounds.min)}, {"max", list(entry.bounds.max)}}},
                      {"sha256", nullptr}};
  if (entry.observed_at) json["observed_at"] = *entry.observed_at;
  if (!entry.sha256.empty()) json["sha256"] = entry.sha256;
  return json;
}

HttpReply no_scene_reply() {
  auto reply = json_error(503, "", "there is no scene yet");
  reply.headers.emplace_back("Retry-After", "2");
  return reply;
}

/// Counts one export for as long as it or its bytes exist.
class ExportSlot {
 public:
  explicit ExportSlot(std::shared_ptr<std::atomic<int>> count) : count_(std::move(count)) { *count_ += 1; }
  ~ExportSlot() { *count_ -= 1; }
  ExportSlot(const ExportSlot&) = delete;
  ExportSlot& operator=(const ExportSlot&) = delete;

 private:
  std::shared_ptr<std::atomic<int>> count_;
};

struct ExportBody {
  std::shared_ptr<ExportSlot> slot;
  std::string bytes;
};

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
  return scene_file(mesh, fused_colours(mesh, plan), options);
}

}  // namespace

HttpApi::HttpApi(ServedScene& served) : served_(served) {}

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
  if (path == kBlocksPath || path.starts_with(std::string(kBlocksPath) + '/')) return handle_blocks(request, reply);
  if (path.starts_with(kExportPrefix)) return handle_export(request.target, reply);
  reply(text_reply(404, "not found\n"));
}

void HttpApi::handle_blocks(const HttpRequest& request, const std::function<void(HttpReply)>& reply) {
  const std::string& path = request.target.path;
  if (path == kBlocksPath) {
    std::string after;
    std::size_t limit = kBlocksOfPage;
    for (const auto& [name, value] : request.target.query) {
      if (name == "after") {
        after = value;
        continue;
      }
      const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), limit);
      const bool is_limit = name == "limit" && error == std::errc() && end == value.data() + value.size() &&
                            limit > 0 && limit <= kBlocksOfPage;
      if (!is_limit) {
        return reply(refused_block({400, "bad_request", name, name + "=" + value + " is not understood",
                                    "after=ID, limit=1.." + std::to_string(kBlocksOfPage)}));
      }
    }
    const auto page = map_->page(after, limit);
    nlohmann::json blocks = nlohmann::json::array();
    for (const BlockEntry& entry : page) blocks.push_back(json_of(entry));
    nlohmann::json next = nullptr;
    if (page.size() == limit && !map_->page(page.back().id, 1).empty()) next = page.back().id;
    return reply(text_reply(200, nlohmann::json{{"blocks", blocks}, {"next", next}}.dump() + "\n", "application/json"));
  }
  const std::string id = path.substr(kBlocksPath.size() + 1);
  if (!store::is_block_id(id)) {
    return reply(
        refused_block({400, "bad_request", "id", "that is no name of a block", "1 to 64 of a-z A-Z 0-9 . _ -"}));
  }
  if (request.method == HttpMethod::Put) return put_block(id, request, reply);
  if (request.method == HttpMethod::Get) return get_block(id, reply);
  map_->remove(id, [reply](const std::optional<BlockRefusal>& refusal) {
    reply(refusal ? refused_block(*refusal) : text_reply(200, "{}\n", "application/json"));
  });
}

void HttpApi::put_block(const std::string& id, const HttpRequest& request,
                        const std::function<void(HttpReply)>& reply) {
  auto block = incoming_block(id, request.target.query);
  if (!block) {
    const auto& error = block.error();
    return reply(refused_block({400, "bad_request", error.field, error.message, ""}));
  }
  block.value().ply = request.body;
  map_->put(std::move(block).value(), [reply](const std::variant<MapKeeper::Taken, BlockRefusal>& outcome) {
    if (const auto* refusal = std::get_if<BlockRefusal>(&outcome)) return reply(refused_block(*refusal));
    const auto& taken = std::get<MapKeeper::Taken>(outcome);
    nlohmann::json notes = nlohmann::json::array();
    for (const fusion::Note& note : taken.notes) {
      notes.push_back({{"id", note.id}, {"count", note.count}, {"message", note.message}});
    }
    const nlohmann::json body{{"id", taken.entry.id},
                              {"revision", taken.entry.revision},
                              {"vertex_count", taken.entry.vertex_count},
                              {"triangle_count", taken.entry.triangle_count},
                              {"notes", notes}};
    reply(text_reply(200, body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n",
                     "application/json"));
  });
}

void HttpApi::get_block(const std::string& id, const std::function<void(HttpReply)>& reply) {
  if (!map_->has(id)) {
    return reply(refused_block({404, "not_found", "id", "there is no block \"" + id + "\"", ""}));
  }
  served_.pool.post(
      [&scenes = served_.scenes, id, reply] {
        const auto mesh = scenes.mesh_of(id);
        if (!mesh) return reply(refused_block({404, "not_found", "id", "there is no block \"" + id + "\"", ""}));
        SceneFileOptions options;
        options.format = SceneFileFormat::Ply;
        const std::vector<fusion::Rgb8> visible(mesh->visible().begin(), mesh->visible().end());
        auto file = scene_file(*mesh, visible, options);
        if (!file) return reply(refused_block({500, "not_written", "", file.error().message, ""}));
        reply(text_reply(200, std::move(file.value().bytes), std::string(content_type_of(SceneFileFormat::Ply))));
      },
      kExportPriority);
}

void HttpApi::handle_export(RequestTarget target, const std::function<void(HttpReply)>& reply) {
  const auto format = scene_file_format(target.path);
  if (!format || target.path.size() != kExportPrefix.size() + 3) return reply(text_reply(404, "not found\n"));
  const auto file_options = file_options_of(target, *format);
  if (!file_options) return reply(json_error(400, file_options.error().field, file_options.error().message));
  const auto settings = settings_from_text(settings_text_of(target));
  if (!settings) return reply(json_error(400, settings.error().field, settings.error().message));
  const auto scene = served_.scenes.current();
  if (!scene) return reply(no_scene_reply());
  if (*exports_under_way_ >= kMaxExports) {
    auto busy = json_error(503, "", "two exports are under way already");
    busy.headers.emplace_back("Retry-After", "5");
    return reply(std::move(busy));
  }
  const auto slot = std::make_shared<ExportSlot>(exports_under_way_);
  served_.pool.post(
      [slot, scene, settings = settings.value(), options = file_options.value(), reply, path = target.path] {
        try {
          auto file = fused_export(*scene, settings, options);
          if (!file) return reply(json_error(400, file.error().field, file.error().message));
          const auto body = std::make_shared<ExportBody>(ExportBody{slot, std::move(file.value().bytes)});
          HttpReply done{200, std::string(content_type_of(options.format)), {body, &body->bytes}, {}};
          std::string losses;
          for (const auto& loss : file.value().losses) losses += (losses.empty() ? "" : " | ") + loss.message;
          if (!losses.empty()) done.headers.emplace_back("Spectra-Note", losses);
          done.headers.emplace_back("Content-Disposition",
                                    "attachment; filename=\"" + path.substr(path.rfind('/') + 1) + '"');
          reply(std::move(done));
        } catch (const std::exception& error) {
          spdlog::error("an export failed: {}", error.what());
          reply(json_error(500, "", "the export failed"));
        }
      },
      kExportPriority);
}

}  // namespace spectra::server
