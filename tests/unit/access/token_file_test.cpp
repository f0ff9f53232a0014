#include "server/access/token_file.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

namespace spectra::access {
namespace {

namespace fs = std::filesystem;

class TokenFile : public testing::Test {
 protected:
  TokenFile() : folder_(fs::temp_directory_path() / ("spectra-tokens-" + random_text(12))) {
    fs::create_directory(folder_);
  }
  ~TokenFile() override { fs::remove_all(folder_); }

  fs::path write(const std::string& text, mode_t mode = 0600) {
    const fs::path file = folder_ / "tokens";
    std::ofstream(file) << text;
    chmod(file.c_str(), mode);
    return file;
  }
  std::string problem_of(const std::string& text, mode_t mode = 0600) {
    const auto read = read_tokens(write(text, mode));
    return std::holds_alternative<std::string>(read) ? std::get<std::string>(read) : "";
  }

  const fs::path folder_;
  const std::string secret_ = "secret 0123456789abcdef0123456789abcdef\n";
  const std::string row_ = "operator bridge " + to_hex(digest_of("a token")) + '\n';
};

TEST_F(TokenFile, ReadsWhatItWrites) {
  TokenList list;
  list.tokens = {{"bridge", AccessRole::Operator, digest_of("one")}, {"mapper", AccessRole::Ingest, digest_of("two")}};
  const fs::path file = folder_ / "new";
  ASSERT_EQ(write_tokens(file, list), std::nullopt);
  struct stat facts {};
  ASSERT_EQ(stat(file.c_str(), &facts), 0);
  EXPECT_EQ(facts.st_mode & 0777U, 0600U);
  const auto first = std::get<TokenList>(read_tokens(file));
  EXPECT_GE(first.secret.size(), 32U);
  ASSERT_EQ(first.tokens.size(), 2U);
  EXPECT_EQ(first.tokens[1].name, "mapper");
  EXPECT_EQ(first.tokens[1].role, AccessRole::Ingest);
  EXPECT_EQ(first.tokens[1].digest, digest_of("two"));
  ASSERT_EQ(write_tokens(file, first), std::nullopt);
  EXPECT_EQ(std::get<TokenList>(read_tokens(file)).secret, first.secret) << "cookies stay good";
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1) << "nothing is left beside it";
}

TEST_F(TokenFile, SaysWhereItIsWrong) {
  EXPECT_EQ(problem_of("# of the robot\n\n" + secret_ + row_), "");
  EXPECT_NE(problem_of(secret_ + "pilot bridge " + to_hex(digest_of("x"))).find("line 2: \"pilot\" is no role"),
            std::string::npos);
  EXPECT_NE(problem_of(secret_ + "operator bri.dge " + to_hex(digest_of("x"))).find("line 2: a name"),
            std::string::npos);
  EXPECT_NE(problem_of(secret_ + "operator bridge 12ab").find("line 2: a digest"), std::string::npos);
  EXPECT_NE(problem_of(secret_ + "operator bridge " + to_hex(digest_of("x")) + " more").find("line 2"),
            std::string::npos);
  EXPECT_NE(problem_of(secret_ + row_ + row_).find("line 3: the name bridge is there twice"), std::string::npos);
  EXPECT_NE(problem_of(secret_ + secret_ + row_).find("line 2: there are two secrets"), std::string::npos);
  EXPECT_NE(problem_of("secret short\n" + row_).find("shorter than 32"), std::string::npos);
  EXPECT_NE(problem_of(row_).find("the line with the secret is missing"), std::string::npos);
  EXPECT_NE(problem_of(secret_).find("there is no token"), std::string::npos);
  EXPECT_NE(problem_of("").find("there is no token"), std::string::npos);
  EXPECT_NE(problem_of(secret_ + row_, 0644).find("chmod 600"), std::string::npos);
  EXPECT_EQ(problem_of(secret_ + row_, 0640), "") << "a service reads it by its group";
  EXPECT_NE(std::get<std::string>(read_tokens(folder_ / "nowhere")).find("No such file"), std::string::npos);
  EXPECT_NE(std::get<std::string>(read_tokens(folder_)).find("no file of tokens"), std::string::npos);
  EXPECT_NE(write_tokens(folder_ / "no" / "where", {}).value_or("").find("cannot be written"), std::string::npos);
}

TEST(TokensOfText, AreRolesAndTokens) {
  const std::string token(24, 'x');
  const auto list =
      std::get<TokenList>(tokens_of_text("operator=" + token + ", viewer=y" + token + "\nviewer=z" + token));
  ASSERT_EQ(list.tokens.size(), 3U);
  EXPECT_EQ(list.tokens[0].digest, digest_of(token));
  EXPECT_EQ(list.tokens[1].name, "viewer");
  EXPECT_EQ(list.tokens[2].name, "viewer-2");
  EXPECT_GE(list.secret.size(), 32U);
  EXPECT_EQ(std::get<TokenList>(tokens_of_text("operator=" + token)).secret.find(token), std::string::npos);
  for (const std::string& wrong : {std::string(), std::string(" ,"), token, "pilot=" + token,
                                   "operator=" + token.substr(1), std::string("operator=")}) {
    const auto outcome = tokens_of_text(wrong);
    ASSERT_TRUE(std::holds_alternative<std::string>(outcome)) << wrong;
    EXPECT_EQ(std::get<std::string>(outcome).find("xxxx"), std::string::npos) << "a token is never said";
  }
}

TEST(NewToken, SaysItsRoleAndIsNeverTheSame) {
  EXPECT_TRUE(new_token(AccessRole::Ingest).starts_with("spectra_ingest_"));
  EXPECT_NE(new_token(AccessRole::Viewer), new_token(AccessRole::Viewer));
}

}  // namespace
}  // namespace spectra::access
