#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "fusion/base/error.hpp"
#include "fusion/base/vertex_types.hpp"

namespace spectra::mapping {

/// A picture, row after row from the top.
template <class Pixel>
struct Picture {
  int width = 0;
  int height = 0;
  std::vector<Pixel> pixels;

  bool empty() const { return pixels.empty(); }
  const Pixel& at(int x, int y) const {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  }
};

using Picture16 = Picture<std::uint16_t>;
using PictureRgb = Picture<base::Rgb8>;
using PictureFloat = Picture<float>;

/// Pictures of at most 8192 x 8192 pixels. All are safe on untrusted input: what is truncated, damaged or of another kind is an error
/// that names the file, and no more memory is taken than the head of the file justifies.
base::Result<Picture16> read_png16(const std::filesystem::path& file);    ///< Grey, 16 bits.
base::Result<PictureRgb> read_colour(const std::filesystem::path& file);  ///< JPEG, or PNG of 8 bits a channel.
/// The same of bytes in memory, which a message calls `name`.
base::Result<Picture16> png16_of(std::span<const unsigned char> bytes, const std::string& name);
base::Result<PictureRgb> colour_of(std::span<const unsigned char> bytes, const std::string& name);
base::Result<PictureFloat> read_pfm(
    const std::filesystem::path& file);  ///< One channel; rows from the bottom in the file.

base::Result<void> write_png16(const std::filesystem::path& file, const Picture16& picture);
base::Result<void> write_jpeg(const std::filesystem::path& file, const PictureRgb& picture, int quality);
base::Result<void> write_pfm(const std::filesystem::path& file, const PictureFloat& picture);

}  // namespace spectra::mapping
