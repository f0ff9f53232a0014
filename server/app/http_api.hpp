#pragma once

#include <functional>
#include <memory>

#include "server/app/map_keeper.hpp"
#include "server/app/served_scene.hpp"
#include "server/net/http_types.hpp"
#include "server/net/net_metrics.hpp"

namespace spectra::server {

/// The paths of docs/protocol.md, "HTTP", beside the web client: health, metrics, methods and palettes, the scene and its exports. What takes
/// time runs on the worker pool; at most two exports are in memory at a time, further ones are told to come back.
class HttpApi {
 public:
  explicit HttpApi(ServedScene& served);

  void handle(const HttpRequest& request, const std::function<void(HttpReply)>& reply);

  /// Who writes the map; to be set before the first request.
  void set_map(MapKeeper& map) { map_ = &map; }

  /// Where the network side counts; to be set before the first request.
  void set_metrics(const NetMetrics& metrics) { net_metrics_ = &metrics; }

 private:
  void handle_blocks(const HttpRequest& request, const std::function<void(HttpReply)>& reply);
  void put_block(const std::string& id, const HttpRequest& request, const std::function<void(HttpReply)>& reply);
  void get_block(const std::string& id, const std::function<void(HttpReply)>& reply);
  void handle_export(RequestTarget target, const std::function<void(HttpReply)>& reply);

  ServedScene& served_;
  MapKeeper* map_ = nullptr;
  const NetMetrics* net_metrics_ = nullptr;
  std::shared_ptr<std::atomic<int>> exports_under_way_ = std::make_shared<std::atomic<int>>(0);
};

}  // namespace spectra::server
