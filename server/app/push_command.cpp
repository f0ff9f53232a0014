#include <spdlog/fmt/fmt.h>
#include <sys/stat.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "fusion/base/progress.hpp"
#include "server/app/command_output.hpp"
#include "server/app/commands.hpp"
#include "server/app/interruption.hpp"
#include "server/app/progress_line.hpp"
#include "server/net/ingest_client.hpp"
#include "server/net/request_target.hpp"
#include "server/sources/block_options.hpp"
#include "server/store/block_record.hpp"

namespace spectra::app {
namespace fs = std::filesystem;
namespace {

constexpr std::string_view kPushingPhase = "pushing";

struct BlockFile {
  fs::path path;
  std::string id;
};

/// The name without .ply or .ply.gz; nothing when it has neither.
std::optional<std::string> block_id_of(const fs::path& path) {
  const std::string name = path.filename().string();
  std::string lower = name;
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const std::string_view ending : {".ply", ".ply.gz"}) {
    if (lower.ends_with(ending)) return name.substr(0, name.size() - ending.size());
  }
  return std::nullopt;
}

std::string no_name(const std::string& id) {
  return "\"" + id + "\" is no name of a block (1 to 64 of a-z A-Z 0-9 . _ -); rename the file";
}

base::Result<std::vector<BlockFile>> block_files(const PushOptions& options) {
  const auto failed = [&](const std::string& what) {
    return base::failure(base::ErrorCode::FileUnreadable, options.input.string() + ": " + what);
  };
  std::vector<BlockFile> files;
  std::error_code error;
  if (!fs::is_directory(options.input, error)) {
    if (!fs::exists(options.input, error)) return failed("there is no such file or folder");
    files.push_back({options.input, !options.id.empty()
                                        ? options.id
                                        : block_id_of(options.input).value_or(options.input.filename().string())});
  } else {
    if (!options.id.empty()) return failed("--id names the block of one file, and this is a folder");
    for (fs::directory_iterator entry(options.input, error), end; !error && entry != end; entry.increment(error)) {
      std::error_code ignored;
      const auto id = block_id_of(entry->path());
      if (id && !entry->is_directory(ignored)) files.push_back({entry->path(), *id});
    }
    if (error) return failed(error.message());
    if (files.empty()) return failed("there is no PLY file in this folder");
  }
  std::sort(files.begin(), files.end(),
            [](const auto& a, const auto& b) { return a.path.filename() < b.path.filename(); });
  std::map<std::string, fs::path> named;
  for (const BlockFile& file : files) {
    // In a folder the others go on.
    if (!store::is_block_id(file.id) && files.size() == 1) {
      return base::failure(base::ErrorCode::FileUnreadable,
                           file.path.string() + ": " + no_name(file.id) + ", or name the block with --id");
    }
    const auto [other, is_new] = named.emplace(file.id, file.path);
    if (!is_new) {
      return failed(other->second.filename().string() + " and " + file.path.filename().string() +
                    " would both be block " + file.id);
    }
  }
  return files;
}

std::string seconds_text(double seconds) {
  return fmt::format("{:.3f}", seconds);
}

/// What is said of the time of a file; nothing when it cannot be told.
std::string observed_at(const std::string& asked, const fs::path& path) {
  if (asked == "now") {
    const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
    return seconds_text(std::chrono::duration<double>(since_1970).count());
  }
  if (asked != "file") return asked;
  struct stat facts {};
  if (::stat(path.c_str(), &facts) != 0) return "";
  return seconds_text(static_cast<double>(facts.st_mtim.tv_sec) + 1e-9 * static_cast<double>(facts.st_mtim.tv_nsec));
}

/// What the server is shown; empty for none. Nothing when the file has none.
std::optional<std::string> token_of(const PushOptions& options) {
  std::string token;
  if (options.token_file) {
    std::ifstream file(*options.token_file);
    if (!(file >> token)) return std::nullopt;
  } else if (const char* text = std::getenv("SPECTRA_TOKEN")) {
    token = text;
  }
  return token;
}

/// Sends files and keeps the account of what has become of them.
class Push {
 public:
  Push(const PushOptions& options, std::vector<BlockFile> files, const net::IngestAddress& to, std::string token)
      : options_(options),
        token_(std::move(token)),
        files_(std::move(files)),
        to_(to),
        line_({{kPushingPhase, "pushing " + options.input.filename().string() + " to " + to.authority(), 1}}),
        progress_(line_.sink()) {}

  int run() {
    const auto begin = std::chrono::steady_clock::now();
    const net::BlocksToSend blocks{files_.size(), [this](std::size_t i, std::uint64_t most) { return read(i, most); },
                                   [this](std::size_t i, const auto& answer) { acknowledged(i, answer); },
                                   [this](std::size_t i, const auto& answer) { refused(i, answer); },
                                   [](const std::string& why) { warn(why + "; connecting again"); }};
    net::SendingLimits limits;
    limits.blocks_per_s = options_.blocks_per_s;
    limits.token = token_;
    if (options_.trusted) limits.trusted = options_.trusted->string();
    const auto problem = net::send_blocks(to_, blocks, limits);
    line_.end();
    print_notes(notes());
    const std::string done = fmt::format("{} of {} block{} acknowledged", acknowledged_count_, files_.size(),
                                         files_.size() == 1 ? " is" : "s are");
    if (problem) return fail(kJobFailed, acknowledged_count_ > 0 ? *problem + "; " + done : *problem);
    if (acknowledged_count_ < files_.size()) return fail(kJobFailed, done);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    fmt::print("{} in {:.1f} s\n", done, took.count());
    return kDone;
  }

 private:
  std::optional<net::OutgoingBlock> read(std::size_t index, std::uint64_t max_block_bytes) {
    const BlockFile& file = files_[index];
    const auto leave_out = [&](const std::string& why) {
      settled(index);
      warn(file.path.string() + ": " + why);
      return std::nullopt;
    };
    if (!store::is_block_id(file.id)) return leave_out(no_name(file.id));
    std::ifstream in(file.path, std::ios::binary);
    std::error_code error;
    const auto size = fs::file_size(file.path, error);
    if (!in || error) return leave_out("cannot be read");
    if (size > max_block_bytes) {
      return leave_out(fmt::format("is {} bytes, and the server takes blocks of {} at most", size, max_block_bytes));
    }
    auto query = sources::query_of(options_.read);
    if (auto time = observed_at(options_.observed_at, file.path); !time.empty()) {
      query.insert(query.begin(), {"observed_at", std::move(time)});
    }
    net::OutgoingBlock block{net::target_text(file.id, query), std::string(static_cast<std::size_t>(size), '\0')};
    if (!in.read(block.ply.data(), static_cast<std::streamsize>(size))) return leave_out("cannot be read to its end");
    return block;
  }

  void acknowledged(std::size_t index, const protocol::IngestAcknowledged& answer) {
    ++acknowledged_count_;
    settled(index);
    for (const protocol::SceneNote& note : answer.notes) {
      auto& told = notes_[note.id];
      if (told.block_count++ == 0) told.message = files_[index].id + ": " + note.message;
    }
  }

  void refused(std::size_t index, const protocol::IngestRefused& answer) {
    settled(index);
    warn(files_[index].path.string() + " is refused: " + answer.reason +
         (answer.limits.empty() ? "" : " (" + answer.limits + ")"));
  }

  void settled(std::size_t index) {
    settled_.insert(index);
    base::report(progress_, kPushingPhase, static_cast<double>(settled_.size()) / static_cast<double>(files_.size()));
  }

  std::vector<files::Note> notes() const {
    std::vector<files::Note> notes;
    for (const auto& [id, told] : notes_) {
      const std::string more =
          told.block_count > 1 ? fmt::format(" (and {} more blocks)", told.block_count - 1) : std::string();
      notes.push_back({id, told.block_count, told.message + more});
    }
    return notes;
  }

  struct Told {
    std::string message;
    std::uint64_t block_count = 0;
  };

  const PushOptions& options_;
  const std::string token_;
  const std::vector<BlockFile> files_;
  const net::IngestAddress& to_;
  ProgressLine line_;
  const base::Progress progress_;
  std::size_t acknowledged_count_ = 0;
  std::set<std::size_t> settled_;
  std::map<std::string, Told> notes_;
};

}  // namespace

int run_push(const PushOptions& options) {
  const Interruption interruption;
  const auto address = net::parsed_ingest_address(options.to);
  if (const auto* wrong = std::get_if<std::string>(&address)) return fail(kWrongUsage, "--to " + *wrong);
  if (const auto meant = files::check_read_options(options.read); !meant) return fail(meant.error());
  auto files = block_files(options);
  if (!files) return fail(files.error());
  auto token = token_of(options);
  if (!token) return fail(kJobFailed, options.token_file->string() + ": there is no token in its first line");
  return Push(options, std::move(files).value(), std::get<net::IngestAddress>(address), std::move(*token)).run();
}

}  // namespace spectra::app
