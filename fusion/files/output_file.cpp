#include "fusion/files/output_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <mutex>
#include <set>
#include <system_error>
#include <utility>

namespace spectra::files {

namespace {

bool is_below(const std::filesystem::path& path, const std::filesystem::path& folder) {
  auto part = path.begin();
  for (const auto& folder_part : folder) {
    if (part == path.end() || *part != folder_part) return false;
    ++part;
  }
  return part != path.end();
}

/// The temporary files of this process. Whoever makes, renames or removes one holds the mutex, so that at any moment the
/// names are all there is.
struct UnfinishedFiles {
  std::mutex mutex;
  std::set<std::filesystem::path> names;
};

/// Never destroyed: a thread may still write while the process ends.
UnfinishedFiles& unfinished_files() {
  static auto* const files = new UnfinishedFiles;
  return *files;
}

/// fsync that a signal does not cut short.
int sync_descriptor(int descriptor) {
  int result = 0;
  do {
    result = ::fsync(descriptor);
  } while (result != 0 && errno == EINTR);
  return result;
}

/// Where links lead to, whether or not anything is there yet.
std::filesystem::path end_of_links(std::filesystem::path path) {
  constexpr int kMostLinks = 40;
  std::error_code error;
  for (int i = 0; i < kMostLinks && std::filesystem::is_symlink(path, error); ++i) {
    const std::filesystem::path next = std::filesystem::read_symlink(path, error);
    if (error) break;
    path = path.parent_path() / next;
  }
  return path;
}

}  // namespace

base::Result<void> OutputFile::check(const std::filesystem::path& path) {
  const auto refused = [&path](const std::string& why) {
    return base::Error{base::ErrorCode::FileUnwritable, path.string() + " " + why, path.string()};
  };
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    return refused("is a folder: name the file that is to be written into it");
  const std::filesystem::path folder = end_of_links(std::filesystem::absolute(path)).parent_path();
  if (!std::filesystem::is_directory(folder, ignored)) {
    return refused("cannot be created: there is no folder " + folder.string());
  }
  if (!std::filesystem::exists(path, ignored) && ::access(folder.c_str(), W_OK) != 0) {
    return refused("cannot be created: " + std::generic_category().message(errno));
  }
  return base::success();
}

base::Result<OutputFile> OutputFile::create(const std::filesystem::path& path) {
  OutputFile file;
  file.path_ = path;
  struct stat facts {};
  const bool exists = ::stat(path.c_str(), &facts) == 0;
  const std::filesystem::path plain = std::filesystem::absolute(path);
  if ((exists && !S_ISREG(facts.st_mode)) || is_below(plain.lexically_normal(), "/dev") ||
      is_below(plain.lexically_normal(), "/proc")) {
    file.descriptor_ = ::open(path.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
    if (file.descriptor_ < 0) return file.error("cannot be opened for writing", errno);
    return file;
  }
  std::error_code ignored;
  const std::filesystem::path resolved = std::filesystem::weakly_canonical(end_of_links(plain), ignored);
  file.target_ = resolved.empty() ? plain : resolved;

  // The process and a count make the name our own; O_EXCL makes sure of it.
  static std::atomic<unsigned> count{0};
  constexpr int kAttempts = 100;
  UnfinishedFiles& unfinished = unfinished_files();
  std::unique_lock lock(unfinished.mutex);
  for (int attempt = 0; attempt < kAttempts && file.descriptor_ < 0; ++attempt) {
    file.temporary_ = file.target_.parent_path() /
                      (".spectra-" + std::to_string(::getpid()) + "-" + std::to_string(count++) + ".part");
    file.descriptor_ = ::open(file.temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file.descriptor_ < 0 && errno != EEXIST) break;
  }
  if (file.descriptor_ < 0) {
    const int error_number = errno;
    file.temporary_.clear();
    return file.error("cannot be created", error_number);
  }
  unfinished.names.insert(file.temporary_);
  lock.unlock();
  if (exists && ::fchmod(file.descriptor_, facts.st_mode & 07777) != 0) {
    return file.error("cannot be given the permissions of the file it replaces", errno);
  }
  return file;
}

OutputFile::~OutputFile() {
  discard();
}

OutputFile::OutputFile(OutputFile&& other) noexcept {
  *this = std::move(other);
}

OutputFile& OutputFile::operator=(OutputFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(target_, other.target_);
  std::swap(temporary_, other.temporary_);
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

base::Result<void> OutputFile::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(descriptor_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return error("cannot be written", errno);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return base::success();
}

base::Result<void> OutputFile::commit() {
  return commit_all({this, 1});
}

base::Result<void> OutputFile::commit_all(std::span<OutputFile> files) {
  for (OutputFile& file : files) {
    BOOST_OUTCOME_TRYV(file.write_out());
  }
  {
    const std::lock_guard lock(unfinished_files().mutex);
    for (OutputFile& file : files) {
      BOOST_OUTCOME_TRYV(file.put_in_place());
    }
  }
  for (const OutputFile& file : files) {
    BOOST_OUTCOME_TRYV(file.sync_folder());
  }
  return base::success();
}

void OutputFile::abandon_all() {
  UnfinishedFiles& unfinished = unfinished_files();
  unfinished.mutex.lock();
  for (const auto& name : unfinished.names) ::unlink(name.c_str());
}

base::Result<void> OutputFile::write_out() {
  if (!temporary_.empty() && sync_descriptor(descriptor_) != 0) return error("cannot be written", errno);
  if (::close(std::exchange(descriptor_, -1)) != 0) return error("cannot be written", errno);
  return base::success();
}

base::Result<void> OutputFile::put_in_place() {
  if (temporary_.empty()) return base::success();
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) return error("cannot be put in place", errno);
  unfinished_files().names.erase(temporary_);
  temporary_.clear();
  return base::success();
}

base::Result<void> OutputFile::sync_folder() const {
  if (target_.empty()) return base::success();
  const int folder = ::open(target_.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder < 0) return error("is in place, but its folder cannot be synced", errno);
  const int result = sync_descriptor(folder);
  const int error_number = errno;
  ::close(folder);
  // Some file systems cannot sync a folder at all; that is theirs to know.
  if (result != 0 && error_number != EINVAL) {
    return error("is in place, but its folder cannot be synced", error_number);
  }
  return base::success();
}

base::Error OutputFile::error(const std::string& what, int error_number) const {
  return {base::ErrorCode::FileUnwritable,
          path_.string() + " " + what + ": " + std::generic_category().message(error_number), path_.string()};
}

void OutputFile::discard() {
  if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
  if (temporary_.empty()) return;
  UnfinishedFiles& unfinished = unfinished_files();
  const std::lock_guard lock(unfinished.mutex);
  ::unlink(temporary_.c_str());
  unfinished.names.erase(temporary_);
  temporary_.clear();
}

}  // namespace spectra::files
