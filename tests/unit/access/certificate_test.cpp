#include "server/access/certificate.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace spectra::access {
namespace {

using std::chrono::days;
using std::chrono::hours;
using std::chrono::sys_seconds;

constexpr sys_seconds kNow{std::chrono::seconds(1'800'000'000)};

SelfMadeCertificate made(const std::vector<std::string>& names) {
  return std::get<SelfMadeCertificate>(make_certificate(names, kNow, days(30)));
}

TEST(Certificate, NamesWhatItIsForAndWhenItIsGood) {
  const auto pair = made({"robot", "robot.local", "192.168.7.1", "fe80::1"});
  EXPECT_THAT(pair.key, testing::StartsWith("-----BEGIN PRIVATE KEY-----"));
  const auto facts = std::get<CertificateFacts>(certificate_facts(pair.certificate));
  EXPECT_THAT(facts.names, testing::ElementsAre("robot", "robot.local", "192.168.7.1", "fe80::1"));
  EXPECT_EQ(facts.not_before, kNow - hours(1));
  EXPECT_EQ(facts.not_after, kNow + days(30));
  EXPECT_THAT(facts.fingerprint, testing::MatchesRegex("[0-9A-F:]+"));
  EXPECT_EQ(facts.fingerprint.size(), 95U);
}

TEST(Certificate, IsAnotherOneEveryTime) {
  const auto one = made({"robot"}), other = made({"robot"});
  EXPECT_NE(one.key, other.key);
  EXPECT_NE(std::get<CertificateFacts>(certificate_facts(one.certificate)).fingerprint,
            std::get<CertificateFacts>(certificate_facts(other.certificate)).fingerprint);
}

TEST(Certificate, RefusesWhatIsNoName) {
  for (const char* name :
       {"", "two words", "robot,DNS:other", "robot\nDNS:other", "-robot", "http://robot", "*.robot"}) {
    const auto refused = make_certificate({name}, kNow, days(1));
    ASSERT_TRUE(std::holds_alternative<std::string>(refused)) << name;
    EXPECT_THAT(std::get<std::string>(refused), testing::HasSubstr("neither a host name nor an IP address"));
  }
  EXPECT_TRUE(std::holds_alternative<std::string>(make_certificate({}, kNow, days(1))));
}

TEST(Certificate, HasNoFactsWhereThereIsNone) {
  for (const char* text : {"", "hello", "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n"}) {
    EXPECT_TRUE(std::holds_alternative<std::string>(certificate_facts(text))) << text;
  }
}

}  // namespace
}  // namespace spectra::access
