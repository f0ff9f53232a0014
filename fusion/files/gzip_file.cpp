#include "fusion/files/gzip_file.hpp"

#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace spectra::files {

struct GzipFile::Handle {
  explicit Handle(gzFile opened) : file(opened) {}
  ~Handle() { ::gzclose_r(file); }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  gzFile file;
};

GzipFile::GzipFile(std::unique_ptr<Handle> handle) : handle_(std::move(handle)) {}
GzipFile::~GzipFile() = default;
GzipFile::GzipFile(GzipFile&&) noexcept = default;
GzipFile& GzipFile::operator=(GzipFile&&) noexcept = default;

bool GzipFile::is_gzip(std::span<const unsigned char> first_bytes) {
  return first_bytes.size() >= 2 && first_bytes[0] == 0x1f && first_bytes[1] == 0x8b;
}

base::Result<GzipFile> GzipFile::open(int descriptor, std::uint64_t packed_bytes) {
  const gzFile opened = ::gzdopen(descriptor, "rb");
  if (opened == nullptr) {
    ::close(descriptor);
    return base::failure(base::ErrorCode::FileUnreadable, "cannot be unpacked: out of memory");
  }
  constexpr unsigned kPackedBufferBytes = 128 * 1024;
  ::gzbuffer(opened, kPackedBufferBytes);
  GzipFile file(std::make_unique<Handle>(opened));

  const std::uint64_t limit = std::max(kFreeBytes, kMaxRatio * packed_bytes);
  std::vector<unsigned char> bytes(std::size_t{256} * 1024);
  for (;;) {
    const int count = ::gzread(opened, bytes.data(), static_cast<unsigned>(bytes.size()));
    int status = Z_OK;
    ::gzerror(opened, &status);
    if (status == Z_BUF_ERROR) {
      return base::failure(base::ErrorCode::Truncated,
                           "the gzip data end early: the file was cut; copy it again whole");
    }
    if (count < 0 || status != Z_OK) {
      return base::failure(base::ErrorCode::BadValue,
                           "the gzip data are damaged: copy the file again, as binary, or pack it again");
    }
    if (count == 0) break;
    file.unpacked_bytes_ += static_cast<std::uint64_t>(count);
    if (file.unpacked_bytes_ > limit) {
      return base::failure(base::ErrorCode::TooLarge, "the gzip data unpack to more than " + std::to_string(kMaxRatio) +
                                                          " times their " + std::to_string(packed_bytes) +
                                                          " bytes; unpack the file first if you trust it (gunzip)");
    }
  }
  return file;
}

std::ptrdiff_t GzipFile::read(std::uint64_t position, std::span<unsigned char> bytes) {
  const auto wanted = static_cast<z_off_t>(position);
  if (::gztell(handle_->file) != wanted && ::gzseek(handle_->file, wanted, SEEK_SET) != wanted) return -1;
  constexpr std::size_t kMaxBytes = std::numeric_limits<int>::max();
  return ::gzread(handle_->file, bytes.data(), static_cast<unsigned>(std::min(bytes.size(), kMaxBytes)));
}

}  // namespace spectra::files
