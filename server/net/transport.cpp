#include "server/net/transport.hpp"

#include <openssl/ssl.h>

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/host_name_verification.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/beast/core/flat_stream.hpp>
#include <boost/beast/websocket/teardown.hpp>
#include <optional>

namespace spectra::net {
namespace asio = boost::asio;
namespace ssl = boost::asio::ssl;

struct Transport::Layers {
  explicit Layers(ConnectionStream stream) : connection(std::move(stream)) {}

  ssl::stream<ConnectionStream&>& begin(TlsContext with) {
    context = std::move(with);
    return tls.emplace(connection, *context).next_layer();
  }

  ConnectionStream connection;
  TlsContext context;
  // OpenSSL takes one buffer at a time; flat_stream makes one record of a header and what follows it.
  std::optional<boost::beast::flat_stream<ssl::stream<ConnectionStream&>>> tls;
};

Transport::Transport(ConnectionStream stream) : layers_(std::make_unique<Layers>(std::move(stream))) {}
Transport::Transport(const executor_type& executor) : Transport(ConnectionStream(executor)) {}
Transport::Transport(Transport&&) noexcept = default;
Transport& Transport::operator=(Transport&&) noexcept = default;
Transport::~Transport() = default;

ConnectionStream& Transport::next_layer() noexcept {
  return layers_->connection;
}
const ConnectionStream& Transport::next_layer() const noexcept {
  return layers_->connection;
}
bool Transport::is_encrypted() const noexcept {
  return layers_->tls.has_value();
}

asio::awaitable<Transport::Error> Transport::accept_handshake(TlsContext context, asio::const_buffer received) {
  auto& tls = layers_->begin(std::move(context));
  const auto [error, size] = co_await tls.async_handshake(ssl::stream_base::server, received, kAwait);
  co_return error;
}

asio::awaitable<Transport::Handshake> Transport::begin_handshake(TlsContext context, std::string host) {
  auto& tls = layers_->begin(std::move(context));
  SSL* const native = tls.native_handle();
  tls.set_verify_mode(ssl::verify_peer);
  tls.set_verify_callback(ssl::host_name_verification(host));
  // SSL_set_tlsext_host_name, whose macro casts as C does.
  SSL_ctrl(native, SSL_CTRL_SET_TLSEXT_HOSTNAME, TLSEXT_NAMETYPE_host_name, host.data());
  const auto [error] = co_await tls.async_handshake(ssl::stream_base::client, kAwait);
  const long verdict = error ? SSL_get_verify_result(native) : X509_V_OK;
  co_return Handshake{error, verdict == X509_V_OK ? "" : X509_verify_cert_error_string(verdict)};
}

asio::awaitable<void> Transport::end_writing() {
  if (layers_->tls) co_await layers_->tls->next_layer().async_shutdown(kAwait);
  Error ignored;
  layers_->connection.socket().shutdown(asio::ip::tcp::socket::shutdown_send, ignored);
}

void Transport::read_some(const BufferList<asio::mutable_buffer>& buffers, Slot slot, WaiterPtr waiter) {
  auto done = asio::bind_cancellation_slot(
      slot, [waiter = std::move(waiter)](Error error, std::size_t size) { waiter->done(error, size); });
  if (layers_->tls) {
    layers_->tls->async_read_some(buffers, std::move(done));
  } else {
    layers_->connection.async_read_some(buffers, std::move(done));
  }
}

void Transport::write_some(const BufferList<asio::const_buffer>& buffers, Slot slot, WaiterPtr waiter) {
  auto done = asio::bind_cancellation_slot(
      slot, [waiter = std::move(waiter)](Error error, std::size_t size) { waiter->done(error, size); });
  if (layers_->tls) {
    layers_->tls->async_write_some(buffers, std::move(done));
  } else {
    layers_->connection.async_write_some(buffers, std::move(done));
  }
}

void Transport::tear_down(boost::beast::role_type role, std::function<void(Error)> done) {
  // A WebSocket has said its own good-bye: that of TLS is not waited for.
  boost::beast::websocket::async_teardown(role, layers_->connection.socket(), std::move(done));
}

}  // namespace spectra::net
