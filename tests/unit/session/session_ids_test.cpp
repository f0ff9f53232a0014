#include "server/session/session_ids.hpp"

#include <gtest/gtest.h>

#include <set>

namespace spectra::session {
namespace {

TEST(SessionIds, AreKnownAgainByTheirOwnRunOnly) {
  const SessionIds run;
  const SessionIds other_run;
  std::set<std::string> seen;
  for (int i = 0; i < 100; ++i) {
    const std::string id = run.next();
    EXPECT_EQ(id.size(), 32U);
    EXPECT_TRUE(seen.insert(id).second);
    EXPECT_TRUE(run.is_of_this_run(id));
    EXPECT_FALSE(other_run.is_of_this_run(id));
  }
}

TEST(SessionIds, RefuseWhatIsNoId) {
  const SessionIds run;
  const std::string id = run.next();
  for (const std::string& text : {std::string(), std::string("0"), id.substr(0, 16), id + "0", std::string(32, '0')})
    EXPECT_FALSE(run.is_of_this_run(text)) << text;
}

}  // namespace
}  // namespace spectra::session
