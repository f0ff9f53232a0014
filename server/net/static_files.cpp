#include "server/net/static_files.hpp"

#include <spdlog/spdlog.h>

#include <array>
#include <fstream>
#include <functional>
#include <iterator>
#include <utility>

namespace spectra::server {
namespace fs = std::filesystem;
namespace {

/// More than this is no web client of ours; the rest of the folder is left alone and said.
constexpr std::uintmax_t kMaxTotalBytes = 64U * 1024 * 1024;

constexpr std::chrono::seconds kRetryMisses{1};

constexpr std::array<std::pair<std::string_view, std::string_view>, 17> kContentTypes{{
    {".html", "text/html; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".mjs", "text/javascript; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".json", "application/json"},
    {".map", "application/json"},
    {".webmanifest", "application/manifest+json"},
    {".wasm", "application/wasm"},
    {".svg", "image/svg+xml"},
    {".png", "image/png"},
    {".jpg", "image/jpeg"},
    {".webp", "image/webp"},
    {".ico", "image/x-icon"},
    {".woff2", "font/woff2"},
    {".woff", "font/woff"},
    {".ttf", "font/ttf"},
    {".txt", "text/plain; charset=utf-8"},
}};

std::shared_ptr<const StaticFile> read_file(const fs::path& path, const std::string& name) {
  std::ifstream in(path, std::ios::binary);
  if (!in) return nullptr;
  auto file = std::make_shared<StaticFile>();
  file->content.assign(std::istreambuf_iterator<char>(in), {});
  file->content_type = content_type_of(name);
  file->etag =
      '"' + std::to_string(file->content.size()) + '-' + std::to_string(std::hash<std::string>{}(file->content)) + '"';
  file->immutable = name.starts_with("/assets/");
  return file;
}

}  // namespace

std::string_view content_type_of(std::string_view file_name) {
  for (const auto& [extension, type] : kContentTypes) {
    if (file_name.ends_with(extension)) return type;
  }
  return "application/octet-stream";
}

StaticFiles::StaticFiles(fs::path root) : root_(std::move(root)) {}

void StaticFiles::load(bool even_if_unchanged) {
  if (root_.empty()) return;
  std::error_code error;
  const auto time = fs::last_write_time(root_ / "index.html", error);
  if (error || (time == index_time_ && !even_if_unchanged)) return;

  decltype(files_) files;
  std::uintmax_t total_bytes = 0;
  for (auto it = fs::recursive_directory_iterator(root_, error); !error && it != fs::recursive_directory_iterator();
       it.increment(error)) {
    std::error_code ignored;
    if (it->is_symlink(ignored) || !it->is_regular_file(ignored)) continue;
    total_bytes += it->file_size(ignored);
    if (total_bytes > kMaxTotalBytes) {
      spdlog::warn("{}: more than {} bytes of web client, the rest is not served", root_.string(), kMaxTotalBytes);
      break;
    }
    const std::string name = '/' + it->path().lexically_relative(root_).generic_string();
    if (auto file = read_file(it->path(), name)) files.emplace(name, std::move(file));
  }
  if (error) {
    spdlog::warn("{}: {}", root_.string(), error.message());
    return;
  }
  files_ = std::move(files);
  index_time_ = time;
}

std::shared_ptr<const StaticFile> StaticFiles::find(std::string_view path) {
  const std::lock_guard lock(mutex_);
  const std::string_view name = path == "/" ? std::string_view("/index.html") : path;
  load(false);
  auto it = files_.find(name);
  // A build may have written its index before its last asset.
  if (const auto now = std::chrono::steady_clock::now(); it == files_.end() && now - last_miss_ > kRetryMisses) {
    last_miss_ = now;
    load(true);
    it = files_.find(name);
  }
  return it == files_.end() ? nullptr : it->second;
}

}  // namespace spectra::server
