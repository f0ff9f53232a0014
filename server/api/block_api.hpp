#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "server/exports/export_shelf.hpp"
#include "server/net/block_change.hpp"
#include "server/net/http_types.hpp"
#include "server/session/served_scene.hpp"
#include "server/sources/map_keeper.hpp"

namespace spectra::server {

/// The paths of docs/protocol.md, "Blocks of the map".
class BlockApi {
 public:
  /// A block that is given back takes a slot of the exports.
  BlockApi(ServedScene& served, MapKeeper& map, ExportShelf& exports);

  /// The path is kBlocksPath or begins with it and a slash.
  void handle(const HttpRequest& request, const std::function<void(HttpReply)>& reply);

  /// As BlockHandler says.
  void change(BlockChange change, std::function<void(BlockOutcome)> done);

 private:
  void put(const std::string& id, const HttpRequest& request, const std::function<void(HttpReply)>& reply);
  void give(const std::string& id, const std::vector<std::pair<std::string, std::string>>& query,
            const std::function<void(HttpReply)>& reply);

  ServedScene& served_;
  MapKeeper& map_;
  ExportShelf& exports_;
};

}  // namespace spectra::server
