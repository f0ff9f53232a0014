#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

namespace spectra::server {

/// One file of the web client, held in memory.
struct StaticFile {
  std::string content;
  std::string content_type;
  std::string etag;        ///< With its quotes.
  bool immutable = false;  ///< Its name carries a hash of its content: may be kept for ever.
};

/// The MIME type that a browser needs for a file of this name.
std::string_view content_type_of(std::string_view file_name);

/// The files beneath one folder, read into memory. A request is looked up among the names that are there, so no request
/// can reach a file outside the folder; links that lead out of it are not followed. The folder is read again when its
/// index.html has changed, so that a rebuilt client is served without a restart. Thread-safe.
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

}  // namespace spectra::server
