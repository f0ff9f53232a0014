#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "fusion/base/error.hpp"

namespace spectra::files {

/// A gzip file, unpacked as it is read; nothing of it is ever held whole. Reading backwards unpacks again from the beginning.
class GzipFile {
 public:
  /// Files that unpack to no more than this are read whatever their ratio; larger ones up to kMaxRatio times their size: a
  /// file that grows more than any scene does is one that was made to fill a machine.
  static constexpr std::uint64_t kFreeBytes = std::uint64_t{64} * 1024 * 1024;
  static constexpr std::uint64_t kMaxRatio = 100;

  /// The first bytes are those of gzip.
  static bool is_gzip(std::span<const unsigned char> first_bytes);

  /// Takes the open file of that size, and unpacks it once to its end to know how much is in it: Truncated, BadValue
  /// (damaged) or TooLarge.
  static base::Result<GzipFile> open(int descriptor, std::uint64_t packed_bytes);
  ~GzipFile();
  GzipFile(GzipFile&&) noexcept;
  GzipFile& operator=(GzipFile&&) noexcept;

  std::uint64_t unpacked_bytes() const { return unpacked_bytes_; }
  /// Of the file, after the last of its gzip members: padding, or what somebody has appended.
  std::uint64_t trailing_bytes() const { return trailing_bytes_; }

  /// The unpacked bytes from `position` on: how many were read, 0 at the end, -1 when they cannot be read.
  std::ptrdiff_t read(std::uint64_t position, std::span<unsigned char> bytes);

 private:
  struct Handle;
  explicit GzipFile(std::unique_ptr<Handle> handle);

  std::unique_ptr<Handle> handle_;
  std::uint64_t unpacked_bytes_ = 0;
  std::uint64_t trailing_bytes_ = 0;
};

}  // namespace spectra::files
