#include "server/store/time_text.hpp"

#include <gtest/gtest.h>

#include <chrono>

namespace spectra::store {
namespace {

using std::chrono::microseconds;

StoreTime at(std::int64_t microseconds_since_1970) {
  return StoreTime(microseconds(microseconds_since_1970));
}

TEST(TimeText, ReadsWhatItWrites) {
  for (const std::int64_t second :
       {std::int64_t{0}, std::int64_t{951'782'400}, std::int64_t{1'769'862'896}, std::int64_t{253'402'300'799}}) {
    EXPECT_EQ(time_of(utc_text(at(second * 1'000'000))), at(second * 1'000'000)) << utc_text(at(second * 1'000'000));
  }
}

TEST(TimeText, ReadsFractionsZonesAndUnixSeconds) {
  const StoreTime noon = time_of("2026-01-31T12:00:00Z").value();
  EXPECT_EQ(noon, at(1'769'860'800'000'000));
  EXPECT_EQ(time_of("2026-01-31 12:00:00.25Z"), noon + microseconds(250'000));
  EXPECT_EQ(time_of("2026-01-31t13:30:00+01:30"), noon);
  EXPECT_EQ(time_of("2026-01-31T07:00:00-05:00"), noon);
  EXPECT_EQ(time_of("1769860800"), noon);
  EXPECT_EQ(time_of("1769860800.5"), noon + microseconds(500'000));
}

TEST(TimeText, RefusesWhatIsNoTime) {
  for (const char* text : {"",
                           "now",
                           "2026-01-31",
                           "2026-01-31T12:00:00",
                           "2026-02-30T12:00:00Z",
                           "2026-01-31T24:00:00Z",
                           "2026-01-31T12:00Z",
                           "2026-01-31T12:00:00.Z",
                           "2026-01-31T12:00:00,5Z",
                           "2026-01-31T12:00:00+1:00",
                           "2026-01-31T12:00:00+24:00",
                           "2026-01-31T12:00:00+01:60",
                           "2026-01-31T12:00:00+0a:00",
                           "2026-01-31T12:00:00ZZ",
                           " 2026-01-31T12:00:00Z",
                           "-1",
                           "1e300",
                           "nan",
                           "inf",
                           "12 ",
                           "0x10",
                           "1969-12-31T23:59:59Z",
                           "2026-01-31T12:00:0\xc3Z"}) {
    EXPECT_FALSE(time_of(text)) << text;
  }
}

}  // namespace
}  // namespace spectra::store
