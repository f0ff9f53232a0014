#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "server/api/block_api.hpp"
#include "server/net/http_types.hpp"
#include "server/net/net_metrics.hpp"
#include "server/net/net_options.hpp"
#include "server/session/served_scene.hpp"

namespace spectra::api {

/// The paths of docs/protocol.md, "HTTP", beside the web client: health, metrics, methods and palettes, the scene and its exports. What takes
/// time runs on the worker pool; so many exports are made at a time as the limits say, further ones are told to come back.
class HttpApi {
 public:
  HttpApi(session::ServedScene& served, sources::MapKeeper& map, const net::NetLimits& limits = {});

  void handle(const net::HttpRequest& request, const std::function<void(net::HttpReply)>& reply);

  /// As BlockHandler says.
  void change_block(net::BlockChange change, std::function<void(net::BlockOutcome)> done) {
    blocks_.change(std::move(change), std::move(done));
  }

  /// Where the network side counts; to be set before the first request.
  void set_metrics(const net::NetMetrics& metrics) { net_metrics_ = &metrics; }

 private:
  void handle_export(net::RequestTarget target, const std::function<void(net::HttpReply)>& reply);

  session::ServedScene& served_;
  exports::ExportShelf exports_;
  BlockApi blocks_;
  const net::NetMetrics* net_metrics_ = nullptr;
};

}  // namespace spectra::api
