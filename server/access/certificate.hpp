#pragma once

#include <chrono>
#include <string>
#include <variant>
#include <vector>

namespace spectra::access {

/// A certificate that vouches for itself, and its key.
struct SelfMadeCertificate {
  std::string certificate;  ///< PEM.
  std::string key;          ///< PEM, P-256, without a password.
};

/// For these host names and IP addresses (at least one), from an hour before `now`, for clocks differ, on for `lifetime`. A sentence when a
/// name cannot be one. Throws std::runtime_error when the library fails.
std::variant<SelfMadeCertificate, std::string> make_certificate(const std::vector<std::string>& names,
                                                                std::chrono::sys_seconds now,
                                                                std::chrono::days lifetime);

/// What a certificate says of itself.
struct CertificateFacts {
  std::string fingerprint;  ///< SHA-256 over its DER form, as browsers show it: AB:CD:...
  std::vector<std::string> names;
  std::chrono::sys_seconds not_before, not_after;
};

/// Of the first certificate in a text in PEM form; a sentence when there is none.
std::variant<CertificateFacts, std::string> certificate_facts(const std::string& pem);

}  // namespace spectra::access
