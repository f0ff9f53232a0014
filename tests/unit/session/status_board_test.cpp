#include "server/session/status_board.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace spectra::session {
namespace {

using protocol::StatusLevel;

class StatusBoardTest : public testing::Test {
 protected:
  /// What was told since the last call.
  std::vector<protocol::Status> told() { return std::exchange(told_, {}); }

  std::vector<protocol::Status> told_;
  StatusBoard board_{[this](const protocol::Status& status) { told_.push_back(status); }};
};

TEST_F(StatusBoardTest, TellsOnceWhatStaysAsItIs) {
  board_.set("loading", StatusLevel::Info, "reading");
  board_.set("loading", StatusLevel::Info, "reading");
  ASSERT_EQ(told().size(), 1U);
  board_.set("loading", StatusLevel::Info, "cutting");
  const auto now = told();
  ASSERT_EQ(now.size(), 1U);
  EXPECT_EQ(now[0].message, "cutting");
}

TEST_F(StatusBoardTest, TakesBackOnlyWhatWasTold) {
  board_.set("failed", StatusLevel::Error, std::nullopt);
  EXPECT_TRUE(told().empty());
  board_.set("failed", StatusLevel::Error, "a tile");
  told();
  board_.set("failed", StatusLevel::Error, std::nullopt);
  const auto back = told();
  ASSERT_EQ(back.size(), 1U);
  EXPECT_EQ(back[0].id, "failed");
  EXPECT_EQ(back[0].message, std::nullopt);
  board_.set("failed", StatusLevel::Error, "a tile");
  EXPECT_EQ(told().size(), 1U);
}

TEST_F(StatusBoardTest, NotesOfTheSceneBeforeAreTakenBackAndOthersStay) {
  const files::Note strays{.id = "stray_points", .count = 3, .message = "three", .needs_attention = true};
  const files::Note up{.id = "up_found", .count = 1, .message = "y is up"};
  board_.set("loading", StatusLevel::Info, "reading");
  board_.set_notes(std::vector{strays, up});
  const auto first = told();
  ASSERT_EQ(first.size(), 3U);
  EXPECT_EQ(first[1].id, "scene.stray_points");
  EXPECT_EQ(first[1].level, StatusLevel::Warning);
  EXPECT_EQ(first[2].level, StatusLevel::Info);

  board_.set_notes(std::vector{up});
  const auto second = told();
  ASSERT_EQ(second.size(), 1U);
  EXPECT_EQ(second[0].id, "scene.stray_points");
  EXPECT_EQ(second[0].message, std::nullopt);
}

}  // namespace
}  // namespace spectra::session
