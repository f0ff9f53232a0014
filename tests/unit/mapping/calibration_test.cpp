#include "server/mapping/calibration.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace spectra::mapping {
namespace {

const std::string kDepth =
    R"("depth": {"width": 640, "height": 360, "fx": 561, "fy": 569.5, "cx": 319.5, "cy": 179.5})";
const std::string kUnit = R"([[1,0,0,0.1],[0,1,0,0],[0,0,1,0],[0,0,0,1]])";

std::string problem_of(const std::string& text) {
  const auto read = calibration_from_text(text, "calibration.json");
  return read ? "" : read.error().message;
}

TEST(Calibration, ReadsCamerasAndWhereTheyAre) {
  const auto read = calibration_from_text(
      "{" + kDepth + R"(, "thermal": {"width": 64, "height": 48, "fx": 80, "fy": 80, "cx": 31.5, "cy": 23.5,
        "distortion": [0.05, 0, 0, 0], "unit": "centikelvin", "emissivity": 0.95, "delay_s": -0.02, "from_depth": )" +
          kUnit + R"(}, "poses": {"of": "depth", "sense": "camera_to_world"}})",
      "calibration.json");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read.value().depth.camera.width, 640);
  EXPECT_FALSE(read.value().colour);
  ASSERT_TRUE(read.value().thermal);
  EXPECT_EQ(read.value().thermal->emissivity, 0.95);
  EXPECT_EQ(read.value().thermal->delay_s, -0.02);
  EXPECT_EQ(read.value().thermal->from_depth.translation().x(), 0.1);
}

TEST(Calibration, NamesWhatDoesNotFit) {
  EXPECT_NE(problem_of("[1]").find("no JSON object"), std::string::npos);
  EXPECT_NE(problem_of("{}").find("depth is missing"), std::string::npos);
  EXPECT_NE(problem_of(R"({"depth": {"width": 640}})").find("depth.height is missing"), std::string::npos);
  const std::string camera = R"("width": 64, "height": 48, "fx": 80, "fy": 80, "cx": 31.5, "cy": 23.5)";
  EXPECT_NE(problem_of("{" + kDepth + R"(, "color": {)" + camera + "}}").find("color.from_depth is missing"),
            std::string::npos);
  EXPECT_NE(problem_of("{" + kDepth + R"(, "color": {)" + camera +
                       R"(, "from_depth": [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}})")
                .find("no rotation"),
            std::string::npos);
  EXPECT_NE(problem_of("{" + kDepth + R"(, "poses": {"of": "robot"}})").find("poses.of"), std::string::npos);
  EXPECT_NE(problem_of(R"({"depth": {"width": 640, "height": 1e9, "fx": 561, "fy": 569, "cx": 1, "cy": 1}})")
                .find("depth.height"),
            std::string::npos);
}

TEST(Calibration, ReadsTheVignettingPictureThatItNames) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::temp_directory_path() / ("spectra-calibration-" + std::to_string(::getpid()));
  fs::create_directory(folder);
  const std::string thermal = R"(, "thermal": {"width": 8, "height": 9, "fx": 80, "fy": 80, "cx": 3.5, "cy": 4,
      "from_depth": )" + kUnit +
                              R"(, "vignetting": )";
  std::ofstream(folder / "calibration.json") << "{" + kDepth + thermal + "\"v.pfm\"}}";
  EXPECT_FALSE(read_calibration(folder / "calibration.json"));
  ASSERT_TRUE(write_pfm(folder / "v.pfm", {8, 9, std::vector<float>(72, 0.5F)}));
  const auto read = read_calibration(folder / "calibration.json");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read.value().thermal->vignetting.pixels, std::vector<float>(72, 0.5F));
  ASSERT_TRUE(write_pfm(folder / "v.pfm", {9, 8, std::vector<float>(72, 0.5F)}));
  const auto wrong = read_calibration(folder / "calibration.json");
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.error().message.find("not of the size"), std::string::npos);
  fs::remove_all(folder);
  EXPECT_NE(problem_of("{" + kDepth + thermal + "\"../v.pfm\"}}").find("thermal.vignetting"), std::string::npos);
  EXPECT_NE(problem_of("{" + kDepth + thermal + "3}}").find("thermal.vignetting"), std::string::npos);
}

TEST(CameraModel, UndoesItsOwnDistortion) {
  CameraModel camera;
  camera.width = 640;
  camera.height = 512;
  camera.fx = camera.fy = 743;
  camera.cx = 319.5;
  camera.cy = 255.5;
  camera.distortion = {0.0478, -0.01, 0.001, -0.002};
  for (const auto& [u, v] : {std::pair{0.0, 0.0}, {639.0, 511.0}, {100.25, 400.5}}) {
    const Eigen::Vector2d back = camera.pixel_of(3 * camera.ray_of(u, v));
    EXPECT_NEAR(back.x(), u, 1e-5);
    EXPECT_NEAR(back.y(), v, 1e-5);
  }
}

}  // namespace
}  // namespace spectra::mapping
