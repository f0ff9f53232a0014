#include "server/mapping/picture_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

namespace spectra::mapping {
namespace {

namespace fs = std::filesystem;

class PictureFile : public testing::Test {
 protected:
  PictureFile() : folder_(fs::temp_directory_path() / ("spectra-pictures-" + std::to_string(::getpid()))) {
    fs::create_directory(folder_);
  }
  ~PictureFile() override { fs::remove_all(folder_); }

  void cut(const fs::path& file, double share) {
    fs::resize_file(file, static_cast<std::uintmax_t>(static_cast<double>(fs::file_size(file)) * share));
  }

  const fs::path folder_;
};

TEST_F(PictureFile, KeepsSixteenBits) {
  Picture16 picture{70, 30, {}};
  for (unsigned i = 0; i < 70 * 30; ++i) picture.pixels.push_back(static_cast<std::uint16_t>(i * 31));
  ASSERT_TRUE(write_png16(folder_ / "a.png", picture));
  const auto read = read_png16(folder_ / "a.png");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read.value().width, 70);
  EXPECT_EQ(read.value().pixels, picture.pixels);
}

TEST_F(PictureFile, KeepsColoursWithinWhatJpegLoses) {
  PictureRgb picture{64, 32, std::vector<base::Rgb8>(64 * 32, {200, 100, 50})};
  ASSERT_TRUE(write_jpeg(folder_ / "a.jpg", picture, 95));
  const auto read = read_colour(folder_ / "a.jpg");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_NEAR(read.value().at(10, 10).r, 200, 3);
  EXPECT_NEAR(read.value().at(10, 10).b, 50, 3);
}

TEST_F(PictureFile, KeepsFloats) {
  PictureFloat picture{3, 2, {1, 2, 3, 4, 5, 6.5F}};
  ASSERT_TRUE(write_pfm(folder_ / "a.pfm", picture));
  const auto read = read_pfm(folder_ / "a.pfm");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read.value().pixels, picture.pixels);
}

TEST_F(PictureFile, RefusesWhatIsCut) {
  ASSERT_TRUE(write_png16(folder_ / "a.png", {64, 64, std::vector<std::uint16_t>(64 * 64, 1234)}));
  ASSERT_TRUE(write_jpeg(folder_ / "a.jpg", {64, 64, std::vector<base::Rgb8>(64 * 64, {1, 200, 3})}, 90));
  ASSERT_TRUE(write_pfm(folder_ / "a.pfm", {64, 64, std::vector<float>(64 * 64, 1)}));
  for (const char* name : {"a.png", "a.jpg", "a.pfm"}) cut(folder_ / name, 0.6);
  const auto png = read_png16(folder_ / "a.png");
  ASSERT_FALSE(png);
  EXPECT_NE(png.error().message.find("a.png: is no whole PNG"), std::string::npos) << png.error().message;
  EXPECT_FALSE(read_colour(folder_ / "a.jpg"));
  EXPECT_FALSE(read_pfm(folder_ / "a.pfm"));
}

TEST_F(PictureFile, SurvivesDamageAnywhere) {
  Picture16 picture{40, 40, {}};
  for (unsigned i = 0; i < 1600; ++i) picture.pixels.push_back(static_cast<std::uint16_t>(i * i));
  ASSERT_TRUE(write_png16(folder_ / "a.png", picture));
  std::ifstream in(folder_ / "a.png", std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  for (std::size_t i = 0; i < whole.size(); i += 7) {
    std::string damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x55);
    std::ofstream(folder_ / "b.png", std::ios::binary) << damaged;
    const auto read = read_png16(folder_ / "b.png");
    if (read) {
      EXPECT_EQ(read.value().pixels.size(), static_cast<std::size_t>(read.value().width * read.value().height));
    }
  }
}

TEST_F(PictureFile, TellsWhatIsThereFromWhatIsNot) {
  EXPECT_EQ(read_png16(folder_ / "none.png").error().code, base::ErrorCode::FileNotFound);
  std::ofstream(folder_ / "text.png") << "no picture";
  EXPECT_EQ(read_png16(folder_ / "text.png").error().code, base::ErrorCode::FileUnreadable);
  EXPECT_EQ(read_colour(folder_ / "text.png").error().code, base::ErrorCode::FileUnreadable);
}

}  // namespace
}  // namespace spectra::mapping
