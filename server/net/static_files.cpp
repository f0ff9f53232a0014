#include "server/net/static_files.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <boost/beast/core/string.hpp>
#include <charconv>
#include <fstream>
#include <functional>
#include <iterator>
#include <optional>
#include <system_error>
#include <utility>

namespace spectra::net {
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

constexpr std::string_view kAssets = "/assets/";

/// Names of content codings and the ends of the files' names.
constexpr std::array<std::pair<std::string_view, std::string_view>, 2> kCodings{{{"br", ".br"}, {"gzip", ".gz"}}};

/// How well "identity" is liked by who does not speak of it: less than what is named.
constexpr double kUnnamedIdentity = 1e-6;

std::optional<StaticVersion> read_version(const fs::path& path, std::string_view coding) {
  std::ifstream in(path, std::ios::binary);
  if (!in) return std::nullopt;
  return version_of({std::istreambuf_iterator<char>(in), {}}, coding);
}

/// Whether a file is another one in a content coding.
bool is_coded(const fs::path& path, std::string_view name) {
  return name.starts_with(kAssets) && std::any_of(kCodings.begin(), kCodings.end(), [&](const auto& coding) {
           return name.ends_with(coding.second) && fs::exists(fs::path(path).replace_extension());
         });
}

std::shared_ptr<const StaticFile> read_file(const fs::path& path, const std::string& name) {
  auto plain = read_version(path, {});
  if (!plain) return nullptr;
  auto file = std::make_shared<StaticFile>();
  file->content_type = content_type_of(name);
  file->immutable = name.starts_with(kAssets);
  file->versions.push_back(std::move(*plain));
  // Only these names change with the content, so that a version cannot be one of an older file.
  for (const auto& [coding, ending] : kCodings) {
    if (!file->immutable) break;
    if (auto version = read_version(path.string() + std::string(ending), coding)) {
      file->versions.push_back(std::move(*version));
    }
  }
  std::stable_sort(file->versions.begin(), file->versions.end(),
                   [](const auto& a, const auto& b) { return a.content.size() < b.content.size(); });
  return file;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t";
  const auto begin = text.find_first_not_of(kBlank);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlank) - begin + 1);
}

/// What stands before the first `separator`, which is cut off with it.
std::string_view cut_part(std::string_view& text, char separator) {
  const auto end = text.find(separator);
  const std::string_view part = trimmed(text.substr(0, end));
  text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
  return part;
}

/// A weight, such as "0.5"; what is none weighs nothing.
double quality(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool is_weight = error == std::errc() && end == text.data() + text.size() && value >= 0 && value <= 1;
  return is_weight ? value : 0;
}

bool same_word(std::string_view a, std::string_view b) {
  return boost::beast::iequals({a.data(), a.size()}, {b.data(), b.size()});
}

}  // namespace

StaticVersion version_of(std::string content, std::string_view coding) {
  StaticVersion version;
  version.coding = coding;
  version.etag = '"' + std::to_string(content.size()) + '-' + std::to_string(std::hash<std::string>{}(content)) + '"';
  version.content = std::move(content);
  return version;
}

double liking(std::string_view accept_encoding, std::string_view coding) {
  std::optional<double> of_others;
  while (!accept_encoding.empty()) {
    std::string_view entry = cut_part(accept_encoding, ',');
    const std::string_view name = cut_part(entry, ';');
    double weight = 1;
    while (!entry.empty()) {
      std::string_view value = cut_part(entry, ';');
      if (same_word(cut_part(value, '='), "q")) weight = quality(trimmed(value));
    }
    if (same_word(name, coding)) return weight;
    if (name == "*") of_others = weight;
  }
  return of_others.value_or(coding == "identity" ? kUnnamedIdentity : 0);
}

bool names_etag(std::string_view if_none_match, std::string_view etag) {
  while (!if_none_match.empty()) {
    std::string_view tag = cut_part(if_none_match, ',');
    if (tag.starts_with("W/")) tag.remove_prefix(2);
    if (tag == etag || tag == "*") return true;
  }
  return false;
}

const StaticVersion* StaticFile::version_for(std::string_view accept_encoding) const {
  const StaticVersion* best = nullptr;
  double best_liking = 0;
  for (const StaticVersion& version : versions) {
    const double its_liking = liking(accept_encoding, version.coding.empty() ? "identity" : version.coding);
    if (its_liking <= best_liking) continue;
    best = &version;
    best_liking = its_liking;
  }
  return best;
}

HttpReply file_reply(const std::shared_ptr<const StaticFile>& file, const HttpRequest& request, bool is_immutable) {
  const StaticVersion* const version = file->version_for(request.accept_encoding);
  HttpReply reply = version ? HttpReply{} : text_reply(406, "there is no version in such a content coding\n");
  if (file->versions.size() > 1) reply.headers.emplace_back("Vary", "Accept-Encoding");
  if (!version) return reply;
  reply.headers.emplace_back("ETag", version->etag);
  reply.headers.emplace_back("Cache-Control", is_immutable ? "public, max-age=31536000, immutable" : "no-cache");
  if (names_etag(request.if_none_match, version->etag)) {
    reply.status = 304;
    return reply;
  }
  if (!version->coding.empty()) reply.headers.emplace_back("Content-Encoding", version->coding);
  reply.content_type = file->content_type;
  reply.body = std::shared_ptr<const std::string>(file, &version->content);
  return reply;
}

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
    if (is_coded(it->path(), name)) continue;
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

}  // namespace spectra::net
