#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "server/api/block_api.hpp"
#include "server/net/http_types.hpp"
#include "server/net/net_metrics.hpp"
#include "server/session/served_scene.hpp"

namespace spectra::server {

/// The paths of docs/protocol.md, "HTTP", beside the web client: health, metrics, methods and palettes, the scene and its exports. What takes
/// time runs on the worker pool; at most two exports are in memory at a time, further ones are told to come back.
class HttpApi {
 public:
  HttpApi(ServedScene& served, MapKeeper& map);

  void handle(const HttpRequest& request, const std::function<void(HttpReply)>& reply);

  /// As BlockHandler says.
  void change_block(BlockChange change, std::function<void(BlockOutcome)> done) {
    blocks_.change(std::move(change), std::move(done));
  }

  /// Where the network side counts; to be set before the first request.
  void set_metrics(const NetMetrics& metrics) { net_metrics_ = &metrics; }

 private:
  void handle_export(RequestTarget target, const std::function<void(HttpReply)>& reply);

  ServedScene& served_;
  ExportShelf exports_;
  BlockApi blocks_;
  const NetMetrics* net_metrics_ = nullptr;
};

}  // namespace spectra::server
