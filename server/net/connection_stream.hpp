#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/as_tuple.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core/basic_stream.hpp>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace spectra::net {

/// Counts what a stream has moved and limits nothing: the one way to see progress inside a single long write.
class CountingPolicy {
 public:
  std::uint64_t read_bytes() const { return read_bytes_; }
  std::uint64_t written_bytes() const { return written_bytes_; }

 private:
  friend class boost::beast::rate_policy_access;
  static std::size_t available_read_bytes() { return std::numeric_limits<std::size_t>::max(); }
  static std::size_t available_write_bytes() { return std::numeric_limits<std::size_t>::max(); }
  void transfer_read_bytes(std::size_t count) { read_bytes_ += count; }
  void transfer_write_bytes(std::size_t count) { written_bytes_ += count; }
  static void on_timer() {}

  std::uint64_t read_bytes_ = 0;
  std::uint64_t written_bytes_ = 0;
};

/// The transport under HTTP and WebSocket connections.
using ConnectionStream = boost::beast::basic_stream<boost::asio::ip::tcp, boost::asio::any_io_executor, CountingPolicy>;

/// Completes with (error_code, result) instead of throwing.
inline constexpr auto kAwait = boost::asio::as_tuple(boost::asio::use_awaitable);

}  // namespace spectra::net
