#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "server/net/http_types.hpp"

namespace spectra::net {

/// A file's content in one content coding.
struct StaticVersion {
  std::string coding;  ///< As in Content-Encoding; empty: the file as it is.
  std::string content;
  std::string etag;  ///< With its quotes; each version has its own.
};

/// A version with a tag made from its content.
StaticVersion version_of(std::string content, std::string_view coding);

/// A file of the web client, or one like it, held in memory.
struct StaticFile {
  std::vector<StaticVersion> versions;  ///< The smallest first.
  std::string content_type;
  bool immutable = false;  ///< Its name carries a hash of its content: may be kept for ever.

  /// The smallest version of those that the header's value likes best (RFC 9110, 12.5.3; empty: the file as it is);
  /// nullptr: it refuses all that there are.
  const StaticVersion* version_for(std::string_view accept_encoding) const;
};

/// How much a value of Accept-Encoding likes a coding, 0 (not at all) to 1. A coding that it does not name is not liked,
/// save "identity", which is liked a little.
double liking(std::string_view accept_encoding, std::string_view coding);

/// Whether a value of If-None-Match names the tag (RFC 9110, 13.1.2: a weak one, as proxies make it, is as good).
bool names_etag(std::string_view if_none_match, std::string_view etag);

/// The answer to a request for a file: the version that is liked best, 304 where the client has that one already, 406 where
/// it likes none. `is_immutable`: under this name there will never be another content.
HttpReply file_reply(const std::shared_ptr<const StaticFile>& file, const HttpRequest& request, bool is_immutable);

/// The MIME type that a browser needs for a file of this name.
std::string_view content_type_of(std::string_view file_name);

/// The files beneath one folder, read into memory. A request is looked up among the names that are there, so no request
/// can reach a file outside the folder; links that lead out of it are not followed. The folder is read again when its
/// index.html has changed, so that a rebuilt client is served without a restart. What stands beside a file of assets/ with
/// .br or .gz at the end of its name is that file in Brotli or gzip, and no file of its own. Thread-safe.
class StaticFiles {
 public:
  /// `root` may be empty or absent: then there are no files.
  explicit StaticFiles(std::filesystem::path root);

  /// The file for a request path ("/" is index.html), or nullptr.
  std::shared_ptr<const StaticFile> find(std::string_view path);

  const std::filesystem::path& root() const { return root_; }

 private:
  void load(bool even_if_unchanged);

  const std::filesystem::path root_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<const StaticFile>, std::less<>> files_;
  std::filesystem::file_time_type index_time_ = std::filesystem::file_time_type::min();
  std::chrono::steady_clock::time_point last_miss_;
};

}  // namespace spectra::net
