#include "server/mapping/calibration.hpp"

#include <gtest/gtest.h>

#include <string>

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
