#pragma once

#include <memory>
#include <string>

#include "protocol/messages/scene_messages.hpp"
#include "server/net/http_types.hpp"
#include "server/net/static_files.hpp"
#include "server/net/viewer_link.hpp"

namespace spectra::session {

/// Methods and palettes, nearly all of a full hello and the same for every viewer: one text, made once, that hello and HTTP
/// share. Immutable, so any thread may use it.
class Catalogue {
 public:
  Catalogue();

  /// Where it is served under a name that changes with its content, relative to the folder of /ws.
  const std::string& path() const { return path_; }

  /// hello as a text: with methods and palettes, or with the path where they are. `hello` has neither.
  net::OutgoingText hello_text(protocol::Hello hello, net::HelloForm form) const;

  /// The answer to a request for kPath, or for a path below it: 404 where that is not the one of this content.
  net::HttpReply reply(const net::HttpRequest& request) const;

  static constexpr std::string_view kPath = "/api/v1/catalogue";

 private:
  std::shared_ptr<const std::string> text_;
  std::shared_ptr<const net::StaticFile> file_;
  std::string path_;
};

}  // namespace spectra::session
