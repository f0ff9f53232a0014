#include "server/mapping/frame_folder.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

namespace spectra::mapping {
namespace {

namespace fs = std::filesystem;

class FrameFolderTest : public testing::Test {
 protected:
  FrameFolderTest() : folder_(fs::temp_directory_path() / ("spectra-frames-" + std::to_string(::getpid()))) {
    fs::create_directory(folder_);
    write("calibration.json", R"({"depth": {"width": 16, "height": 12, "fx": 20, "fy": 20, "cx": 7.5, "cy": 5.5}})");
    write("poses.txt", "0 0 0 0 0 0 0 1\n0.05 0 0 0 0 0 0 1\n");
    write("frames.txt", "# timestamp depth color thermal\n0 a.png - -\n0.05 b.png - t.png\n");
    EXPECT_TRUE(write_png16(folder_ / "a.png", {16, 12, std::vector<std::uint16_t>(16 * 12, 1000)}));
    EXPECT_TRUE(write_png16(folder_ / "b.png", {12, 12, std::vector<std::uint16_t>(12 * 12, 1000)}));
  }
  ~FrameFolderTest() override { fs::remove_all(folder_); }

  void write(const char* name, const std::string& text) { std::ofstream(folder_ / name) << text; }

  const fs::path folder_;
};

TEST_F(FrameFolderTest, GivesWhatIsThereAndCountsWhatIsNot) {
  const auto opened = FrameFolder::open(folder_);
  ASSERT_TRUE(opened) << opened.error().message;
  const FrameFolder& frames = opened.value();
  ASSERT_EQ(frames.rows().size(), 2U);
  FaultLog faults;
  const Frame first = frames.load(0, faults);
  EXPECT_EQ(first.depth.width, 16);
  EXPECT_TRUE(first.colour.empty());
  const Frame second = frames.load(1, faults);
  EXPECT_TRUE(second.depth.empty());
  EXPECT_EQ(faults.of(FaultKind::WrongSize).count, 1U);
  EXPECT_NE(faults.of(FaultKind::WrongSize).what.find("b.png: is 12 x 12 pixels"), std::string::npos);
  EXPECT_EQ(faults.of(FaultKind::NoCalibration).count, 1U);
}

TEST_F(FrameFolderTest, NeedsPosesUnlessTheyAreFoundByTracking) {
  fs::remove(folder_ / "poses.txt");
  EXPECT_FALSE(FrameFolder::open(folder_));
  const auto opened = FrameFolder::open(folder_, std::nullopt, false);
  ASSERT_TRUE(opened) << opened.error().message;
  EXPECT_EQ(opened.value().trajectory().size(), 0U);
  EXPECT_FALSE(FrameFolder::open(folder_, folder_ / "none.txt", false));
}

TEST_F(FrameFolderTest, SaysWhichLinesAreWrong) {
  write("frames.txt",
        "0 a.png - -\nx a.png - -\n0.02 a.png\n0.01 a.png - -\n0.005 a.png - -\nnan a.png - -\n0.03 ../../etc/passwd - "
        "-\n0.04 a.p");
  const auto opened = FrameFolder::open(folder_);
  ASSERT_TRUE(opened);
  EXPECT_EQ(opened.value().rows().size(), 2U);
  EXPECT_EQ(opened.value().faults().of(FaultKind::UnreadableLine).count, 5U);
  EXPECT_NE(opened.value().faults().of(FaultKind::UnreadableLine).what.find("frames.txt line 2"), std::string::npos);
  EXPECT_EQ(opened.value().faults().of(FaultKind::BackwardClock).count, 1U);
}

TEST_F(FrameFolderTest, CountsPicturesThatEndTooSoonOrAreNotThere) {
  fs::resize_file(folder_ / "a.png", fs::file_size(folder_ / "a.png") / 2);
  fs::remove(folder_ / "b.png");
  const auto opened = FrameFolder::open(folder_);
  ASSERT_TRUE(opened);
  FaultLog faults;
  EXPECT_TRUE(opened.value().load(0, faults).depth.empty());
  EXPECT_TRUE(opened.value().load(1, faults).depth.empty());
  EXPECT_EQ(faults.of(FaultKind::DamagedFile).count, 1U);
  EXPECT_EQ(faults.of(FaultKind::MissingFile).count, 1U);
}

TEST_F(FrameFolderTest, RefusesWhatCannotBeMeant) {
  const auto problem = [&] {
    const auto opened = FrameFolder::open(folder_);
    return opened ? std::string() : opened.error().message;
  };
  EXPECT_NE(FrameFolder::open(folder_ / "nothing").error().message.find("no folder of frames"), std::string::npos);
  EXPECT_NE(FrameFolder::open(folder_, folder_ / "no.txt").error().message.find("no.txt"), std::string::npos);
  write("frames.txt", "# nothing\n");
  EXPECT_NE(problem().find("no frame"), std::string::npos);
  write("poses.txt", "nan 0 0 0 0 0 0 1\n");
  EXPECT_NE(problem().find("no pose"), std::string::npos);
  write("calibration.json", "{");
  EXPECT_NE(problem().find("calibration.json"), std::string::npos);
}

}  // namespace
}  // namespace spectra::mapping
