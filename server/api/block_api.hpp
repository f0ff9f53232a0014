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

namespace spectra::api {

/// The paths of docs/protocol.md, "Blocks of the map".
class BlockApi {
 public:
  /// A block that is given back takes a slot of the exports.
  BlockApi(session::ServedScene& served, sources::MapKeeper& map, exports::ExportShelf& exports);

  const sources::MapKeeper& map() const { return map_; }

  /// The path is kBlocksPath or begins with it and a slash.
  void handle(const net::HttpRequest& request, const std::function<void(net::HttpReply)>& reply);

  /// As BlockHandler says.
  void change(net::BlockChange change, std::function<void(net::BlockOutcome)> done);

 private:
  void put(const std::string& id, const net::HttpRequest& request, const std::function<void(net::HttpReply)>& reply);
  void give(const std::string& id, const std::vector<std::pair<std::string, std::string>>& query,
            const std::function<void(net::HttpReply)>& reply);

  session::ServedScene& served_;
  sources::MapKeeper& map_;
  exports::ExportShelf& exports_;
};

}  // namespace spectra::api
