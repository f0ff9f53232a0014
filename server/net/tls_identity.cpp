#include "server/net/tls_identity.hpp"

#include <openssl/err.h>
#include <openssl/ssl.h>
#include <sys/stat.h>

#include <boost/asio/ssl/context.hpp>
#include <fstream>
#include <string_view>
#include <utility>

namespace spectra::net {
namespace ssl = boost::asio::ssl;
using boost::system::error_code;

namespace {

constexpr unsigned char kHttp11[] = "\x08http/1.1";

/// The one protocol that is spoken here; a peer that offers others alone gets none agreed, and may go.
int select_protocol(SSL*, const unsigned char** chosen, unsigned char* chosen_size, const unsigned char* offered,
                    unsigned offered_size, void*) {
  unsigned char* found = nullptr;
  if (SSL_select_next_proto(&found, chosen_size, kHttp11, sizeof kHttp11 - 1, offered, offered_size) !=
      OPENSSL_NPN_NEGOTIATED) {
    return SSL_TLSEXT_ERR_NOACK;
  }
  *chosen = found;
  return SSL_TLSEXT_ERR_OK;
}

std::string problem_with(const std::filesystem::path& file, std::string_view what, const error_code& error) {
  return file.string() + ": " + std::string(what) + " (" + error.message() + ')';
}

}  // namespace

TlsIdentity::TlsIdentity(std::filesystem::path certificate, std::filesystem::path key)
    : certificate_(std::move(certificate)), key_(std::move(key)) {}

std::optional<std::string> TlsIdentity::load() {
  for (const auto& file : {certificate_, key_}) {
    if (!std::ifstream(file)) return file.string() + ": cannot be opened";
  }
  struct stat info {};
  if (stat(key_.c_str(), &info) == 0 && (info.st_mode & (S_IROTH | S_IWOTH)) != 0) {
    return key_.string() + ": everybody on this machine can read this key; chmod o-rwx it, and make a new one";
  }
  auto context = std::make_shared<ssl::context>(ssl::context::tls_server);
  SSL_CTX* const native = context->native_handle();
  SSL_CTX_set_min_proto_version(native, TLS1_2_VERSION);
  SSL_CTX_set_options(native, SSL_OP_NO_COMPRESSION | SSL_OP_NO_RENEGOTIATION | SSL_OP_CIPHER_SERVER_PREFERENCE);
  SSL_CTX_set_mode(native, SSL_MODE_RELEASE_BUFFERS);
  SSL_CTX_set_alpn_select_cb(native, select_protocol, nullptr);
  // A key with a password is refused: nobody is there to type it.
  context->set_password_callback([](std::size_t, ssl::context::password_purpose) { return std::string(); });
  error_code error;
  ERR_clear_error();
  context->use_certificate_chain_file(certificate_.string(), error);
  if (error) return problem_with(certificate_, "is no certificate in PEM form", error);
  context->use_private_key_file(key_.string(), ssl::context::pem, error);
  // OpenSSL compares the two as it takes the second one.
  if (error && SSL_CTX_get0_privatekey(native) == nullptr &&
      ERR_GET_LIB(static_cast<unsigned long>(error.value())) == ERR_LIB_X509) {
    return key_.string() + ": is not the key of " + certificate_.string();
  }
  if (error) return problem_with(key_, "is no private key in PEM form without a password", error);
  if (SSL_CTX_check_private_key(native) != 1) return key_.string() + ": is not the key of " + certificate_.string();
  const std::lock_guard lock(mutex_);
  context_ = std::move(context);
  return std::nullopt;
}

std::shared_ptr<ssl::context> TlsIdentity::current() const {
  const std::lock_guard lock(mutex_);
  return context_;
}

}  // namespace spectra::net
