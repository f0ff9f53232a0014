#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "server/app/commands.hpp"
#include "tests/unit/store/store_fixture.hpp"

namespace spectra::app {
namespace {

struct Outcome {
  int status = 0;
  std::string out, err;
};

Outcome run(std::vector<std::string> words) {
  words.insert(words.begin(), "spectra");
  std::vector<const char*> arguments;
  for (const auto& word : words) arguments.push_back(word.c_str());
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome outcome;
  outcome.status = run_program(static_cast<int>(arguments.size()), arguments.data());
  outcome.out = testing::internal::GetCapturedStdout();
  outcome.err = testing::internal::GetCapturedStderr();
  return outcome;
}

void damage(const std::string& file, const std::string& place) {
  std::ifstream stream(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  const auto at = bytes.find(place);
  ASSERT_NE(at, std::string::npos);
  bytes[at] = static_cast<char>(bytes[at] ^ 1);
  std::ofstream(file, std::ios::binary) << bytes;
}

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(StoreCommand, ChecksAndSalvages) {
  const store::StoreFixture here(std::filesystem::temp_directory_path());
  const std::string rescued = (here.folder() / "rescued").string();
  const std::string bytes = store::made_bytes(7, 100'000);
  {
    const auto opened = store::opened(here.file());
    ASSERT_TRUE(put(*opened, store::made_block("wall", 7, bytes.size())));
    ASSERT_TRUE(put(*opened, store::made_block("floor", 8, 100)));
    const auto while_open = run({"store", "check", here.file()});
    EXPECT_EQ(while_open.status, kJobFailed);
    EXPECT_TRUE(has(while_open.err, "in use by another process; stop that one first")) << while_open.err;
  }
  const auto healthy = run({"store", "check", here.file()});
  EXPECT_EQ(healthy.status, kDone) << healthy.err;
  EXPECT_TRUE(has(healthy.out, "2 blocks, 100100 bytes, revision 2; everything is as it was put")) << healthy.out;

  damage(here.file(), bytes.substr(50'000, 100));
  const auto checked = run({"store", "check", here.file()});
  EXPECT_EQ(checked.status, kJobFailed);
  EXPECT_TRUE(has(checked.err, "block wall of revision 1 is not what was put")) << checked.err;
  EXPECT_TRUE(has(checked.err, "spectra store salvage " + here.file() + " NEW")) << checked.err;

  const auto salvaged = run({"store", "salvage", here.file(), rescued});
  EXPECT_EQ(salvaged.status, kJobFailed) << salvaged.err;
  EXPECT_TRUE(has(salvaged.err, "lost: the bytes of block wall of revision 1")) << salvaged.err;
  EXPECT_TRUE(has(salvaged.out, "1 block, 0 earlier revisions, 0 constants rescued")) << salvaged.out;
  EXPECT_EQ(run({"store", "check", rescued}).status, kDone);
  EXPECT_EQ(run({"store", "salvage", here.file(), rescued}).status, kWrongUsage) << "nothing is overwritten";
}

TEST(StoreCommand, LeavesNothingBehindWhenThereIsNothingToSalvage) {
  const store::StoreFixture here(std::filesystem::temp_directory_path());
  std::ofstream(here.file()) << "no store at all";
  const auto checked = run({"store", "check", here.file()});
  EXPECT_EQ(checked.status, kJobFailed);
  EXPECT_TRUE(has(checked.err, "is not a Spectra store")) << checked.err;
  const auto salvaged = run({"store", "salvage", here.file(), (here.folder() / "rescued").string()});
  EXPECT_EQ(salvaged.status, kJobFailed);
  EXPECT_TRUE(has(salvaged.err, "nothing of a Spectra store")) << salvaged.err;
  const auto missing = run({"store", "check", (here.folder() / "missing").string()});
  EXPECT_EQ(missing.status, kJobFailed);
  EXPECT_TRUE(has(missing.err, "there is no store")) << missing.err;
  EXPECT_EQ(run({"store"}).status, kWrongUsage);
  const std::filesystem::directory_iterator left(here.folder());
  EXPECT_EQ(std::distance(begin(left), end(left)), 1);
}

}  // namespace
}  // namespace spectra::app
