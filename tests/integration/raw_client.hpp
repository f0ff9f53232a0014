#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace spectra::tests {

/// A blocking TCP client that sends exactly the bytes it is told to: what no decent client library does.
class RawClient {
 public:
  explicit RawClient(std::uint16_t port);
  ~RawClient();
  RawClient(RawClient&& other) noexcept;
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  /// False when the peer has gone. Waits when the peer does not read.
  bool send(std::string_view bytes);
  /// The same without waiting; returns how many bytes went.
  std::size_t send_some(std::string_view bytes);

  /// At least one byte, or nothing at the peer's end or after the timeout.
  std::optional<std::string> receive_some(std::chrono::milliseconds timeout = std::chrono::seconds(10));
  /// Everything to the peer's end; nothing when it does not end in time.
  std::optional<std::string> receive_all(std::chrono::milliseconds timeout = std::chrono::seconds(10));

  void set_receive_buffer(int bytes);
  int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
};

/// One HTTP exchange on a connection of its own: everything the server said.
std::string http_exchange(std::uint16_t port, std::string_view request);

/// The status of a response, 0 when there is none.
int status_of(std::string_view response);

/// A WebSocket frame as the server sent it.
struct WebSocketFrame {
  unsigned opcode = 0;
  bool is_final = false;
  std::string payload;
  /// The code of a close frame, 0 for another one.
  unsigned close_code() const;
};

/// A WebSocket client over a RawClient, frame by frame.
class RawWebSocket {
 public:
  /// Connects and upgrades; check is_open(). `extra_headers` are whole lines that end in CRLF.
  explicit RawWebSocket(std::uint16_t port, std::string_view extra_headers = "",
                        std::string_view subprotocol = "spectra.v1", std::string_view target = "/ws");

  bool is_open() const { return is_open_; }
  const std::string& upgrade_response() const { return upgrade_response_; }
  RawClient& client() { return client_; }

  bool send_frame(unsigned opcode, std::string_view payload, bool is_final = true);
  bool send_text(std::string_view text) { return send_frame(1, text); }
  /// The next frame; nothing at the end of the connection or after the timeout.
  std::optional<WebSocketFrame> receive(std::chrono::milliseconds timeout = std::chrono::seconds(10));
  /// The next text, answering no ping and skipping everything else.
  std::optional<std::string> receive_text(std::chrono::milliseconds timeout = std::chrono::seconds(10));
  /// Reads until a close frame and returns its code; 0 when the connection ends without one.
  unsigned receive_close_code(std::chrono::milliseconds timeout = std::chrono::seconds(10));

 private:
  RawClient client_;
  std::string buffer_;
  std::string upgrade_response_;
  bool is_open_ = false;
};

/// A client frame with a mask.
std::string masked_frame(unsigned opcode, std::string_view payload, bool is_final = true);

}  // namespace spectra::tests
