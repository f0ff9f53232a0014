#include "server/net/message_room.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <new>
#include <optional>

namespace spectra::net {
namespace {

/// A viewer, who counts how often it is told to give way.
struct Viewer {
  explicit Viewer(const std::shared_ptr<MessageRoom>& room) : share(std::in_place, room, [this] { ++told_count; }) {}
  std::optional<MessageRoom::Share> share;
  int told_count = 0;
};

class MessageRoomTest : public testing::Test {
 protected:
  std::shared_ptr<MessageRoom> room_ = std::make_shared<MessageRoom>(1000);
  Viewer a_{room_}, b_{room_}, c_{room_};
};

TEST_F(MessageRoomTest, CountsWhatWaitsAndWhatIsBeingMade) {
  a_.share->add(300);
  auto taken = b_.share->take(200);
  ASSERT_TRUE(taken);
  EXPECT_EQ(room_->used_bytes(), 500U);
  a_.share->remove(300);
  EXPECT_EQ(room_->used_bytes(), 200U);
  taken.reset();
  EXPECT_EQ(room_->used_bytes(), 0U);
}

TEST_F(MessageRoomTest, IsGivenBackWithTheViewerAndWithAnswersThatAreMadeForNobody) {
  a_.share->add(300);
  auto taken = a_.share->take(200);
  a_.share.reset();
  EXPECT_EQ(room_->used_bytes(), 200U) << "it is still being made";
  taken.reset();
  EXPECT_EQ(room_->used_bytes(), 0U);
}

TEST_F(MessageRoomTest, WhoHoldsMostGivesWayToWhoHoldsLess) {
  a_.share->add(600);
  b_.share->add(200);
  const auto taken = c_.share->take(300);
  EXPECT_TRUE(taken);
  EXPECT_EQ(a_.told_count, 1);
  EXPECT_EQ(b_.told_count, 0);
  EXPECT_TRUE(a_.share->has_given_way());
  EXPECT_FALSE(b_.share->has_given_way());
  EXPECT_EQ(room_->used_bytes(), 500U);
  a_.share->remove(600);
  EXPECT_EQ(room_->used_bytes(), 500U) << "it counted no longer";
  EXPECT_FALSE(a_.share->take(1));
}

TEST_F(MessageRoomTest, WhoHoldsMostHimselfIsRefused) {
  a_.share->add(600);
  b_.share->add(200);
  EXPECT_FALSE(a_.share->take(300));
  EXPECT_EQ(a_.told_count + b_.told_count, 0);
  EXPECT_EQ(room_->used_bytes(), 800U);
  EXPECT_TRUE(a_.share->take(200)) << "as long as there is room";
}

TEST_F(MessageRoomTest, AnswersThatAreOnlyBeingMadeGiveNoWay) {
  const auto taken = a_.share->take(900);
  ASSERT_TRUE(taken);
  c_.share->add(10);
  EXPECT_FALSE(b_.share->take(200)) << "their viewer is not slow";
  EXPECT_EQ(c_.told_count, 0) << "nothing would be won";
  c_.share->add(300);
  EXPECT_EQ(a_.told_count + b_.told_count + c_.told_count, 0) << "a message does not pay for answers";
  b_.share->add(300);
  EXPECT_EQ(b_.told_count + c_.told_count, 2) << "beyond a half, too much waits";
}

TEST_F(MessageRoomTest, OfThoseWhoHoldMuchTheOneThatIsStuckForLongestGivesWay) {
  a_.share->add(200);
  a_.share->add(190);
  b_.share->add(400);
  c_.share->add(10);
  a_.share->remove(200);
  a_.share->add(210);
  Viewer other(room_);
  EXPECT_TRUE(other.share->take(200));
  EXPECT_EQ(b_.told_count, 1) << "the other one has taken something meanwhile";
  EXPECT_EQ(a_.told_count + c_.told_count, 0);
}

TEST_F(MessageRoomTest, WhoHoldsLittleDoesNotPayForThoseWhoHoldMuch) {
  c_.share->add(10);
  a_.share->add(500);
  b_.share->add(480);
  Viewer other(room_);
  EXPECT_TRUE(other.share->take(100));
  EXPECT_EQ(c_.told_count, 0) << "though it has waited for longest";
  EXPECT_EQ(a_.told_count, 1);
}

TEST_F(MessageRoomTest, ForWhatCannotBeRefusedTheLargestGivesWayWhoeverItIs) {
  a_.share->add(100);
  b_.share->add(800);
  a_.share->add(150);
  EXPECT_EQ(b_.told_count, 1);
  EXPECT_EQ(room_->used_bytes(), 250U);
  a_.share->add(2000);
  EXPECT_EQ(a_.told_count, 1) << "itself";
  EXPECT_EQ(room_->used_bytes(), 0U);
}

TEST_F(MessageRoomTest, WhoCannotBeToldSeesItByHimself) {
  MessageRoom::Share deaf(room_, [] { throw std::bad_alloc(); });
  deaf.add(900);
  EXPECT_TRUE(a_.share->take(200));
  EXPECT_TRUE(deaf.has_given_way());
}

}  // namespace
}  // namespace spectra::net
