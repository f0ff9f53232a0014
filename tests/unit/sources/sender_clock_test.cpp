#include "server/sources/sender_clock.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace spectra::sources {
namespace {

using Verdict = SenderClock::Verdict;

/// A clock that has heard stamps 0 to 1, a tenth of a second apart; the steady one shows the same.
SenderClock running_clock() {
  SenderClock clock;
  for (int i = 0; i <= 10; ++i) clock.accept(0.1 * i, 0.1 * i);
  return clock;
}

TEST(SenderClock, TakesNoStampThatIsNotInSeconds) {
  for (SenderClock clock : {SenderClock(), running_clock()}) {
    for (const double absurd : {1e11, 1.7e12, -1e300, std::numeric_limits<double>::quiet_NaN()}) {
      for (int i = 0; i < 5; ++i) EXPECT_EQ(clock.look(absurd, 1), Verdict::NotInSeconds) << absurd;
    }
    EXPECT_EQ(clock.look(1.1, 1.1), Verdict::Taken);
  }
}

TEST(SenderClock, OneStampFarAheadChangesNothing) {
  SenderClock clock = running_clock();
  EXPECT_EQ(clock.look(1e9, 1), Verdict::Ahead);
  EXPECT_EQ(clock.look(1.1, 1.1), Verdict::Taken);
  EXPECT_EQ(clock.on_own_clock(1.1), 1.1);
  EXPECT_EQ(clock.newest_s(), 1);
}

TEST(SenderClock, StraysAreInARowWhenNothingElseIsBetween) {
  SenderClock clock = running_clock();
  EXPECT_EQ(clock.look(1e9, 1), Verdict::Ahead);
  EXPECT_EQ(clock.look(1e9 + 0.1, 1.1), Verdict::Ahead);
  clock.accept(1.1, 1.1);
  EXPECT_EQ(clock.look(1e9 + 0.2, 1.2), Verdict::Ahead);
  EXPECT_EQ(clock.look(1e6, 1.3), Verdict::Ahead) << "another far away place";
  EXPECT_EQ(clock.look(1e6 + 0.1, 1.4), Verdict::Ahead);
  EXPECT_EQ(clock.look(1e6 + 0.2, 1.5), Verdict::Taken) << "the clock was set";
}

TEST(SenderClock, WhoWasSilentHasStampsAsMuchLater) {
  SenderClock clock = running_clock();
  EXPECT_EQ(clock.look(61, 61), Verdict::Taken);
  EXPECT_EQ(clock.look(61, 1), Verdict::Ahead);
}

TEST(SenderClock, AClockThatIsSetBackGoesOnLater) {
  SenderClock clock;
  clock.accept(1e9, 0);
  EXPECT_EQ(clock.look(5, 0.1), Verdict::Taken) << "whoever asks compares it with those before";
  EXPECT_LT(clock.on_own_clock(5), 1e9);
  EXPECT_EQ(clock.look(5.1, 0.2), Verdict::Taken);
  EXPECT_EQ(clock.look(5.2, 0.3), Verdict::BegunAnew);
  clock.accept(5.2, 0.3);
  EXPECT_EQ(clock.on_own_clock(5.2), 1e9 + SenderClock::kNewClockGapS);
  EXPECT_NEAR(clock.on_own_clock(5.3) - clock.on_own_clock(5.2), 0.1, 1e-6);
}

TEST(SenderClock, BeforeASenderIsHeardMomentsAreThoseOfTheOneBefore) {
  SenderClock clock = running_clock();
  clock.begin_sender();
  clock.accept(0, 2);
  EXPECT_EQ(clock.on_own_clock(0), 1 + SenderClock::kNewClockGapS);
  clock.begin_sender();
  EXPECT_EQ(clock.moment_of(0), 1 + SenderClock::kNewClockGapS);
}

TEST(SenderClock, MomentsOfASenderBeforeStayWhereTheyWere) {
  SenderClock clock = running_clock();
  clock.begin_sender();
  // A link that broke: what is sent again is later on the clock of the map.
  clock.accept(0.9, 2);
  clock.accept(1.9, 3);
  EXPECT_EQ(clock.on_own_clock(0.9), 2);
  EXPECT_EQ(clock.moment_of(0.5), 0.5) << "only the one before has said such";
  EXPECT_EQ(clock.moment_of(0.95), clock.on_own_clock(0.95)) << "both have: the newer one";
  EXPECT_EQ(clock.moment_of(1.5), clock.on_own_clock(1.5));
  EXPECT_EQ(clock.moment_of(7), clock.on_own_clock(7)) << "nobody has";
  clock.begin_sender();
  // Another clock altogether.
  clock.accept(1e9, 4);
  EXPECT_EQ(clock.moment_of(0.5), 0.5);
  EXPECT_NEAR(clock.moment_of(1.5), 2.6, 1e-9);
}

TEST(SenderClock, ManySendersAreKeptAccountOfWithinBounds) {
  // The first two are of another clock than the map.
  SenderClock clock;
  clock.accept(1e6, 0);
  clock.begin_sender();
  clock.accept(-500, 0);
  const double first_shift_s = clock.moment_of(-500) + 500;
  EXPECT_GT(first_shift_s, 1e6);
  clock.begin_sender();
  for (int i = 0; i < 2000; ++i) {
    if (i == 100) {
      EXPECT_EQ(clock.moment_of(-500), first_shift_s - 500);
    }
    clock.accept(2e6 + 100.0 * i, i);
    clock.accept(2e6 + 100.0 * i + 1, i);
    clock.begin_sender();
  }
  EXPECT_EQ(clock.moment_of(-500), -500) << "it is forgotten; the last sender's counts";
  EXPECT_EQ(clock.moment_of(2'199'900.5), 2'199'900.5);
  EXPECT_EQ(clock.newest_s(), 2'199'901);
}

TEST(SenderClock, ASenderThatIsForgottenHasSaidNothing) {
  SenderClock clock = running_clock();
  clock.begin_sender();
  clock.accept(1e9, 2);
  clock.forget_sender();
  EXPECT_EQ(clock.newest_s(), 1);
  EXPECT_EQ(clock.on_own_clock(0), 1 + SenderClock::kNewClockGapS);
}

}  // namespace
}  // namespace spectra::sources
