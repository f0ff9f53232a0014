#include "server/net/limit_table.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <set>
#include <sstream>

namespace spectra::net {
namespace {

TEST(LimitTable, SetsCountsBytesAndTimes) {
  NetLimits limits;
  for (const char* text : {"connections=7", "block-bytes=1.5MB", "header-bytes=4096", "header-seconds=0.25",
                           "requests-per-second=12.5", "download-bytes-per-second=2kB", "senders=0"}) {
    EXPECT_EQ(set_limit(limits, text), std::nullopt) << text;
  }
  EXPECT_EQ(limits.max_connections, 7U);
  EXPECT_EQ(limits.block_size_bytes, 1'500'000U);
  EXPECT_EQ(limits.header_size_bytes, 4096U);
  EXPECT_EQ(limits.header_timeout, std::chrono::milliseconds(250));
  EXPECT_EQ(limits.requests_per_s, 12.5);
  EXPECT_EQ(limits.download_bytes_per_s, 2000);
  EXPECT_EQ(limits.ingest_sessions, 0U);
}

TEST(LimitTable, RefusesWhatIsNoneAndChangesNothing) {
  NetLimits limits;
  const auto before = limit_lines(limits);
  const auto problem = [&limits](const char* text) { return set_limit(limits, text).value_or("taken"); };
  EXPECT_THAT(problem("connection=7"), testing::HasSubstr("there is no such limit; there are connections, "));
  EXPECT_EQ(problem("connections"), "connections: connections=VALUE is wanted, from 1 to 1e+06");
  EXPECT_EQ(problem("header-seconds=0"), "header-seconds=0: header-seconds=VALUE is wanted, from 0.1 s to 3600 s");
  for (const char* text :
       {"", "=", "connections=", "connections=0", "connections=1.5", "connections=2kB", "connections=-1",
        "connections=nan", "connections=1e9", "block-bytes=12mb", "block-bytes=1 MB", "header-seconds=1s"}) {
    EXPECT_NE(problem(text), "taken") << text;
  }
  const auto after = limit_lines(limits);
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_EQ(before[i].value, after[i].value) << before[i].name;
}

TEST(LimitTable, StandsInTheDocumentAsItIs) {
  std::ifstream file(SPECTRA_DOCS_DIR "/limits.md");
  std::stringstream text;
  text << file.rdbuf();
  for (const LimitLine& line : limit_lines({})) {
    EXPECT_THAT(text.str(), testing::HasSubstr("| `" + line.name + "` | " + line.value + " | " + line.help + " |\n"));
  }
}

}  // namespace
}  // namespace spectra::net
