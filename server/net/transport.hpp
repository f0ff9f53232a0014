#pragma once

#include <array>
#include <boost/asio/associated_cancellation_slot.hpp>
#include <boost/asio/associated_executor.hpp>
#include <boost/asio/async_result.hpp>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/dispatch.hpp>
#include <boost/beast/core/error.hpp>
#include <boost/beast/core/role.hpp>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "server/net/connection_stream.hpp"

namespace boost::asio::ssl {
class context;
}

namespace spectra::net {

/// A connection as HTTP and WebSocket read and write it: as it is, or encrypted (TLS) after a handshake. Deadlines, counts of bytes and
/// closing are those of the connection below, next_layer(). To be used on the connection's strand.
///
/// What is below is compiled once: whoever waits is behind one virtual call, so that the operations of Beast do not multiply with those of
/// OpenSSL and TCP in every place that uses them.
class Transport {
 public:
  using next_layer_type = ConnectionStream;
  using executor_type = ConnectionStream::executor_type;
  using TlsContext = std::shared_ptr<boost::asio::ssl::context>;
  using Error = boost::beast::error_code;

  explicit Transport(ConnectionStream stream);
  explicit Transport(const executor_type& executor);
  Transport(Transport&&) noexcept;
  Transport& operator=(Transport&&) noexcept;
  ~Transport();

  executor_type get_executor() noexcept { return next_layer().get_executor(); }
  next_layer_type& next_layer() noexcept;
  const next_layer_type& next_layer() const noexcept;
  bool is_encrypted() const noexcept;

  /// As the server, whose peer has sent `received` already. All that is read and written afterwards is encrypted.
  boost::asio::awaitable<Error> accept_handshake(TlsContext context, boost::asio::const_buffer received);
  /// As the client of this host, whose certificate must be of it and trusted by `context`.
  struct Handshake {
    Error error;
    std::string distrust;  ///< Why the certificate is not trusted; empty when it is.
  };
  boost::asio::awaitable<Handshake> begin_handshake(TlsContext context, std::string host);
  /// Tells the peer that nothing follows, and waits for its end of TLS where there is one.
  boost::asio::awaitable<void> end_writing();

  template <class Buffers, class Token>
  auto async_read_some(const Buffers& buffers, Token&& token) {
    return boost::asio::async_initiate<Token, void(Error, std::size_t)>(
        [](auto handler, Transport* self, const auto& into) {
          const auto slot = boost::asio::get_associated_cancellation_slot(handler);
          self->read_some(into, slot, self->waiter(std::move(handler)));
        },
        token, this, BufferList<boost::asio::mutable_buffer>(buffers));
  }

  template <class Buffers, class Token>
  auto async_write_some(const Buffers& buffers, Token&& token) {
    return boost::asio::async_initiate<Token, void(Error, std::size_t)>(
        [](auto handler, Transport* self, const auto& from) {
          const auto slot = boost::asio::get_associated_cancellation_slot(handler);
          self->write_some(from, slot, self->waiter(std::move(handler)));
        },
        token, this, BufferList<boost::asio::const_buffer>(buffers));
  }

 private:
  struct Layers;

  /// The first buffers of a sequence: more are not moved at a time.
  template <class Buffer>
  class BufferList {
   public:
    using value_type = Buffer;
    template <class Buffers>
    explicit BufferList(const Buffers& buffers) {
      const auto end = boost::asio::buffer_sequence_end(buffers);
      for (auto it = boost::asio::buffer_sequence_begin(buffers); it != end && count_ < all_.size(); ++it) {
        if (Buffer(*it).size() > 0) all_[count_++] = *it;
      }
    }
    const Buffer* begin() const { return all_.data(); }
    const Buffer* end() const { return all_.data() + count_; }

   private:
    /// A header of HTTP has one for each field.
    static constexpr std::size_t kMost = 32;
    std::array<Buffer, kMost> all_;
    std::size_t count_ = 0;
  };

  /// Who waits for an operation.
  class Waiter {
   public:
    virtual ~Waiter() = default;
    virtual void done(Error error, std::size_t size) = 0;
  };
  using WaiterPtr = std::unique_ptr<Waiter>;

  template <class Handler>
  WaiterPtr waiter(Handler handler) {
    class WaiterOf final : public Waiter {
     public:
      WaiterOf(Handler handler_in, executor_type executor) : handler_(std::move(handler_in)), executor_(executor) {}
      void done(Error error, std::size_t size) override {
        auto executor = boost::asio::get_associated_executor(handler_, executor_);
        boost::asio::dispatch(
            executor, [handler = std::move(handler_), error, size]() mutable { std::move(handler)(error, size); });
      }

     private:
      Handler handler_;
      executor_type executor_;
    };
    return std::make_unique<WaiterOf>(std::move(handler), get_executor());
  }

  using Slot = boost::asio::cancellation_slot;
  void read_some(const BufferList<boost::asio::mutable_buffer>& buffers, Slot slot, WaiterPtr waiter);
  void write_some(const BufferList<boost::asio::const_buffer>& buffers, Slot slot, WaiterPtr waiter);
  void tear_down(boost::beast::role_type role, std::function<void(Error)> done);

  template <class Handler>
  friend void async_teardown(boost::beast::role_type role, Transport& transport, Handler&& handler) {
    // The handler may be moved alone, and a function is copied: it is shared.
    const auto shared = std::make_shared<std::decay_t<Handler>>(std::forward<Handler>(handler));
    transport.tear_down(role, [shared](Error error) { std::move (*shared)(error); });
  }

  std::unique_ptr<Layers> layers_;
};

}  // namespace spectra::net
