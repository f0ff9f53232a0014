#include "server/api/block_api.hpp"

#include <charconv>
#include <nlohmann/json.hpp>
#include <utility>
#include <variant>
#include <vector>

#include "server/exports/fused_file.hpp"
#include "server/jobs/priority.hpp"
#include "server/sources/block_options.hpp"
#include "server/store/time_text.hpp"

namespace spectra::server {
namespace {

/// So many blocks are listed at a time, at most.
constexpr std::size_t kBlocksOfPage = 1000;

/// Names and notes may hold what is no UTF-8.
std::string text_of(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
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

BlockRefusal no_time(const std::string& text) {
  return {400, "bad_request", "at", "at=" + text + " is no time",
          "2026-01-31T12:34:56Z (or +01:00 for Z), or Unix seconds"};
}

BlockRefusal no_name() {
  return {400, "bad_request", "id", "that is no name of a block", "1 to 64 of a-z A-Z 0-9 . _ -"};
}

HttpReply ply_of(const fusion::MultispectralMesh& mesh, ExportShelf& exports) {
  SceneFileOptions options;
  options.format = SceneFileFormat::Ply;
  const std::vector<fusion::Rgb8> visible(mesh.visible().begin(), mesh.visible().end());
  auto file = scene_file(mesh, visible, options);
  if (!file) return refused({500, "not_written", "", file.error().message, ""});
  const auto kept = exports.keep("", {std::move(file.value().bytes), ""});
  return {200, std::string(content_type_of(SceneFileFormat::Ply)), {kept, &kept->bytes}, {}};
}

}  // namespace

BlockApi::BlockApi(ServedScene& served, MapKeeper& map, ExportShelf& exports)
    : served_(served), map_(map), exports_(exports) {}

void BlockApi::handle(const HttpRequest& request, const std::function<void(HttpReply)>& reply) {
  const std::string& path = request.target.path;
  if (path == kBlocksPath) {
    std::string after;
    std::size_t limit = kBlocksOfPage;
    std::optional<store::StoreTime> at;
    for (const auto& [name, value] : request.target.query) {
      if (name == "after") {
        after = value;
        continue;
      }
      if (name == "at") {
        at = store::time_of(value);
        if (!at) return reply(refused(no_time(value)));
        continue;
      }
      const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), limit);
      const bool is_limit = name == "limit" && error == std::errc() && end == value.data() + value.size() &&
                            limit > 0 && limit <= kBlocksOfPage;
      if (!is_limit) {
        return reply(refused({400, "bad_request", name, name + "=" + value + " is not understood",
                              "after=ID, at=TIME, limit=1.." + std::to_string(kBlocksOfPage)}));
      }
    }
    MapKeeper::Page page;
    if (at) {
      auto past = map_.page_at(*at, after, limit);
      if (const auto* refusal = std::get_if<BlockRefusal>(&past)) return reply(refused(*refusal));
      page = std::get<MapKeeper::Page>(std::move(past));
    } else {
      page = map_.page(after, limit);
    }
    nlohmann::json blocks = nlohmann::json::array();
    for (const BlockEntry& entry : page.blocks) blocks.push_back(json_of(entry));
    nlohmann::json next = nullptr;
    if (page.has_more) next = page.blocks.back().id;
    return reply(text_reply(200, text_of({{"blocks", blocks}, {"next", next}}), "application/json"));
  }
  const std::string id = path.substr(kBlocksPath.size() + 1);
  if (!store::is_block_id(id)) return reply(refused(no_name()));
  if (request.method == HttpMethod::Put) return put(id, request, reply);
  if (request.method == HttpMethod::Get) return give(id, request.target.query, reply);
  map_.remove(id, [reply](const std::variant<store::Revision, BlockRefusal>& outcome) {
    const auto* refusal = std::get_if<BlockRefusal>(&outcome);
    reply(refusal != nullptr ? refused(*refusal) : text_reply(200, "{}\n", "application/json"));
  });
}

void BlockApi::put(const std::string& id, const HttpRequest& request, const std::function<void(HttpReply)>& reply) {
  auto block = incoming_block(id, request.target.query);
  if (!block) {
    const auto& error = block.error();
    return reply(refused({400, "bad_request", error.field, error.message, ""}));
  }
  block.value().ply = request.body;
  map_.put(std::move(block).value(), [reply](const std::variant<MapKeeper::Taken, BlockRefusal>& outcome) {
    if (const auto* refusal = std::get_if<BlockRefusal>(&outcome)) return reply(refused(*refusal));
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
    reply(text_reply(200, text_of(body), "application/json"));
  });
}

void BlockApi::change(BlockChange change, std::function<void(BlockOutcome)> done) {
  if (!store::is_block_id(change.id)) return done(no_name());
  if (!change.ply) {
    if (!change.query.empty()) {
      return done(
          BlockRefusal{400, "bad_request", change.query[0].first, "nothing is said of a block that is taken out", ""});
    }
    return map_.remove(
        std::move(change.id),
        [done = std::move(done)](const std::variant<store::Revision, BlockRefusal>& outcome) {
          if (const auto* refusal = std::get_if<BlockRefusal>(&outcome)) return done(*refusal);
          done(BlockTaken{std::get<store::Revision>(outcome), {}});
        },
        MapKeeper::WhenFull::Take);
  }
  auto block = incoming_block(std::move(change.id), change.query);
  if (!block) return done(BlockRefusal{400, "bad_request", block.error().field, block.error().message, ""});
  block.value().ply = std::move(change.ply);
  map_.put(
      std::move(block).value(),
      [done = std::move(done)](std::variant<MapKeeper::Taken, BlockRefusal> outcome) {
        if (auto* refusal = std::get_if<BlockRefusal>(&outcome)) return done(std::move(*refusal));
        auto& taken = std::get<MapKeeper::Taken>(outcome);
        done(BlockTaken{taken.entry.revision, std::move(taken.notes)});
      },
      MapKeeper::WhenFull::Take);
}

void BlockApi::give(const std::string& id, const std::vector<std::pair<std::string, std::string>>& query,
                    const std::function<void(HttpReply)>& reply) {
  std::optional<store::StoreTime> at;
  for (const auto& [name, value] : query) {
    if (name != "at") {
      return reply(refused({400, "bad_request", name, name + "=" + value + " is not understood", "at=TIME"}));
    }
    at = store::time_of(value);
    if (!at) return reply(refused(no_time(value)));
  }
  const BlockRefusal unknown{404, "not_found", "id", "there is no block \"" + id + "\"", ""};
  if (!at && !map_.has(id)) return reply(refused(unknown));
  const ExportShelf::Slot slot = exports_.take();
  if (!slot) {
    return reply(
        refused({503, "busy", "", "too many files are being made", std::to_string(ExportShelf::kMost) + " at a time"}));
  }
  if (at) {
    return map_.read_at(*at, id, [this, slot, reply](const std::variant<fusion::LoadedScene, BlockRefusal>& outcome) {
      if (const auto* refusal = std::get_if<BlockRefusal>(&outcome)) return reply(refused(*refusal));
      reply(ply_of(std::get<fusion::LoadedScene>(outcome).mesh, exports_));
    });
  }
  served_.pool.post(
      [this, slot, scene = served_.scenes.current(), id, unknown, reply] {
        const auto mesh = scene->block_mesh(id);
        reply(mesh ? ply_of(*mesh, exports_) : refused(unknown));
      },
      kExportPriority);
}

}  // namespace spectra::server
