#include "server/access/certificate.hpp"

#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <array>
#include <boost/asio/ip/address.hpp>
#include <ctime>
#include <memory>
#include <stdexcept>

namespace spectra::access {
namespace {

constexpr std::chrono::hours kClockDifference{1};
constexpr int kSerialBits = 159;
constexpr long kVersion3 = 2;

struct Free {
  void operator()(X509* x) const { X509_free(x); }
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
  void operator()(BIO* bio) const { BIO_free_all(bio); }
  void operator()(X509_EXTENSION* extension) const { X509_EXTENSION_free(extension); }
  void operator()(BIGNUM* number) const { BN_free(number); }
  void operator()(GENERAL_NAMES* names) const { GENERAL_NAMES_free(names); }
};
template <class T>
using Owned = std::unique_ptr<T, Free>;

void require(bool is_done, const char* what) {
  if (!is_done) throw std::runtime_error(std::string("cannot make a certificate: ") + what);
}

bool is_address(const std::string& name) {
  boost::system::error_code error;
  boost::asio::ip::make_address(name, error);
  return !error;
}

bool is_host_name(const std::string& name) {
  constexpr std::size_t kLongest = 253;
  return !name.empty() && name.size() <= kLongest && name.front() != '.' && name.front() != '-' &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '-';
         });
}

void add_extension(X509* certificate, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, certificate, certificate, nullptr, nullptr, 0);
  const Owned<X509_EXTENSION> extension(X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str()));
  require(extension && X509_add_ext(certificate, extension.get(), -1) == 1, value.c_str());
}

void set_random_serial(X509* certificate) {
  const Owned<BIGNUM> serial(BN_new());
  require(serial && BN_rand(serial.get(), kSerialBits, BN_RAND_TOP_ONE, BN_RAND_BOTTOM_ANY) == 1 &&
              BN_to_ASN1_INTEGER(serial.get(), X509_get_serialNumber(certificate)) != nullptr,
          "no random number");
}

template <class Write>
std::string pem_of(Write write) {
  const Owned<BIO> bio(BIO_new(BIO_s_mem()));
  require(bio && write(bio.get()) == 1, "it cannot be written");
  char* data = nullptr;
  const long size = BIO_get_mem_data(bio.get(), &data);
  return {data, static_cast<std::size_t>(size)};
}

std::chrono::sys_seconds time_of(const ASN1_TIME* time) {
  std::tm parts{};
  if (ASN1_TIME_to_tm(time, &parts) != 1) return {};
  return std::chrono::sys_seconds(std::chrono::seconds(timegm(&parts)));
}

std::string text_of(const ASN1_STRING* text) {
  return {reinterpret_cast<const char*>(ASN1_STRING_get0_data(text)),
          static_cast<std::size_t>(ASN1_STRING_length(text))};
}

std::string text_of_address(const std::string& bytes) {
  namespace ip = boost::asio::ip;
  if (bytes.size() == ip::address_v4::bytes_type().size()) {
    ip::address_v4::bytes_type address;
    std::copy(bytes.begin(), bytes.end(), address.begin());
    return ip::address_v4(address).to_string();
  }
  ip::address_v6::bytes_type address{};
  if (bytes.size() != address.size()) return "";
  std::copy(bytes.begin(), bytes.end(), address.begin());
  return ip::address_v6(address).to_string();
}

}  // namespace

std::variant<SelfMadeCertificate, std::string> make_certificate(const std::vector<std::string>& names,
                                                                std::chrono::sys_seconds now,
                                                                std::chrono::days lifetime) {
  std::string alternatives;
  for (const std::string& name : names) {
    if (!is_address(name) && !is_host_name(name)) return name + " is neither a host name nor an IP address";
    alternatives += (alternatives.empty() ? "" : ",") + std::string(is_address(name) ? "IP:" : "DNS:") + name;
  }
  if (names.empty()) return std::string("a certificate needs a host name or an IP address");

  const Owned<EVP_PKEY> key(EVP_EC_gen("P-256"));
  const Owned<X509> certificate(X509_new());
  require(key && certificate, "no key");
  X509* const x = certificate.get();
  X509_set_version(x, kVersion3);
  set_random_serial(x);
  require(ASN1_TIME_set(X509_getm_notBefore(x), std::chrono::system_clock::to_time_t(now - kClockDifference)) &&
              ASN1_TIME_set(X509_getm_notAfter(x), std::chrono::system_clock::to_time_t(now + lifetime)),
          "no such time");
  X509_NAME* const subject = X509_get_subject_name(x);
  // The common name holds 64 characters at most; who looks for the host looks at the alternative names.
  constexpr std::size_t kLongestCommonName = 64;
  const std::string common = names.front().substr(0, kLongestCommonName);
  require(X509_NAME_add_entry_by_txt(subject, "O", MBSTRING_ASC, reinterpret_cast<const unsigned char*>("Spectra"), -1,
                                     -1, 0) == 1 &&
              X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC,
                                         reinterpret_cast<const unsigned char*>(common.c_str()), -1, -1, 0) == 1 &&
              X509_set_issuer_name(x, subject) == 1 && X509_set_pubkey(x, key.get()) == 1,
          "no such name");
  // It vouches for itself and for nothing else, so that whoever trusts it trusts this server alone.
  add_extension(x, NID_basic_constraints, "critical,CA:FALSE");
  add_extension(x, NID_key_usage, "critical,digitalSignature");
  add_extension(x, NID_ext_key_usage, "serverAuth");
  add_extension(x, NID_subject_alt_name, alternatives);
  require(X509_sign(x, key.get(), EVP_sha256()) > 0, "it cannot be signed");
  return SelfMadeCertificate{pem_of([x](BIO* bio) { return PEM_write_bio_X509(bio, x); }), pem_of([&key](BIO* bio) {
                               return PEM_write_bio_PKCS8PrivateKey(bio, key.get(), nullptr, nullptr, 0, nullptr,
                                                                    nullptr);
                             })};
}

std::variant<CertificateFacts, std::string> certificate_facts(const std::string& pem) {
  const Owned<BIO> bio(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
  const Owned<X509> x(bio ? PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr) : nullptr);
  if (!x) return std::string("there is no certificate in PEM form");
  CertificateFacts facts;
  facts.not_before = time_of(X509_get0_notBefore(x.get()));
  facts.not_after = time_of(X509_get0_notAfter(x.get()));
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  require(X509_digest(x.get(), EVP_sha256(), digest.data(), &size) == 1, "no fingerprint");
  constexpr char kDigits[] = "0123456789ABCDEF";
  for (unsigned i = 0; i < size; ++i) {
    if (i > 0) facts.fingerprint += ':';
    facts.fingerprint += kDigits[digest[i] >> 4];
    facts.fingerprint += kDigits[digest[i] & 15];
  }
  const Owned<GENERAL_NAMES> names(
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(x.get(), NID_subject_alt_name, nullptr, nullptr)));
  for (int i = 0; names && i < sk_GENERAL_NAME_num(names.get()); ++i) {
    const GENERAL_NAME* name = sk_GENERAL_NAME_value(names.get(), i);
    if (name->type == GEN_DNS) facts.names.push_back(text_of(name->d.dNSName));
    if (name->type == GEN_IPADD) facts.names.push_back(text_of_address(text_of(name->d.iPAddress)));
  }
  return facts;
}

}  // namespace spectra::access
