#include "server/mapping/picture_file.hpp"

#include <png.h>
#include <turbojpeg.h>

#include <bit>
#include <cmath>
#include <csetjmp>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <span>

namespace spectra::mapping {
namespace {

using base::ErrorCode;
using base::Result;

constexpr int kMostPixels = 8192;
constexpr std::uint64_t kMostBytes = std::uint64_t{512} << 20;

auto failed(const std::filesystem::path& file, const std::string& what) {
  return base::failure(ErrorCode::FileUnreadable, file.string() + ": " + what);
}

Result<std::vector<unsigned char>> bytes_of(const std::filesystem::path& file) {
  std::error_code error;
  const auto size = std::filesystem::file_size(file, error);
  std::ifstream in(file, std::ios::binary);
  if (error || !in) return base::failure(ErrorCode::FileNotFound, file.string() + ": cannot be read");
  if (size > kMostBytes) return failed(file, "is larger than any picture");
  std::vector<unsigned char> bytes(static_cast<std::size_t>(size));
  in.read(std::bit_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (static_cast<std::size_t>(in.gcount()) != bytes.size()) return failed(file, "cannot be read to its end");
  return bytes;
}

/// What libpng reads from and complains to. Its errors come back by longjmp, so that no object with a destructor may begin between.
struct PngInput {
  std::span<const unsigned char> bytes;
  std::size_t position = 0;
  std::jmp_buf on_error;
  char message[120] = "";
};

void read_bytes(png_structp png, png_bytep out, png_size_t count) {
  auto* input = static_cast<PngInput*>(png_get_io_ptr(png));
  if (input->bytes.size() - input->position < count) png_error(png, "the file ends too soon");
  std::memcpy(out, input->bytes.data() + input->position, count);
  input->position += count;
}

[[noreturn]] void on_png_error(png_structp png, png_const_charp message) {
  auto* input = static_cast<PngInput*>(png_get_error_ptr(png));
  std::strncpy(input->message, message, sizeof input->message - 1);
  std::longjmp(input->on_error, 1);
}

void on_png_warning(png_structp, png_const_charp) {}

/// What a PNG holds: rows of 16-bit grey (native order) or 8-bit red, green, blue.
struct PngRows {
  int width = 0, height = 0;
  bool is_wide_grey = false;
  std::vector<unsigned char> bytes;
};

/// The head alone, or everything once `rows.bytes` has its size. False: `input.message` says why.
bool decode(PngInput& input, PngRows& rows, bool want_rows) {
  input.position = 0;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &input, on_png_error, on_png_warning);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  if (info == nullptr) return false;
  if (setjmp(input.on_error) != 0) {  // NOLINT: libpng has no other way
    png_destroy_read_struct(&png, &info, nullptr);
    return false;
  }
  png_set_user_limits(png, kMostPixels, kMostPixels);
  png_set_read_fn(png, &input, read_bytes);
  png_read_info(png, info);
  const bool is_grey = png_get_color_type(png, info) == PNG_COLOR_TYPE_GRAY;
  rows.is_wide_grey = is_grey && png_get_bit_depth(png, info) == 16;
  rows.width = static_cast<int>(png_get_image_width(png, info));
  rows.height = static_cast<int>(png_get_image_height(png, info));
  if (rows.is_wide_grey) {
    if constexpr (std::endian::native == std::endian::little) png_set_swap(png);
  } else {
    png_set_expand(png);
    png_set_strip_16(png);
    png_set_strip_alpha(png);
    png_set_gray_to_rgb(png);
  }
  const int passes = png_set_interlace_handling(png);
  png_read_update_info(png, info);
  const std::size_t stride = png_get_rowbytes(png, info);
  if (want_rows) {
    if (rows.bytes.size() != stride * static_cast<std::size_t>(rows.height)) png_error(png, "its head changes");
    for (int pass = 0; pass < passes; ++pass) {
      for (int y = 0; y < rows.height; ++y) {
        png_read_row(png, rows.bytes.data() + stride * static_cast<std::size_t>(y), nullptr);
      }
    }
    png_read_end(png, nullptr);
  }
  png_destroy_read_struct(&png, &info, nullptr);
  return true;
}

Result<PngRows> read_png(const std::filesystem::path& file, std::span<const unsigned char> bytes) {
  auto input = std::make_unique<PngInput>();
  input->bytes = bytes;
  PngRows rows;
  if (!decode(*input, rows, false)) return failed(file, std::string("is no whole PNG: ") + input->message);
  const auto pixels = static_cast<std::size_t>(rows.width) * static_cast<std::size_t>(rows.height);
  // deflate packs at most about 1032 to 1
  if (pixels / 1100 > bytes.size()) return failed(file, "promises more pixels than it can hold");
  rows.bytes.resize(pixels * (rows.is_wide_grey ? 2 : 3));
  if (!decode(*input, rows, true)) return failed(file, std::string("is no whole PNG: ") + input->message);
  return rows;
}

bool is_png(std::span<const unsigned char> bytes) {
  return bytes.size() > 8 && png_sig_cmp(bytes.data(), 0, 8) == 0;
}

struct JpegHandle {
  tjhandle handle;
  explicit JpegHandle(tjhandle made) : handle(made) {}
  JpegHandle(const JpegHandle&) = delete;
  JpegHandle& operator=(const JpegHandle&) = delete;
  ~JpegHandle() {
    if (handle != nullptr) tjDestroy(handle);
  }
};

Result<PictureRgb> read_jpeg(const std::filesystem::path& file, std::span<const unsigned char> bytes) {
  const JpegHandle jpeg(tjInitDecompress());
  PictureRgb picture;
  int subsampling = 0, colours = 0;
  const auto size = static_cast<unsigned long>(bytes.size());
  if (jpeg.handle == nullptr || tjDecompressHeader3(jpeg.handle, bytes.data(), size, &picture.width, &picture.height,
                                                    &subsampling, &colours) != 0) {
    return failed(file, "is neither a JPEG nor a PNG picture");
  }
  const auto pixels = static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height);
  if (picture.width > kMostPixels || picture.height > kMostPixels || pixels / 5000 > bytes.size()) {
    return failed(file, "promises more pixels than it can hold");
  }
  picture.pixels.resize(pixels);
  // A warning too means that pixels are missing or wrong.
  if (tjDecompress2(jpeg.handle, bytes.data(), size, &picture.pixels.front().r, picture.width, 0, picture.height,
                    TJPF_RGB, TJFLAG_ACCURATEDCT) != 0) {
    return failed(file, std::string("is no whole JPEG: ") + tjGetErrorStr2(jpeg.handle));
  }
  return picture;
}

Result<void> write_bytes(const std::filesystem::path& file, std::span<const unsigned char> bytes) {
  std::ofstream out(file, std::ios::binary);
  out.write(std::bit_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out) return base::failure(ErrorCode::FileUnwritable, file.string() + ": cannot be written");
  return base::success();
}

}  // namespace

Result<Picture16> png16_of(std::span<const unsigned char> bytes, const std::string& file) {
  if (!is_png(bytes)) return failed(file, "is no PNG");
  BOOST_OUTCOME_TRY(const auto rows, read_png(file, bytes));
  if (!rows.is_wide_grey) return failed(file, "is no PNG of 16-bit grey");
  Picture16 picture{rows.width, rows.height, std::vector<std::uint16_t>(rows.bytes.size() / 2)};
  std::memcpy(picture.pixels.data(), rows.bytes.data(), rows.bytes.size());
  return picture;
}

Result<PictureRgb> colour_of(std::span<const unsigned char> bytes, const std::string& file) {
  if (!is_png(bytes)) return read_jpeg(file, bytes);
  BOOST_OUTCOME_TRY(const auto rows, read_png(file, bytes));
  if (rows.is_wide_grey) return failed(file, "is a PNG of 16-bit grey, no colour picture");
  PictureRgb picture{rows.width, rows.height, std::vector<base::Rgb8>(rows.bytes.size() / 3)};
  std::memcpy(&picture.pixels.front().r, rows.bytes.data(), rows.bytes.size());
  return picture;
}

Result<Picture16> read_png16(const std::filesystem::path& file) {
  BOOST_OUTCOME_TRY(const auto bytes, bytes_of(file));
  return png16_of(bytes, file.string());
}

Result<PictureRgb> read_colour(const std::filesystem::path& file) {
  BOOST_OUTCOME_TRY(const auto bytes, bytes_of(file));
  return colour_of(bytes, file.string());
}

Result<PictureFloat> read_pfm(const std::filesystem::path& file) {
  BOOST_OUTCOME_TRY(const auto bytes, bytes_of(file));
  // "Pf", width, height, scale; then one white space and the rows.
  const std::string head(bytes.begin(),
                         bytes.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(bytes.size(), 80)));
  PictureFloat picture;
  float scale = 0;
  int used = 0;
  if (std::sscanf(head.c_str(), "Pf %d %d %f%n", &picture.width, &picture.height, &scale, &used) != 3) {
    return failed(file, "is no PFM picture of one channel");
  }
  const auto begin = static_cast<std::size_t>(used) + 1;
  const bool is_size =
      picture.width > 0 && picture.height > 0 && picture.width <= kMostPixels && picture.height <= kMostPixels;
  const auto pixels = is_size ? static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height) : 0;
  if (!is_size || bytes.size() < begin + 4 * pixels) return failed(file, "ends before its last pixel");
  if (scale >= 0) return failed(file, "has big-endian numbers, which are not read; write it with a negative scale");
  picture.pixels.resize(pixels);
  const auto width = static_cast<std::size_t>(picture.width), height = static_cast<std::size_t>(picture.height);
  for (std::size_t y = 0; y < height; ++y) {
    std::memcpy(&picture.pixels[(height - 1 - y) * width], bytes.data() + begin + 4 * y * width, 4 * width);
  }
  for (const float value : picture.pixels) {
    if (!std::isfinite(value)) return failed(file, "has values that are no numbers");
  }
  return picture;
}

Result<void> write_png16(const std::filesystem::path& file, const Picture16& picture) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.width);
  image.height = static_cast<png_uint_32>(picture.height);
  image.format = PNG_FORMAT_LINEAR_Y;
  image.flags = PNG_IMAGE_FLAG_FAST;
  if (png_image_write_to_file(&image, file.c_str(), 0, picture.pixels.data(), 0, nullptr) == 0) {
    return base::failure(ErrorCode::FileUnwritable, file.string() + ": cannot be written: " + image.message);
  }
  return base::success();
}

Result<void> write_jpeg(const std::filesystem::path& file, const PictureRgb& picture, int quality) {
  const JpegHandle jpeg(tjInitCompress());
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  const int status = jpeg.handle == nullptr
                         ? -1
                         : tjCompress2(jpeg.handle, &picture.pixels.front().r, picture.width, 0, picture.height,
                                       TJPF_RGB, &bytes, &size, TJSAMP_444, quality, TJFLAG_ACCURATEDCT);
  const std::unique_ptr<unsigned char, void (*)(unsigned char*)> owned(bytes, tjFree);
  if (status != 0) return base::failure(ErrorCode::FileUnwritable, file.string() + ": cannot be packed");
  return write_bytes(file, {bytes, size});
}

Result<void> write_pfm(const std::filesystem::path& file, const PictureFloat& picture) {
  const std::string head = "Pf\n" + std::to_string(picture.width) + " " + std::to_string(picture.height) + "\n-1.0\n";
  std::vector<unsigned char> bytes(head.begin(), head.end());
  const auto width = static_cast<std::size_t>(picture.width), height = static_cast<std::size_t>(picture.height);
  bytes.resize(head.size() + 4 * width * height);
  for (std::size_t y = 0; y < height; ++y) {
    std::memcpy(&bytes[head.size() + 4 * y * width], &picture.pixels[(height - 1 - y) * width], 4 * width);
  }
  return write_bytes(file, bytes);
}

}  // namespace spectra::mapping
