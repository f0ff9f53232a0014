#include "server/net/static_files.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace spectra::net {
namespace {

TEST(Liking, IsWhatTheClientSays) {
  EXPECT_EQ(liking("gzip, deflate, br", "br"), 1);
  EXPECT_EQ(liking("gzip;q=0.5 , BR ; Q=0.25", "br"), 0.25);
  EXPECT_EQ(liking("br;q=0, gzip", "br"), 0);
  EXPECT_EQ(liking("gzip", "br"), 0);
  EXPECT_EQ(liking("", "br"), 0);
}

TEST(Liking, OfAnyOtherHoldsForWhatIsNotNamed) {
  EXPECT_EQ(liking("br;q=0.2, *;q=0.7", "gzip"), 0.7);
  EXPECT_EQ(liking("*;q=0.7, br;q=0.2", "br"), 0.2);
  EXPECT_EQ(liking("*;q=0", "identity"), 0);
}

TEST(Liking, LeavesTheFileAsItIsAsALastResort) {
  EXPECT_GT(liking("", "identity"), 0);
  EXPECT_LT(liking("br;q=0.001", "identity"), 0.001);
  EXPECT_EQ(liking("identity;q=0", "identity"), 0);
}

TEST(Liking, OfAWeightThatIsNoneIsNothing) {
  for (const auto* weight : {"", "x", "-1", "2", "nan", "1e", "0.5x"}) {
    EXPECT_EQ(liking(std::string("br;q=") + weight, "br"), 0) << weight;
  }
}

TEST(Etag, IsFoundInAListAndWeak) {
  EXPECT_TRUE(names_etag("\"a\"", "\"a\""));
  EXPECT_TRUE(names_etag("\"b\", W/\"a\"", "\"a\""));
  EXPECT_TRUE(names_etag("*", "\"a\""));
  EXPECT_FALSE(names_etag("", "\"a\""));
  EXPECT_FALSE(names_etag("\"ab\"", "\"a\""));
}

class StaticFilesInCodings : public testing::Test {
 protected:
  StaticFilesInCodings() {
    std::filesystem::create_directories(folder_ / "assets");
    write("index.html", "page");
    write("index.html.br", "old");
    write("assets/app.js", "as it is");
    write("assets/app.js.br", "br");
    write("assets/app.js.gz", "gzip");
    write("assets/alone.gz", "a file");
  }
  ~StaticFilesInCodings() override { std::filesystem::remove_all(folder_); }

  void write(const std::string& name, const std::string& content) const { std::ofstream(folder_ / name) << content; }
  /// What is given to one who accepts this; empty: nothing.
  std::string given(const std::string& accept_encoding, const std::string& name = "/assets/app.js") {
    const auto file = files_.find(name);
    const auto* version = file ? file->version_for(accept_encoding) : nullptr;
    return version ? version->content : std::string();
  }

  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("spectra_coded_" + std::to_string(::getpid()));
  StaticFiles files_{folder_};
};

TEST_F(StaticFilesInCodings, AreChosenByWhatIsAccepted) {
  EXPECT_EQ(given("gzip, deflate, br"), "br");
  EXPECT_EQ(given("gzip, deflate"), "gzip");
  EXPECT_EQ(given("br;q=0.5, gzip"), "gzip");
  EXPECT_EQ(given("br;q=0, *"), "gzip");
  EXPECT_EQ(given(""), "as it is");
  EXPECT_EQ(given("zstd"), "as it is");
  EXPECT_EQ(given("identity, br;q=0.5"), "as it is");
  EXPECT_EQ(given("identity;q=0"), "");
  EXPECT_EQ(given("*;q=0, gzip;q=0.1"), "gzip");
}

TEST_F(StaticFilesInCodings, HaveTagsOfTheirOwn) {
  const auto file = files_.find("/assets/app.js");
  ASSERT_EQ(file->versions.size(), 3U);
  EXPECT_NE(file->versions[0].etag, file->versions[1].etag);
  EXPECT_NE(file->versions[1].etag, file->versions[2].etag);
}

TEST_F(StaticFilesInCodings, AreNoFilesOfTheirOwn) {
  EXPECT_EQ(files_.find("/assets/app.js.br"), nullptr);
  EXPECT_EQ(given("", "/assets/alone.gz"), "a file");
}

TEST_F(StaticFilesInCodings, AreNotTrustedWhereTheNameStaysWhenTheContentChanges) {
  EXPECT_EQ(given("br", "/index.html"), "page");
}

}  // namespace
}  // namespace spectra::net
