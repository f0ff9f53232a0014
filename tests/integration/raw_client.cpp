#include "tests/integration/raw_client.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <stdexcept>
#include <utility>

namespace spectra::tests {
namespace {

using Clock = std::chrono::steady_clock;

int milliseconds_until(Clock::time_point deadline) {
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
  return left > 0 ? static_cast<int>(left) : 0;
}

}  // namespace

RawClient::RawClient(std::uint16_t port) : descriptor_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const void* raw = &address;
  if (descriptor_ < 0 || connect(descriptor_, static_cast<const sockaddr*>(raw), sizeof address) != 0) {
    throw std::runtime_error("cannot connect");
  }
}

RawClient::~RawClient() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

RawClient::RawClient(RawClient&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

bool RawClient::send(std::string_view bytes) {
  while (!bytes.empty()) {
    const auto sent = ::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
  return true;
}

std::size_t RawClient::send_some(std::string_view bytes) {
  const auto sent = ::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  return sent > 0 ? static_cast<std::size_t>(sent) : 0;
}

std::optional<std::string> RawClient::receive_some(std::chrono::milliseconds timeout) {
  pollfd waiting{descriptor_, POLLIN, 0};
  if (poll(&waiting, 1, static_cast<int>(timeout.count())) <= 0) return std::nullopt;
  std::string bytes(65536, '\0');
  const auto received = recv(descriptor_, bytes.data(), bytes.size(), 0);
  if (received <= 0) return std::nullopt;
  bytes.resize(static_cast<std::size_t>(received));
  return bytes;
}

std::optional<std::string> RawClient::receive_all(std::chrono::milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  std::string all;
  for (;;) {
    pollfd waiting{descriptor_, POLLIN, 0};
    if (poll(&waiting, 1, milliseconds_until(deadline)) <= 0) return std::nullopt;
    char bytes[65536];
    const auto received = recv(descriptor_, bytes, sizeof bytes, 0);
    if (received <= 0) return all;
    all.append(bytes, static_cast<std::size_t>(received));
  }
}

void RawClient::set_receive_buffer(int bytes) {
  setsockopt(descriptor_, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
}

std::string http_exchange(std::uint16_t port, std::string_view request) {
  RawClient client(port);
  client.send(request);
  return client.receive_all().value_or("");
}

int status_of(std::string_view response) {
  if (!response.starts_with("HTTP/1.1 ") && !response.starts_with("HTTP/1.0 ")) return 0;
  return std::atoi(std::string(response.substr(9, 3)).c_str());
}

unsigned WebSocketFrame::close_code() const {
  if (opcode != 8 || payload.size() < 2) return 0;
  return static_cast<unsigned>(static_cast<unsigned char>(payload[0])) * 256U + static_cast<unsigned char>(payload[1]);
}

std::string masked_frame(unsigned opcode, std::string_view payload, bool is_final) {
  constexpr char kMask[4] = {0x12, 0x34, 0x56, 0x78};
  std::string frame;
  frame.push_back(static_cast<char>(opcode | (is_final ? 0x80U : 0U)));
  const auto append_size = [&frame, &payload](int byte_count) {
    for (int shift = 8 * (byte_count - 1); shift >= 0; shift -= 8) {
      frame.push_back(static_cast<char>(payload.size() >> static_cast<unsigned>(shift) & 0xffU));
    }
  };
  if (payload.size() < 126) {
    frame.push_back(static_cast<char>(0x80U | payload.size()));
  } else if (payload.size() < 65536) {
    frame.push_back(static_cast<char>(0x80U | 126U));
    append_size(2);
  } else {
    frame.push_back(static_cast<char>(0x80U | 127U));
    append_size(8);
  }
  frame.append(kMask, 4);
  for (std::size_t i = 0; i < payload.size(); ++i) frame.push_back(static_cast<char>(payload[i] ^ kMask[i % 4]));
  return frame;
}

RawWebSocket::RawWebSocket(std::uint16_t port, std::string_view extra_headers, std::string_view subprotocol,
                           std::string_view target)
    : client_(port) {
  std::string request = "GET " + std::string(target) +
                        " HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
                        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
  if (!subprotocol.empty()) request.append("Sec-WebSocket-Protocol: ").append(subprotocol).append("\r\n");
  request.append(extra_headers).append("\r\n");
  client_.send(request);
  while (buffer_.find("\r\n\r\n") == std::string::npos) {
    const auto bytes = client_.receive_some();
    if (!bytes) break;
    buffer_ += *bytes;
  }
  const auto end = buffer_.find("\r\n\r\n");
  if (end == std::string::npos) return;
  upgrade_response_ = buffer_.substr(0, end + 4);
  buffer_.erase(0, end + 4);
  is_open_ = status_of(upgrade_response_) == 101;
}

bool RawWebSocket::send_frame(unsigned opcode, std::string_view payload, bool is_final) {
  return client_.send(masked_frame(opcode, payload, is_final));
}

std::optional<WebSocketFrame> RawWebSocket::receive(std::chrono::milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  for (;;) {
    if (buffer_.size() >= 2) {
      const auto byte = [this](std::size_t i) { return static_cast<unsigned char>(buffer_[i]); };
      std::size_t header_size = 2;
      std::uint64_t size = byte(1) & 0x7fU;
      const std::size_t extra = size == 126 ? 2 : size == 127 ? 8 : 0;
      header_size += extra;
      if (buffer_.size() >= header_size) {
        if (extra > 0) size = 0;
        for (std::size_t i = 0; i < extra; ++i) size = size * 256 + byte(2 + i);
        if (buffer_.size() >= header_size + size) {
          WebSocketFrame frame{byte(0) & 0x0fU, (byte(0) & 0x80U) != 0, buffer_.substr(header_size, size)};
          buffer_.erase(0, header_size + size);
          return frame;
        }
      }
    }
    const auto bytes = client_.receive_some(std::chrono::milliseconds(milliseconds_until(deadline)));
    if (!bytes) return std::nullopt;
    buffer_ += *bytes;
  }
}

std::optional<std::string> RawWebSocket::receive_text(std::chrono::milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  while (auto frame = receive(std::chrono::milliseconds(milliseconds_until(deadline)))) {
    if (frame->opcode == 1) return std::move(frame->payload);
  }
  return std::nullopt;
}

unsigned RawWebSocket::receive_close_code(std::chrono::milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  while (const auto frame = receive(std::chrono::milliseconds(milliseconds_until(deadline)))) {
    if (frame->opcode == 8) return frame->close_code();
  }
  return 0;
}

}  // namespace spectra::tests
