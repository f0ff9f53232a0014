#include "server/session/catalogue.hpp"

// The input is not written to.
#define ZLIB_CONST
#include <spdlog/fmt/fmt.h>
#include <zlib.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "protocol/jsonrpc.hpp"
#include "server/session/conversions.hpp"

namespace spectra::session {
namespace {

/// What closes params and message of a notification.
constexpr std::string_view kEnd = "}}";

std::string gzip(const std::string& text) {
  z_stream stream{};
  constexpr int kGzip = 16;
  constexpr int kMemory = 8;
  // Palettes are numbers that hardly repeat: a twentieth less than by the default strategy.
  if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, MAX_WBITS + kGzip, kMemory, Z_FILTERED) != Z_OK) {
    throw std::runtime_error("zlib could not be set up");
  }
  std::string packed(deflateBound(&stream, static_cast<uLong>(text.size())), '\0');
  stream.next_in = reinterpret_cast<const Bytef*>(text.data());
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  const int outcome = deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  if (outcome != Z_STREAM_END) throw std::runtime_error("zlib could not compress");
  return packed;
}

}  // namespace

Catalogue::Catalogue() {
  std::string text = protocol::to_json(protocol::Catalogue{method_messages(), palette_messages()}).dump();
  path_ = fmt::format("{}/{:016x}", kPath.substr(1), std::hash<std::string>{}(text));
  auto file = std::make_shared<net::StaticFile>();
  file->content_type = "application/json";
  file->versions.push_back(net::version_of(gzip(text), "gzip"));
  file->versions.push_back(net::version_of(std::move(text), {}));
  text_ = std::shared_ptr<const std::string>(file, &file->versions.back().content);
  file_ = std::move(file);
}

net::OutgoingText Catalogue::hello_text(protocol::Hello hello, net::HelloForm form) const {
  if (form == net::HelloForm::Brief) {
    hello.catalogue = path_;
    return protocol::notification_text("hello", protocol::to_json(hello));
  }
  std::string begin = protocol::notification_text("hello", protocol::to_json(hello));
  begin.replace(begin.size() - kEnd.size(), kEnd.size(), ",");
  // The text without its own braces.
  return {std::move(begin), text_, std::string_view(*text_).substr(1, text_->size() - 2), std::string(kEnd)};
}

net::HttpReply Catalogue::reply(const net::HttpRequest& request) const {
  const std::string_view path = request.target.path;
  if (path == kPath) return net::file_reply(file_, request, false);
  if (path.substr(1) == path_) return net::file_reply(file_, request, true);
  return net::text_reply(
      404, "methods and palettes are not those of that name (any more): see " + std::string(kPath) + "\n");
}

}  // namespace spectra::session
