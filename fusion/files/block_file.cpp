#include "fusion/files/block_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

namespace spectra::files {

base::Result<BlockFile> BlockFile::open(const std::filesystem::path& path) {
  // O_NONBLOCK: opening a named pipe must not wait for a writer that never comes.
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) {
    const int error = errno;
    const bool is_missing = error == ENOENT || error == ENOTDIR;
    return base::failure(is_missing ? base::ErrorCode::FileNotFound : base::ErrorCode::FileUnreadable,
                         is_missing ? "no such file" : "cannot be opened: " + std::generic_category().message(error));
  }
  struct stat facts {};
  if (::fstat(descriptor, &facts) != 0 || !S_ISREG(facts.st_mode)) {
    ::close(descriptor);
    return base::failure(base::ErrorCode::FileUnreadable,
                         S_ISDIR(facts.st_mode) ? "is a folder, not a file" : "is not a regular file");
  }
  ::posix_fadvise(descriptor, 0, 0, POSIX_FADV_SEQUENTIAL);
  const auto size_bytes = static_cast<std::uint64_t>(facts.st_size);
  std::array<unsigned char, 2> first_bytes{};
  if (::pread(descriptor, first_bytes.data(), first_bytes.size(), 0) == static_cast<ssize_t>(first_bytes.size()) &&
      GzipFile::is_gzip(first_bytes)) {
    BOOST_OUTCOME_TRY(GzipFile gzip, GzipFile::open(descriptor, size_bytes));
    BlockFile file(-1, gzip.unpacked_bytes());
    file.gzip_ = std::move(gzip);
    return file;
  }
  return BlockFile(descriptor, size_bytes);
}

BlockFile::BlockFile(int descriptor, std::uint64_t size_bytes)
    : descriptor_(descriptor),
      size_bytes_(size_bytes),
      buffer_(static_cast<std::size_t>(std::min<std::uint64_t>(kBufferBytes, size_bytes))) {}

BlockFile::~BlockFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

BlockFile::BlockFile(BlockFile&& other) noexcept {
  *this = std::move(other);
}

BlockFile& BlockFile::operator=(BlockFile&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  std::swap(gzip_, other.gzip_);
  std::swap(size_bytes_, other.size_bytes_);
  std::swap(buffer_position_, other.buffer_position_);
  std::swap(begin_, other.begin_);
  std::swap(end_, other.end_);
  std::swap(read_error_, other.read_error_);
  std::swap(buffer_, other.buffer_);
  std::swap(watcher_, other.watcher_);
  return *this;
}

void BlockFile::fill() {
  if (watcher_)
    watcher_(static_cast<double>(position()) / static_cast<double>(std::max<std::uint64_t>(size_bytes_, 1)));
  std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_), buffer_.begin() + static_cast<std::ptrdiff_t>(end_),
            buffer_.begin());
  buffer_position_ += begin_;
  end_ -= begin_;
  begin_ = 0;
  while (end_ < buffer_.size() && buffer_position_ + end_ < size_bytes_) {
    const std::uint64_t wanted = std::min<std::uint64_t>(buffer_.size() - end_, size_bytes_ - buffer_position_ - end_);
    const auto count =
        read_at(buffer_position_ + end_, std::span(buffer_).subspan(end_, static_cast<std::size_t>(wanted)));
    if (count < 0) read_error_ = errno;
    if (count <= 0) return;
    end_ += static_cast<std::size_t>(count);
  }
}

std::ptrdiff_t BlockFile::read_at(std::uint64_t position, std::span<unsigned char> bytes) {
  if (gzip_) {
    errno = EIO;  // What zlib finds wrong on its second way through the file is no error of the system.
    return gzip_->read(position, bytes);
  }
  for (;;) {
    const ssize_t count = ::pread(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(position));
    if (count >= 0 || errno != EINTR) return count;
  }
}

void BlockFile::skip(std::uint64_t count) {
  if (count <= end_ - begin_) {
    begin_ += static_cast<std::size_t>(count);
  } else {
    seek(position() + count);
  }
}

void BlockFile::seek(std::uint64_t position) {
  buffer_position_ = position;
  begin_ = 0;
  end_ = 0;
}

}  // namespace spectra::files
