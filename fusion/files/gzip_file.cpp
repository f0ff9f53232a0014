#include "fusion/files/gzip_file.hpp"

#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <limits>
#include <string>
#include <system_error>
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

namespace {

constexpr unsigned kPackedBufferBytes = 128 * 1024;

struct Measured {
  std::uint64_t unpacked_bytes = 0;
  std::uint64_t trailing_bytes = 0;
};

/// Unpacks what is packed once, to know how much it is and where it ends: zlib's own files pass over what follows without a word.
class Measure {
 public:
  Measure(int descriptor, std::uint64_t packed_bytes) : descriptor_(descriptor), packed_bytes_(packed_bytes) {
    is_ready_ = ::inflateInit2(&stream_, kGzip) == Z_OK;
  }
  ~Measure() {
    if (is_ready_) ::inflateEnd(&stream_);
  }
  Measure(const Measure&) = delete;
  Measure& operator=(const Measure&) = delete;

  base::Result<Measured> run() {
    if (!is_ready_) return base::failure(base::ErrorCode::FileUnreadable, "cannot be unpacked: out of memory");
    const std::uint64_t limit = std::max(GzipFile::kFreeBytes, GzipFile::kMaxRatio * packed_bytes_);
    Measured result;
    for (;;) {
      if (stream_.avail_in == 0) {
        BOOST_OUTCOME_TRYV(fill());
      }
      if (stream_.avail_in == 0) return cut();
      stream_.next_out = unpacked_.data();
      stream_.avail_out = static_cast<uInt>(unpacked_.size());
      const int status = ::inflate(&stream_, Z_NO_FLUSH);
      if (status != Z_OK && status != Z_STREAM_END) {
        return base::failure(base::ErrorCode::BadValue,
                             "the gzip data are damaged: copy the file again, as binary, or pack it again");
      }
      result.unpacked_bytes += unpacked_.size() - stream_.avail_out;
      if (result.unpacked_bytes > limit) {
        return base::failure(base::ErrorCode::TooLarge, "the gzip data unpack to more than " +
                                                            std::to_string(GzipFile::kMaxRatio) + " times their " +
                                                            std::to_string(packed_bytes_) +
                                                            " bytes; unpack the file first if you trust it (gunzip)");
      }
      if (status == Z_OK) continue;
      // Another member may follow, which is a part of the same data.
      if (stream_.avail_in < 2) {
        BOOST_OUTCOME_TRYV(fill());
      }
      const bool is_next = GzipFile::is_gzip({stream_.next_in, stream_.avail_in});
      if (!is_next) {
        result.trailing_bytes = stream_.avail_in + packed_bytes_ - std::min(packed_bytes_, read_bytes_);
        return result;
      }
      ::inflateReset(&stream_);
    }
  }

 private:
  static constexpr int kGzip = 15 + 16;

  static base::Error cut() {
    return {base::ErrorCode::Truncated, "the gzip data end early: the file was cut; copy it again whole", {}};
  }

  /// Keeps what was not taken yet.
  base::Result<void> fill() {
    std::copy(stream_.next_in, stream_.next_in + stream_.avail_in, packed_.begin());
    while (stream_.avail_in < packed_.size()) {
      const ssize_t count = ::pread(descriptor_, packed_.data() + stream_.avail_in, packed_.size() - stream_.avail_in,
                                    static_cast<off_t>(read_bytes_));
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) {
        return base::failure(base::ErrorCode::FileUnreadable,
                             "cannot be read: " + std::generic_category().message(errno));
      }
      if (count == 0) break;
      stream_.avail_in += static_cast<uInt>(count);
      read_bytes_ += static_cast<std::uint64_t>(count);
    }
    stream_.next_in = packed_.data();
    return base::success();
  }

  int descriptor_;
  std::uint64_t packed_bytes_;
  std::uint64_t read_bytes_ = 0;
  bool is_ready_ = false;
  std::vector<unsigned char> packed_ = std::vector<unsigned char>(kPackedBufferBytes);
  std::vector<unsigned char> unpacked_ = std::vector<unsigned char>(std::size_t{256} * 1024);
  z_stream stream_{};
};

base::Result<Measured> measured(int descriptor, std::uint64_t packed_bytes) {
  return Measure(descriptor, packed_bytes).run();
}

}  // namespace

GzipFile::GzipFile(std::unique_ptr<Handle> handle) : handle_(std::move(handle)) {}
GzipFile::~GzipFile() = default;
GzipFile::GzipFile(GzipFile&&) noexcept = default;
GzipFile& GzipFile::operator=(GzipFile&&) noexcept = default;

bool GzipFile::is_gzip(std::span<const unsigned char> first_bytes) {
  return first_bytes.size() >= 2 && first_bytes[0] == 0x1f && first_bytes[1] == 0x8b;
}

base::Result<GzipFile> GzipFile::open(int descriptor, std::uint64_t packed_bytes) {
  const auto found = measured(descriptor, packed_bytes);
  if (!found) {
    ::close(descriptor);
    return found.error();
  }
  const gzFile opened = ::gzdopen(descriptor, "rb");
  if (opened == nullptr) {
    ::close(descriptor);
    return base::failure(base::ErrorCode::FileUnreadable, "cannot be unpacked: out of memory");
  }
  ::gzbuffer(opened, kPackedBufferBytes);
  GzipFile file(std::make_unique<Handle>(opened));
  file.unpacked_bytes_ = found.value().unpacked_bytes;
  file.trailing_bytes_ = found.value().trailing_bytes;
  return file;
}

std::ptrdiff_t GzipFile::read(std::uint64_t position, std::span<unsigned char> bytes) {
  const auto wanted = static_cast<z_off_t>(position);
  if (::gztell(handle_->file) != wanted && ::gzseek(handle_->file, wanted, SEEK_SET) != wanted) return -1;
  constexpr std::size_t kMaxBytes = std::numeric_limits<int>::max();
  return ::gzread(handle_->file, bytes.data(), static_cast<unsigned>(std::min(bytes.size(), kMaxBytes)));
}

}  // namespace spectra::files
