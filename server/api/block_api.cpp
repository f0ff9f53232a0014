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

namespace spectra::api {
namespace {

/// So many blocks are listed at a time, at most.
constexpr std::size_t kBlocksOfPage = 1000;

constexpr const char* kNothingSaid = "nothing is said of a block that is taken out";

/// Names and notes may hold what is no UTF-8.
std::string text_of(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

nlohmann::json json_of(const sources::BlockEntry& entry) {
  const auto list = [](const base::Vec3d& v) { return nlohmann::json{v.x, v.y, v.z}; };
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

net::BlockRefusal no_time(const std::string& text) {
  return {400, "bad_request", "at", "at=" + text + " is no time",
          "2026-01-31T12:34:56Z (or +01:00 for Z), or Unix seconds"};
}

net::BlockRefusal not_open() {
  return {503, "busy", "", "the map is not open yet", ""};
}

net::BlockRefusal said_twice(const std::string& field) {
  return {400, "bad_request", field, field + " stands in the query more than once", "once"};
}

net::BlockRefusal no_name() {
  return {400, "bad_request", "id", "that is no name of a block", "1 to 64 of a-z A-Z 0-9 . _ -"};
}

net::HttpReply ply_of(const mesh::MultispectralMesh& mesh, exports::ExportShelf& exports) {
  exports::SceneFileOptions options;
  options.format = exports::SceneFileFormat::Ply;
  const std::vector<base::Rgb8> visible(mesh.visible().begin(), mesh.visible().end());
  auto file = exports::scene_file(mesh, visible, options);
  if (!file) return net::refused({500, "not_written", "", file.error().message, ""});
  const auto kept = exports.keep("", {std::move(file.value().bytes), ""});
  return {200, std::string(exports::content_type_of(exports::SceneFileFormat::Ply)), {kept, &kept->bytes}, {}};
}

}  // namespace

BlockApi::BlockApi(session::ServedScene& served, sources::MapKeeper& map, exports::ExportShelf& exports)
    : served_(served), map_(map), exports_(exports) {}

void BlockApi::handle(const net::HttpRequest& request, const std::function<void(net::HttpReply)>& reply) {
  const std::string& path = request.target.path;
  if (const auto field = sources::repeated_field(request.target.query)) {
    return reply(net::refused(said_twice(*field)));
  }
  if (path == net::kBlocksPath) {
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
        if (!at) return reply(net::refused(no_time(value)));
        continue;
      }
      const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), limit);
      const bool is_limit = name == "limit" && error == std::errc() && end == value.data() + value.size() &&
                            limit > 0 && limit <= kBlocksOfPage;
      if (!is_limit) {
        return reply(net::refused({400, "bad_request", name, name + "=" + value + " is not understood",
                                   "after=ID, at=TIME, limit=1.." + std::to_string(kBlocksOfPage)}));
      }
    }
    if (!map_.is_open()) return reply(net::refused(not_open()));
    sources::MapKeeper::Page page;
    if (at) {
      auto past = map_.page_at(*at, after, limit);
      if (const auto* refusal = std::get_if<net::BlockRefusal>(&past)) return reply(net::refused(*refusal));
      page = std::get<sources::MapKeeper::Page>(std::move(past));
    } else {
      page = map_.page(after, limit);
    }
    nlohmann::json blocks = nlohmann::json::array();
    for (const sources::BlockEntry& entry : page.blocks) blocks.push_back(json_of(entry));
    nlohmann::json next = nullptr;
    if (page.has_more) next = page.blocks.back().id;
    return reply(net::text_reply(200, text_of({{"blocks", blocks}, {"next", next}}), "application/json"));
  }
  const std::string id = path.substr(net::kBlocksPath.size() + 1);
  if (!store::is_block_id(id)) return reply(net::refused(no_name()));
  if (request.method == net::HttpMethod::Put) return put(id, request, reply);
  if (request.method == net::HttpMethod::Get) return give(id, request.target.query, reply);
  if (!request.target.query.empty()) {
    return reply(net::refused({400, "bad_request", request.target.query[0].first, kNothingSaid, ""}));
  }
  map_.remove(id, [reply](const std::variant<store::Revision, net::BlockRefusal>& outcome) {
    const auto* refusal = std::get_if<net::BlockRefusal>(&outcome);
    reply(refusal != nullptr ? net::refused(*refusal) : net::text_reply(200, "{}\n", "application/json"));
  });
}

void BlockApi::put(const std::string& id, const net::HttpRequest& request,
                   const std::function<void(net::HttpReply)>& reply) {
  auto block = sources::incoming_block(id, request.target.query);
  if (!block) {
    const auto& error = block.error();
    return reply(net::refused({400, "bad_request", error.field, error.message, sources::limits_of(error.field)}));
  }
  block.value().ply = request.body;
  map_.put(std::move(block).value(),
           [reply](const std::variant<sources::MapKeeper::Taken, net::BlockRefusal>& outcome) {
             if (const auto* refusal = std::get_if<net::BlockRefusal>(&outcome)) return reply(net::refused(*refusal));
             const auto& taken = std::get<sources::MapKeeper::Taken>(outcome);
             nlohmann::json notes = nlohmann::json::array();
             for (const files::Note& note : taken.notes) {
               notes.push_back({{"id", note.id}, {"count", note.count}, {"message", note.message}});
             }
             const nlohmann::json body{{"id", taken.entry.id},
                                       {"revision", taken.entry.revision},
                                       {"vertex_count", taken.entry.vertex_count},
                                       {"triangle_count", taken.entry.triangle_count},
                                       {"notes", notes}};
             reply(net::text_reply(200, text_of(body), "application/json"));
           });
}

void BlockApi::change(net::BlockChange change, std::function<void(net::BlockOutcome)> done) {
  if (!store::is_block_id(change.id)) return done(no_name());
  if (const auto field = sources::repeated_field(change.query)) return done(said_twice(*field));
  if (!change.ply) {
    if (!change.query.empty()) {
      return done(net::BlockRefusal{400, "bad_request", change.query[0].first, kNothingSaid, ""});
    }
    return map_.remove(
        std::move(change.id),
        [done = std::move(done)](const std::variant<store::Revision, net::BlockRefusal>& outcome) {
          if (const auto* refusal = std::get_if<net::BlockRefusal>(&outcome)) return done(*refusal);
          done(net::BlockTaken{std::get<store::Revision>(outcome), {}});
        },
        sources::MapKeeper::WhenFull::Take);
  }
  auto block = sources::incoming_block(std::move(change.id), change.query);
  if (!block) {
    const auto& error = block.error();
    return done(net::BlockRefusal{400, "bad_request", error.field, error.message, sources::limits_of(error.field)});
  }
  block.value().ply = std::move(change.ply);
  map_.put(
      std::move(block).value(),
      [done = std::move(done)](std::variant<sources::MapKeeper::Taken, net::BlockRefusal> outcome) {
        if (auto* refusal = std::get_if<net::BlockRefusal>(&outcome)) return done(std::move(*refusal));
        auto& taken = std::get<sources::MapKeeper::Taken>(outcome);
        done(net::BlockTaken{taken.entry.revision, std::move(taken.notes)});
      },
      sources::MapKeeper::WhenFull::Take);
}

void BlockApi::give(const std::string& id, const std::vector<std::pair<std::string, std::string>>& query,
                    const std::function<void(net::HttpReply)>& reply) {
  std::optional<store::StoreTime> at;
  for (const auto& [name, value] : query) {
    if (name != "at") {
      return reply(net::refused({400, "bad_request", name, name + "=" + value + " is not understood", "at=TIME"}));
    }
    at = store::time_of(value);
    if (!at) return reply(net::refused(no_time(value)));
  }
  if (!map_.is_open()) return reply(net::refused(not_open()));
  const net::BlockRefusal unknown{404, "not_found", "id", "there is no block \"" + id + "\"", ""};
  if (!at && !map_.has(id)) return reply(net::refused(unknown));
  exports::ExportShelf::Slot slot = exports_.take();
  if (!slot) {
    return reply(net::refused(
        {503, "busy", "", "too many files are being made", std::to_string(exports_.most()) + " at a time"}));
  }
  if (at) {
    return map_.read_at(
        *at, id, [this, slot, reply](const std::variant<files::LoadedScene, net::BlockRefusal>& outcome) mutable {
          if (const auto* refusal = std::get_if<net::BlockRefusal>(&outcome)) return reply(net::refused(*refusal));
          auto file = ply_of(std::get<files::LoadedScene>(outcome).mesh, exports_);
          slot.reset();
          reply(std::move(file));
        });
  }
  served_.pool.post(
      [this, slot = std::move(slot), scene = served_.scenes.current(), id, unknown, reply]() mutable {
        const auto mesh = scene->block_mesh(id);
        auto file = mesh ? ply_of(*mesh, exports_) : net::refused(unknown);
        slot.reset();
        reply(std::move(file));
      },
      jobs::kExportPriority);
}

}  // namespace spectra::api
