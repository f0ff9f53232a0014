#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

namespace boost::asio::ssl {
class context;
}

namespace spectra::net {

/// Certificate and private key that a server shows, TLS 1.2 or newer. Thread-safe.
class TlsIdentity {
 public:
  /// PEM files: the certificate with those that vouch for it after it, and its key.
  TlsIdentity(std::filesystem::path certificate, std::filesystem::path key);

  /// Reads both files; from now on they hold for new connections. A sentence, and nothing changes, when they cannot be used.
  std::optional<std::string> load();

  /// Of the last load() that succeeded; never empty after one.
  std::shared_ptr<boost::asio::ssl::context> current() const;

 private:
  const std::filesystem::path certificate_;
  const std::filesystem::path key_;
  mutable std::mutex mutex_;
  std::shared_ptr<boost::asio::ssl::context> context_;
};

}  // namespace spectra::net
