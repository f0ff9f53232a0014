#include "server/sources/stored_baseline.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace spectra::sources {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

TEST(StoredBaseline, ComesBackBitForBit) {
  const map::BlockBaseline baseline{{20.5F, kNan, -std::numeric_limits<float>::infinity(), 20.5F},
                                    {1700000000.25, 1699999999, map::kUnknownTime, 1700000000.25}};
  const auto back = baseline_from(text_of(baseline), 4);
  ASSERT_TRUE(back);
  for (std::size_t v = 0; v < 4; ++v) {
    EXPECT_TRUE(back->celsius[v] == baseline.celsius[v] || std::isnan(baseline.celsius[v])) << v;
    EXPECT_EQ(std::isnan(back->celsius[v]), std::isnan(baseline.celsius[v])) << v;
    EXPECT_TRUE(back->at[v] == baseline.at[v] || std::isnan(baseline.at[v])) << v;
    EXPECT_EQ(std::isnan(back->at[v]), std::isnan(baseline.at[v])) << v;
  }
  const map::BlockBaseline timeless{{1, 2}, {map::kUnknownTime, map::kUnknownTime}};
  EXPECT_TRUE(std::isnan(baseline_from(text_of(timeless), 2)->at[1]));
  EXPECT_EQ(text_of(map::BlockBaseline{}), "");
  EXPECT_TRUE(baseline_from("", 7)->is_empty());
}

TEST(StoredBaseline, AnyOtherBytesAreNone) {
  const std::string good = text_of(map::BlockBaseline{{1, 2}, {10, 20}});
  EXPECT_FALSE(baseline_from(good, 3)) << "of another block";
  for (std::size_t length = 1; length < good.size(); ++length) EXPECT_FALSE(baseline_from(good.substr(0, length), 2));
  for (std::size_t at = 0; at < good.size(); ++at) {
    std::string changed = good;
    changed[at] = static_cast<char>(changed[at] ^ 0x7f);
    static_cast<void>(baseline_from(changed, 2));
  }
  std::string foreign = good;
  foreign.back() = 9;
  EXPECT_FALSE(baseline_from(foreign, 2)) << "a time that is not there";
  EXPECT_FALSE(baseline_from(std::string(4, '\xff'), 0));
}

TEST(StoredMark, ComesBackAndNothingElseDoes) {
  const auto back = mark_from(text_of(StoredMark{{3, 1700000000.125}, 41}));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->mark.number, 3U);
  EXPECT_EQ(back->mark.marked_at, 1700000000.125);
  EXPECT_EQ(back->revision, 41U);
  for (const char* text : {"", "3", "3 x 4", "0 0x1p0 4", "3 nan 4", "3 inf 4"}) EXPECT_FALSE(mark_from(text)) << text;
}

}  // namespace
}  // namespace spectra::sources
