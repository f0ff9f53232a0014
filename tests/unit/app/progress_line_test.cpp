#include "server/app/progress_line.hpp"

#include <gtest/gtest.h>

namespace spectra::app {
namespace {

TEST(RemainingTime, IsToldByTheShareThatIsDone) {
  RemainingTime time;
  EXPECT_FALSE(time.at(1));
  time.set(0, 2);
  EXPECT_FALSE(time.at(2)) << "nothing is done yet";
  time.set(0.25, 10);
  EXPECT_DOUBLE_EQ(time.at(10).value(), 30);
}

TEST(RemainingTime, RunsDownWhileNothingIsReported) {
  RemainingTime time;
  time.set(0.5, 10);
  time.set(0.5, 14);
  EXPECT_DOUBLE_EQ(time.at(14).value(), 6);
  EXPECT_FALSE(time.at(21)) << "it was wrong, so nothing is told rather than that it is about over";
  time.set(0.75, 24);
  EXPECT_DOUBLE_EQ(time.at(24).value(), 8);
}

TEST(RemainingTime, IsNotGuessedFromTheFirstMoment) {
  RemainingTime time;
  time.set(0.02, 0.001);
  EXPECT_FALSE(time.at(0.1));
  time.set(0.02, 1);
  EXPECT_DOUBLE_EQ(time.at(1).value(), 49);
}

TEST(RemainingTime, KnowsWhatShareWillBeDone) {
  RemainingTime time;
  EXPECT_EQ(time.share_at(1), 0);
  time.set(0.25, 10);
  EXPECT_DOUBLE_EQ(time.share_at(10), 0.25);
  EXPECT_DOUBLE_EQ(time.share_at(30), 0.75);
}

TEST(ProgressText, TellsWhatHowFarAndHowLong) {
  EXPECT_EQ(progress_text("reading castle.ply", 0.424, std::nullopt, 79), "reading castle.ply  42 %");
  EXPECT_EQ(progress_text("fusing", 0, 0.2, 79), "fusing  0 %, about 1 s left");
  EXPECT_EQ(progress_text("fusing", 0.5, 130, 79), "fusing  50 %, about 2 min 10 s left");
  EXPECT_EQ(progress_text("fusing", 0.5, 1'790, 79), "fusing  50 %, about 30 min left");
  EXPECT_EQ(progress_text("fusing", 2, 1e30, 79), "fusing  100 %, about 278 h left");
}

TEST(ProgressText, FitsTheTerminal) {
  EXPECT_EQ(progress_text("reading a_very_long_name.ply", 0.07, 3, 40), "reading a_very_long  7 %, about 3 s left");
  EXPECT_EQ(progress_text("reading a_very_long_name.ply", 0.07, 3, 39), "reading a_very_lon  7 %, about 3 s left");
  EXPECT_EQ(progress_text("reading", 0.07, 3, 5), "  7 %");
  EXPECT_EQ(progress_text("reading", 0.07, 3, 0), "");
  EXPECT_EQ(progress_text("r\xc3\xa4ume", 0.07, std::nullopt, 8), "r\xc3\xa4u  7 %");
}

TEST(ProgressText, LeavesNothingInAFilesNameThatATerminalWouldObey) {
  EXPECT_EQ(progress_text("reading \x1b[2Jx\ny", 0.07, std::nullopt, 79), "reading ?[2Jx?y  7 %");
}

}  // namespace
}  // namespace spectra::app
