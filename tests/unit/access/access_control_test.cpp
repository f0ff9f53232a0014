#include "server/access/access_control.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <set>
#include <string>

namespace spectra::access {
namespace {

using Refusal = AccessControl::Refusal;

const std::string kOperator = "operator-token-0123456789";
const std::string kViewer = "viewer-token-0123456789ab";
const std::string kAdmin = "admin-token-0123456789abc";

class AccessControlTest : public testing::Test {
 protected:
  static TokenList list() {
    return {{{"bridge", AccessRole::Operator, digest_of(kOperator)},
             {"doctor", AccessRole::Viewer, digest_of(kViewer)},
             {"chief", AccessRole::Admin, digest_of(kAdmin)}},
            "a secret of at least thirty-two letters"};
  }
  static TokenList without(const std::string& name) {
    TokenList rest = list();
    std::erase_if(rest.tokens, [&name](const AccessToken& token) { return token.name == name; });
    return rest;
  }

  AccessControl::Outcome by_header(const std::string& value) {
    return access_.identify(value, "", "10.0.0.1", true, ++clock_s_ * 100);
  }
  AccessControl::Outcome by_cookie(const std::string& value) {
    return access_.identify("", value, "10.0.0.1", true, ++clock_s_ * 100);
  }
  /// The pair of a cookie as a browser sends it; empty when nobody was let in.
  std::string cookie_of(const std::string& text) {
    const auto login = access_.login(text, "10.0.0.1", false, ++clock_s_ * 100);
    return login.set_cookie.substr(0, login.set_cookie.find(';'));
  }

  std::chrono::sys_seconds now_{std::chrono::seconds(1'700'000'000)};
  double clock_s_ = 0;
  AccessControl access_{list(), "spectra_8080", [this] { return now_; }};
};

TEST(AccessRoles, AreTheMatrixOfTheManual) {
  const auto rights = [](AccessRole role) {
    std::string all;
    for (const Right right :
         {Right::Nothing, Right::Watch, Right::Operate, Right::ReadBlocks, Right::ChangeMap, Right::Administer}) {
      all += may(role, right) ? '1' : '0';
    }
    return all;
  };
  EXPECT_EQ(rights(AccessRole::Viewer), "110000");
  EXPECT_EQ(rights(AccessRole::Operator), "111100");
  EXPECT_EQ(rights(AccessRole::Ingest), "100110");
  EXPECT_EQ(rights(AccessRole::Admin), "111111");
  for (const AccessRole role : kRoles) EXPECT_EQ(access_role(to_string(role)), role);
  EXPECT_FALSE(access_role("Operator"));
}

TEST(AccessWithoutTokens, OnlyThisMachineChangesTheMap) {
  AccessControl access;
  EXPECT_FALSE(access.needs_token());
  EXPECT_EQ(access.identify("", "", "127.0.0.1", true, 0).identity->role, AccessRole::Admin);
  EXPECT_EQ(access.identify("", "", "10.0.0.1", false, 0).identity->role, AccessRole::Operator);
  EXPECT_FALSE(access.login("anything", "10.0.0.1", false, 0).outcome.identity);
  EXPECT_FALSE(access.make_code({AccessRole::Admin, "", false}, AccessRole::Viewer));
}

TEST_F(AccessControlTest, KnowsTokensInTheHeader) {
  const auto known = by_header("Bearer " + kOperator);
  ASSERT_TRUE(known.identity);
  EXPECT_EQ(known.identity->role, AccessRole::Operator);
  EXPECT_EQ(known.identity->name, "bridge");
  EXPECT_FALSE(known.identity->is_by_cookie);
  EXPECT_TRUE(by_header("bearer " + kViewer).identity);
  for (const std::string& wrong :
       {"Bearer " + kOperator + "x", "Bearer " + kOperator.substr(1), std::string("Bearer "), std::string("Bearer"),
        "Basic " + kOperator, kOperator, "Bearer " + std::string(100'000, 'x')}) {
    const auto outcome = by_header(wrong);
    EXPECT_FALSE(outcome.identity) << wrong.substr(0, 60);
    EXPECT_EQ(outcome.refusal, Refusal::Wrong);
  }
  EXPECT_EQ(access_.identify("", "", "10.0.0.1", true, 0).refusal, Refusal::None) << "from this machine, too";
}

TEST_F(AccessControlTest, ALoginIsACookieThatScriptsCannotRead) {
  const auto login = access_.login(kOperator, "10.0.0.1", false, 0);
  ASSERT_TRUE(login.outcome.identity);
  EXPECT_NE(login.set_cookie.find("; Path=/; HttpOnly; SameSite=Strict; Max-Age=604800"), std::string::npos);
  EXPECT_EQ(login.set_cookie.find("Secure"), std::string::npos);
  EXPECT_NE(access_.login(kOperator, "10.0.0.1", true, 0).set_cookie.find("; Secure"), std::string::npos);
  EXPECT_EQ(login.set_cookie.find(kOperator), std::string::npos);
  const auto known = by_cookie("other=1; " + login.set_cookie.substr(0, login.set_cookie.find(';')) + "; more=2");
  ASSERT_TRUE(known.identity);
  EXPECT_EQ(known.identity->role, AccessRole::Operator);
  EXPECT_TRUE(known.identity->is_by_cookie);
  EXPECT_NE(access_.forgetting_cookie().find("Max-Age=0"), std::string::npos);
}

TEST_F(AccessControlTest, ACookieThatWasChangedAnywhereIsNone) {
  const std::string cookie = cookie_of(kViewer);
  ASSERT_TRUE(by_cookie(cookie).identity);
  for (std::size_t i = cookie.find('=') + 1; i < cookie.size(); ++i) {
    for (const char c : {'a', '1', '.', ';'}) {
      std::string changed = cookie;
      if (changed[i] == c) continue;
      changed[i] = c;
      EXPECT_FALSE(by_cookie(changed).identity) << changed;
    }
    EXPECT_FALSE(by_cookie(cookie.substr(0, i)).identity) << cookie.substr(0, i);
  }
  const std::string value = cookie.substr(cookie.find('=') + 1);
  EXPECT_FALSE(by_cookie("spectra_8080=operator" + value.substr(value.find('.'))).identity);
  EXPECT_FALSE(by_cookie("spectra_9090=" + value).identity) << "of another server";
  EXPECT_FALSE(by_cookie(cookie + ".x").identity);
}

TEST_F(AccessControlTest, ACookieEndsWithItsTimeAndWithItsToken) {
  const std::string cookie = cookie_of(kOperator);
  now_ += AccessControl::kCookieLifetime - std::chrono::seconds(1);
  EXPECT_TRUE(by_cookie(cookie).identity);
  now_ += std::chrono::seconds(1);
  EXPECT_FALSE(by_cookie(cookie).identity);
  now_ -= std::chrono::hours(1);
  const auto identity = by_cookie(cookie).identity.value();
  EXPECT_TRUE(access_.is_good(identity));
  access_.replace(without("bridge"));
  EXPECT_FALSE(by_cookie(cookie).identity);
  EXPECT_FALSE(access_.is_good(identity));
  EXPECT_FALSE(by_header("Bearer " + kOperator).identity);
  // Another token of the same name does not revive it, nor the same with another role.
  TokenList other = without("bridge");
  other.tokens.push_back({"bridge", AccessRole::Operator, digest_of("another token of the bridge")});
  access_.replace(other);
  EXPECT_FALSE(by_cookie(cookie).identity);
  other.tokens.back() = {"bridge", AccessRole::Viewer, digest_of(kOperator)};
  access_.replace(other);
  EXPECT_FALSE(by_cookie(cookie).identity);
  // After a restart it is good.
  AccessControl again(list(), "spectra_8080", [this] { return now_; });
  EXPECT_TRUE(again.identify("", cookie, "10.0.0.2", false, 0).identity);
}

TEST_F(AccessControlTest, ACodeWorksOnceForAWhileAndForNoMoreThanItsMakerMay) {
  const AccessControl::Identity chief{AccessRole::Admin, "chief", false}, bridge{AccessRole::Operator, "bridge", false},
      doctor{AccessRole::Viewer, "doctor", false}, mapper{AccessRole::Ingest, "mapper", false};
  EXPECT_FALSE(access_.make_code(doctor, AccessRole::Viewer));
  EXPECT_FALSE(access_.make_code(mapper, AccessRole::Viewer));
  EXPECT_FALSE(access_.make_code(bridge, AccessRole::Operator));
  const std::string code = access_.make_code(chief, AccessRole::Operator).value();
  EXPECT_EQ(code.size(), 9U);
  std::string typed = code;
  for (char& c : typed) c = c == '-' ? ' ' : static_cast<char>(std::tolower(c));
  const std::string cookie = cookie_of(typed);
  const auto known = by_cookie(cookie);
  ASSERT_TRUE(known.identity);
  EXPECT_EQ(known.identity->role, AccessRole::Operator);
  EXPECT_EQ(cookie_of(code), "") << "a second time";
  const std::string late = access_.make_code(bridge, AccessRole::Viewer).value();
  now_ += AccessControl::kCodeLifetime;
  EXPECT_EQ(cookie_of(late), "");
  const std::string orphan = access_.make_code(bridge, AccessRole::Viewer).value();
  access_.replace(without("bridge"));
  EXPECT_EQ(cookie_of(orphan), "");
  access_.replace(without("chief"));
  EXPECT_FALSE(by_cookie(cookie).identity) << "its maker is gone";
  EXPECT_FALSE(by_header("Bearer " + code).identity) << "a code is for logging in alone";
}

TEST_F(AccessControlTest, KeepsABoundedNumberOfCodes) {
  const AccessControl::Identity chief{AccessRole::Admin, "chief", false};
  std::set<std::string> codes;
  const std::string first = access_.make_code(chief, AccessRole::Viewer).value();
  std::string last;
  for (std::size_t i = 0; i < AccessControl::kMostCodes; ++i)
    codes.insert(last = access_.make_code(chief, AccessRole::Viewer).value());
  EXPECT_EQ(codes.size(), AccessControl::kMostCodes);
  EXPECT_EQ(cookie_of(first), "");
  EXPECT_NE(cookie_of(last), "");
}

TEST_F(AccessControlTest, WrongOnesAreCountedByAddressAndRightOnesInTheHeaderAreNot) {
  const auto wrong = [this](const std::string& address, double now_s) {
    return access_.identify("Bearer wrong", "", address, false, now_s).refusal;
  };
  for (int i = 0; i < static_cast<int>(AttemptLimit::kBurst); ++i) EXPECT_EQ(wrong("10.0.0.7", 0), Refusal::Wrong) << i;
  EXPECT_EQ(wrong("10.0.0.7", 0), Refusal::TooMany);
  EXPECT_EQ(access_.login(kOperator, "10.0.0.7", false, 0).outcome.refusal, Refusal::TooMany);
  EXPECT_EQ(wrong("10.0.0.8", 0), Refusal::Wrong);
  EXPECT_TRUE(access_.identify("Bearer " + kOperator, "", "10.0.0.7", false, 0).identity);
  EXPECT_EQ(wrong("10.0.0.7", 1 / AttemptLimit::kPerSecond), Refusal::Wrong);
}

TEST(AttemptLimit, OneMachineHasManyAddressesOfIPv6) {
  AttemptLimit limit;
  for (int i = 0; i < static_cast<int>(AttemptLimit::kBurst); ++i)
    EXPECT_TRUE(limit.take("2001:db8::" + std::to_string(i), 0));
  EXPECT_FALSE(limit.take("2001:db8::ffff", 0));
  EXPECT_TRUE(limit.take("2001:db8:0:1::1", 0));
}

TEST(AttemptLimit, ManyAddressesTogetherAreBoundedToo) {
  AttemptLimit limit;
  int taken = 0;
  for (int i = 0; i < 10'000; ++i)
    taken += limit.take("10.1." + std::to_string(i / 256) + '.' + std::to_string(i % 256), 0) ? 1 : 0;
  EXPECT_EQ(taken, static_cast<int>(AttemptLimit::kBurstOfAll));
}

}  // namespace
}  // namespace spectra::access
